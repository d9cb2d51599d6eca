// What a window keeps of what leaves, by the types of the variables (M10): its options are those of marginalization.
#include <gtest/gtest.h>

#include "linear_window.h"

namespace oriel {
namespace {

using namespace linear_world;
using Status = WindowUpdate::Status;

struct Totals {
  int slides = 0, states = 0, variables = 0, factors = 0, ties = 0;
  std::size_t graph_variables = 0, graph_factors = 0;
};

// A drive with levels at every state, each with an offset beside it, and landmarks that stay; counted over 30 slides.
template <class Look>
Totals drive(std::span<const TypePolicy> types, Look&& look) {
  WindowOptions options = LinearWindow::exact();
  options.marginalize.types = types;
  LinearWindow w(4, 41, options);
  Totals t;
  for (int k = 0; k < 34; ++k) {
    w.move_to(100 * k + 100);
    w.give({w.position_at(100 * k), w.level_at(100 * k), w.offset_at(100 * k), w.tie(100 * k, 100 * k)});
    w.give({w.sight(100 * k, k / 3), w.sight(100 * k, k / 3 + 1)});
    const WindowUpdate& update = w.window.update();
    EXPECT_EQ(update.status, Status::updated) << update.error.message;
    t.slides += update.states_marginalized > 0 ? 1 : 0;
    t.states += update.states_marginalized;
    t.variables += update.slide.dropped_variables;
    t.factors += update.slide.dropped_with_landmarks;
    t.ties += update.slide.dropped_ties;
    if (k > 10) look(w);
  }
  t.graph_variables = w.window.graph().variable_count();
  t.graph_factors = w.window.graph().factor_count();
  return t;
}
constexpr auto kNothing = [](const LinearWindow&) {};

// Whether a prior ties a variable of a type to another.
bool tied(const Graph& graph, std::uint64_t type) {
  bool found = false;
  for (std::uint32_t row = 0; row < graph.priors().extent(); ++row) {
    if (!graph.priors().slots().is_live(row)) continue;
    const auto refs = graph.priors().variables(row);
    for (const VariableRef& ref : refs)
      found = found || (refs.size() > 1 && graph.pools()[ref.pool]->ops().key == type);
  }
  return found;
}

// M10
TEST(WindowTypes, AreDroppedWithTheirFactorsAndCounted) {
  const TypePolicy types[] = {policy_for<Offset>(Departure::drop)};
  const Totals kept = drive({}, kNothing);
  const Totals dropped = drive(types, [](const LinearWindow& w) {
    EXPECT_EQ(w.window.graph().count<Offset>(), w.window.graph().count<Level>());
  });
  EXPECT_EQ(kept.variables + kept.factors + kept.ties, 0);
  EXPECT_EQ(kept.slides, 30);
  EXPECT_EQ(dropped.slides, 30);
  EXPECT_EQ(dropped.states, 60);
  EXPECT_EQ(dropped.variables, 30);
  // Its own, the tie and the joint step to the next state, and at the first the prior.
  EXPECT_EQ(dropped.factors, 30 * 3 + 1);
}

// M10: the priors of two types are kept apart, and say so.
TEST(WindowTypes, AreLeftUntiedAndTheFillInThatIsDroppedIsCounted) {
  const std::uint64_t landmark = kVariableOps<Point2d>.key;
  bool ever = false;
  const Totals all = drive({}, [&](const LinearWindow& w) { ever = ever || tied(w.window.graph(), landmark); });
  EXPECT_TRUE(ever);
  EXPECT_EQ(all.ties, 0);
  for (const ::oriel::Tie tie : {::oriel::Tie::own, ::oriel::Tie::none}) {
    const TypePolicy types[] = {policy_for<Point2d>(Departure::marginalize, tie)};
    const Totals apart = drive(types, [&](const LinearWindow& w) { EXPECT_FALSE(tied(w.window.graph(), landmark)); });
    EXPECT_GT(apart.ties, 30);
  }
}

// M10, W13: nothing of a state stays in a window, be it fixed.
TEST(WindowTypes, ThatAreFixedLeaveAsKnown) {
  const TypePolicy fixed[] = {policy_for<Position>(Departure::fix), policy_for<Level>(Departure::fix)};
  const TypePolicy known[] = {policy_for<Position>(Departure::condition), policy_for<Level>(Departure::condition)};
  std::vector<double> values[2];
  Totals totals[2];
  for (const int i : {0, 1})
    totals[i] = drive(i == 0 ? std::span<const TypePolicy>(fixed) : known, [&](const LinearWindow& w) {
      w.window.graph().for_each<Position>([&](auto id, const Position& x) {
        EXPECT_FALSE(w.window.graph().fixed(id));
        values[i].push_back(x.v[0]);
      });
    });
  EXPECT_EQ(values[0], values[1]);
  EXPECT_EQ(totals[0].graph_variables, totals[1].graph_variables);
  EXPECT_EQ(totals[0].graph_factors, totals[1].graph_factors);
  const Totals plain = drive({}, kNothing);
  EXPECT_LE(totals[0].graph_variables, plain.graph_variables);
}

}  // namespace
}  // namespace oriel
