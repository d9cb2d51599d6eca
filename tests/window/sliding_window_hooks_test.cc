// Hooks look at groups once they are in: they edit, reject, and have the window begin anew.
#include <gtest/gtest.h>

#include <functional>

#include "oriel/graph/fingerprint.h"
#include "steady_window.h"

namespace oriel {
namespace {

using namespace linear_world;
using WindowHooks = SteadyLinearWindow;
using Status = WindowUpdate::Status;

struct Custom final : InsertionHook {
  std::function<Verdict(const Graph&, const States&, const InsertedGroup&, GraphEdit&)> look;
  int resets = 0;
  std::string_view name() const override { return "custom"; }
  Verdict inserted(const Graph& g, const States& s, const InsertedGroup& in, GraphEdit& edit) override {
    return look ? look(g, s, in, edit) : Verdict{};
  }
  void reset() override { ++resets; }
};
Custom& add_hook(SlidingWindow& window) {
  auto hook = std::make_unique<Custom>();
  Custom& custom = *hook;
  window.add(std::move(hook));
  return custom;
}

// W9
TEST_F(WindowHooks, LetsAHookDropAFactorAndAddOthers) {
  Custom &first = add_hook(w.window), &second = add_hook(w.window);
  std::size_t seen_by_second = 0, variables_by_second = 0;
  FactorId dropped, added;
  first.look = [&](const Graph& graph, const States&, const InsertedGroup& in, GraphEdit& edit) {
    EXPECT_EQ(in.factors.size(), 2u);
    EXPECT_EQ(in.newest, at_ms(800));
    EXPECT_EQ(in.new_variables.size(), 1u);
    for (const FactorId id : in.factors) EXPECT_TRUE(graph.contains(id));
    dropped = in.factors[0];
    edit.remove(dropped);
    const auto l = edit.add(Point2d{});
    edit.add(Prior{Point2d{{{3.0, 4.0}}}}, Sigma(0.1), l);
    added = edit.add(Sight{{{1.0, 1.0}}}, Sigma(0.2), VariableId<Position>{in.new_variables[0].key}, l);
    return InsertionHook::Verdict{};
  };
  second.look = [&](const Graph&, const States&, const InsertedGroup& in, GraphEdit&) {
    seen_by_second = in.factors.size();
    variables_by_second = in.variables.size();
    return InsertionHook::Verdict{};
  };
  w.move_to(1000);
  w.give({w.position_at(800), w.position_at(800)});
  EXPECT_EQ(w.window.update().status, Status::updated);
  EXPECT_FALSE(w.window.graph().contains(dropped));
  EXPECT_TRUE(w.window.graph().contains(added));
  EXPECT_EQ(seen_by_second, 3u);
  EXPECT_EQ(variables_by_second, 1u);
}

// W9
TEST_F(WindowHooks, HasNothingLeftOfAGroupThatAHookRejects) {
  const std::uint64_t before = fingerprint(w.window.graph());
  const std::size_t states = w.window.states().timeline(w.positions).size();
  Custom &first = add_hook(w.window), &second = add_hook(w.window);
  first.look = [&](const Graph&, const States&, const InsertedGroup& in, GraphEdit& edit) {
    const auto l = edit.add(Point2d{});
    edit.add(Sight{{{1.0, 1.0}}}, Sigma(0.2), VariableId<Position>{in.new_variables[0].key}, l);
    return InsertionHook::Verdict{};
  };
  second.look = [](const Graph&, const States&, const InsertedGroup&, GraphEdit& edit) {
    edit.add(Point2d{});  // of one that rejects: never applied
    return InsertionHook::Verdict{true, false, "not today"};
  };
  w.move_to(1000);
  w.give({w.position_at(800), w.sight(800, 77), w.tie(800, 800)});  // states of two kinds, a landmark of its own
  const WindowUpdate& update = w.window.update();
  EXPECT_STREQ(update.rejection, "not today");
  EXPECT_EQ(update.refusals[0][Refusal::rejected], 1);
  EXPECT_EQ(update.entered, 0);
  EXPECT_EQ(fingerprint(w.window.graph()), before);
  EXPECT_EQ(w.window.states().timeline(w.positions).size(), states);
  EXPECT_TRUE(w.window.states().timeline(w.levels).empty());
  // Between two states the motion that was split is whole again; its id alone is another.
  second.look = [](const Graph&, const States&, const InsertedGroup&, GraphEdit&) {
    return InsertionHook::Verdict{true, false, "not today"};
  };
  first.look = nullptr;
  const std::size_t factors = w.window.graph().factor_count(), variables = w.window.graph().variable_count();
  w.give({w.position_at(640)});
  w.window.update();
  EXPECT_EQ(w.window.graph().factor_count(), factors);
  EXPECT_EQ(w.window.graph().variable_count(), variables);
  second.look = nullptr;
  w.give({w.position_at(800)});
  EXPECT_EQ(w.window.update().status, Status::updated);
  EXPECT_LT(w.error(), 1e-9);
}

// W9
TEST_F(WindowHooks, RejectsTheGroupOfAHookWhoseEditIsRefused) {
  const std::uint64_t before = fingerprint(w.window.graph());
  add_hook(w.window).look = [](const Graph&, const States&, const InsertedGroup& in, GraphEdit& edit) {
    edit.add(Prior{Position{{{NAN, 0.0}}}}, Sigma(0.1), VariableId<Position>{in.new_variables[0].key});
    return InsertionHook::Verdict{};
  };
  w.move_to(1000);
  w.give({w.position_at(800)});
  EXPECT_EQ(w.window.update().refusals[0][Refusal::rejected], 1);
  EXPECT_EQ(fingerprint(w.window.graph()), before);
}

TEST_F(WindowHooks, BeginsAnewWhereAHookFindsAGap) {
  Custom& hook = add_hook(w.window);
  hook.look = [](const Graph&, const States&, const InsertedGroup& in, GraphEdit&) {
    return InsertionHook::Verdict{false, in.newest == at_ms(2000), "a gap of more than a second"};
  };
  w.window.core().edit().add(VectorNd<5>{});  // static, of the user
  ASSERT_TRUE(w.window.core().commit().ok());
  w.give({w.position_at(99999)});  // waits: for ever, or until it is too old
  w.move_to(3000);
  w.give({w.position_at(2000)});
  w.give({w.sight(2100, 40)});
  const WindowUpdate& update = w.window.update();
  EXPECT_STREQ(update.reset, "a gap of more than a second");
  EXPECT_EQ(update.status, Status::updated);
  EXPECT_EQ(update.entered, 2);  // the one that came after the gap is the first of the new window
  EXPECT_EQ(hook.resets, 1);
  EXPECT_EQ(w.window.states().timeline(w.positions).size(), 2u);
  EXPECT_EQ(w.window.states().timeline(w.positions).oldest()->time, at_ms(2000));
  EXPECT_EQ(w.window.graph().priors().slots().size(), 0u);
  EXPECT_EQ(w.window.graph().count<Point2d>(), 1u);
  EXPECT_EQ(w.window.graph().count<VectorNd<5>>(), 1u);
  w.give({w.position_at(700)});  // of the old window
  EXPECT_EQ(w.window.update().refusals[0][Refusal::too_old], 1);
}

}  // namespace
}  // namespace oriel
