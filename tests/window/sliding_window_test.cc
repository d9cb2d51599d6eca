// What a window does with what it is given: it enters, waits, is refused, leaves; and says so.
#include "oriel/window/sliding_window.h"

#include <gtest/gtest.h>

#include "oriel/graph/fingerprint.h"
#include "oriel/testing/allocation_counter.h"
#include "steady_window.h"

namespace oriel {
namespace {

using namespace linear_world;
using SlidingWindowTest = SteadyLinearWindow;
using Status = WindowUpdate::Status;

// Values and priors alone: what a failure may not change.
std::vector<double> values_of(const Graph& graph) {
  std::vector<double> all;
  graph.for_each<Position>([&](auto, const Position& x) { all.insert(all.end(), {x.v[0], x.v[1]}); });
  graph.for_each<Point2d>([&](auto, const Point2d& l) { all.insert(all.end(), {l.p[0], l.p[1]}); });
  for (std::uint32_t row = 0; row < graph.priors().extent(); ++row)
    if (graph.priors().slots().is_live(row))
      all.insert(all.end(), graph.priors().block(row).begin(), graph.priors().block(row).end());
  return all;
}

// W3
TEST(SlidingWindow, BeginsAProviderWithPriorsOnItsFirstState) {
  LinearWindow w;
  w.move_to(100);
  ASSERT_TRUE(w.window.begin(w.levels, at_ms(0)).ok());
  EXPECT_EQ(w.window.graph().variable_count(), 2u);
  EXPECT_EQ(w.window.graph().factor_count(), 2u);
  EXPECT_EQ(w.window.update().status, Status::updated);
  EXPECT_EQ(w.window.update().status, Status::nothing_new);
}

// W14
TEST_F(SlidingWindowTest, DoesNothingWithoutANewFactor) {
  const std::uint64_t version = w.window.graph().version();
  EXPECT_EQ(w.window.update().status, Status::nothing_new);
  EXPECT_EQ(w.window.graph().version(), version);
  w.give({w.position_at(99999)});  // one that waits is not in it
  EXPECT_EQ(w.window.update().status, Status::nothing_new);
  EXPECT_EQ(w.window.last_update().waiting, 1);
}

// W5, W6
TEST_F(SlidingWindowTest, TakesWhatWaitedOnceItsStateCanBeMade) {
  w.give({w.position_at(850), w.step(700, 850)});
  EXPECT_EQ(w.window.update().waiting, 1);
  const std::size_t taken = w.builder->taken.size();
  w.move_to(850);
  const WindowUpdate& update = w.window.update();
  EXPECT_EQ(update.status, Status::updated);
  EXPECT_EQ(update.entered, 1);
  EXPECT_EQ(update.waiting, 0);
  EXPECT_EQ(w.builder->taken.size(), taken + 1);
  EXPECT_EQ(w.window.update().status, Status::nothing_new);  // used once
  EXPECT_LT(w.error(), 1e-9);
}

// W4: the group that asked for it does not enter, and nothing of it is there.
TEST_F(SlidingWindowTest, IsAsItWasWhereASplitFailsHalfWay) {
  const std::uint64_t before = fingerprint(w.window.graph());
  const std::size_t states = w.window.states().timeline(w.positions).size();
  w.position->faults.link_fails_in = 1;
  w.give({w.position_at(650)});
  const WindowUpdate& update = w.window.update();
  EXPECT_EQ(update.refusals[0][Refusal::no_motion], 1);
  EXPECT_EQ(update.error.message, "no motion today");
  EXPECT_EQ(update.status, Status::nothing_new);
  EXPECT_EQ(fingerprint(w.window.graph()), before);
  EXPECT_EQ(w.window.states().timeline(w.positions).size(), states);
  w.give({w.position_at(650)});
  EXPECT_EQ(w.window.update().entered, 1);
  EXPECT_LT(w.error(), 1e-9);
}

// W7
TEST_F(SlidingWindowTest, RefusesAndCountsBySensorWhatIsOlderThanItself) {
  const std::uint64_t before = fingerprint(w.window.graph());
  const int radar = w.window.pending().sensor("radar");
  w.window.pending().begin(radar);
  w.window.pending().add(Prior{Position{}}, Sigma(1.0), At<Position>{w.positions, at_ms(150)});
  w.window.pending().end();
  w.give({w.position_at(0)});
  const WindowUpdate& update = w.window.update();
  EXPECT_EQ(update.refused, 2);
  EXPECT_EQ(update.refusals[radar][Refusal::too_old], 1);
  EXPECT_EQ(update.refusals[0][Refusal::too_old], 1);
  EXPECT_EQ(w.window.refusals()[radar].total(), 1);
  EXPECT_EQ(w.builder->refusals, 1);
  EXPECT_EQ(fingerprint(w.window.graph()), before);
}

struct TakesLate final : LateGroups {
  int folded = 0, told = 0, slid = 0;
  Time oldest{0};
  bool fold(WindowCore&, States&, const PendingFactors& pending, const PendingFactors::Group& group) override {
    oldest = group.oldest;
    return pending.factors(group).size() == 1 && ++folded > 0;
  }
  void before_slide(const Graph& graph, const States&, std::span<const LeavingState> leaving,
                    std::span<const VariableKey> variables) override {
    told += static_cast<int>(leaving.size());
    for (const VariableKey id : variables) EXPECT_NE(graph.find_value(id), nullptr);
  }
  void after_slide(const Graph&, const States&, bool ok) override { slid += ok ? 1 : 0; }
};

// W7: whoever takes late groups gets what is older, and only that.
TEST_F(SlidingWindowTest, HandsLateGroupsToWhoeverTakesThem) {
  auto late = std::make_unique<TakesLate>();
  TakesLate& takes = *late;
  w.window.set(std::move(late));
  w.give({w.position_at(50)});
  w.give({w.position_at(60), w.position_at(60)});  // two factors: it will not
  w.give({w.position_at(650)});                    // in the window
  const WindowUpdate& update = w.window.update();
  EXPECT_EQ(takes.folded, 1);
  EXPECT_EQ(update.late, 1);
  EXPECT_EQ(update.entered, 1);
  EXPECT_EQ(update.refusals[0][Refusal::too_old], 1);
  EXPECT_EQ(takes.told, 1);  // the state at 650 is one too many
  EXPECT_EQ(takes.slid, 1);
}

// W6
TEST_F(SlidingWindowTest, RefusesWhatNamesALandmarkThatIsGone) {
  GraphEdit& edit = w.window.core().edit();
  const auto own = edit.add(Point2d{});
  ASSERT_TRUE(w.window.core().commit().ok());
  auto sight = [&] {
    w.window.pending().begin(0);
    w.window.pending().add(Sight{{{1.0, 1.0}}}, Sigma(0.1), At<Position>{w.positions, at_ms(700)}, own);
    w.window.pending().end();
  };
  sight();
  EXPECT_EQ(w.window.update().entered, 1);
  w.window.core().edit().remove(own);
  ASSERT_TRUE(w.window.core().commit().ok());
  sight();
  EXPECT_EQ(w.window.update().refusals[0][Refusal::unknown_id], 1);
}

// W15
TEST_F(SlidingWindowTest, KeepsItsValuesWhenASolveFailsAndGoesOn) {
  const std::vector<double> before = values_of(w.window.graph());
  const std::size_t states = w.window.states().timeline(w.positions).size();
  // Each is a number, and their sum is none.
  MeasuredGroup monsters(5, w.position_at(100 * (k - 1)));  // of a state that is there
  for (Measured& m : monsters) m.z = {1e153, 0.0, 0.0}, m.sigma = 0.1;
  const std::size_t taken = w.builder->taken.size();
  w.give(monsters);
  const WindowUpdate& failed = w.window.update();
  ASSERT_EQ(failed.status, Status::solve_failed);
  EXPECT_EQ(failed.solve.reason, Reason::not_finite);
  EXPECT_NE(failed.solve.reason_text(), "");
  EXPECT_EQ(failed.states_marginalized, 0);
  EXPECT_EQ(failed.expelled.size(), monsters.size());
  EXPECT_EQ(values_of(w.window.graph()), before);
  EXPECT_EQ(w.window.states().timeline(w.positions).size(), states);
  w.builder->taken.resize(taken);  // it is in no estimate
  ASSERT_EQ(frame().status, Status::updated);
  EXPECT_LT(w.error(), 1e-9);
  const VariableId<Position> newest{w.window.states().timeline(w.positions).latest()->variables[0].key};
  EXPECT_TRUE(w.window.core().engine().covariance(newest).ok());
}

// W12, W15: as long as solves fail, nothing leaves; then the window begins anew, with a reason.
TEST_F(SlidingWindowTest, EliminatesNoStateThatNoSolveHasSeen) {
  GraphEdit& edit = w.window.core().edit();
  // A prior of its own that no solve can take, and that is not a factor of any group.
  LinearPrior prior;
  const VariableId<Position> newest{w.window.states().timeline(w.positions).latest()->variables[0].key};
  prior.variables = {newest};
  prior.estimates = {0.0, 0.0};
  prior.rows = 1, prior.cols = 2;
  prior.d = {1e200};
  prior.R = {1e200, 0.0};
  edit.add(prior);
  ASSERT_TRUE(w.window.core().commit().ok());
  const std::size_t states = w.window.states().timeline(w.positions).size();
  ASSERT_EQ(frame().status, Status::solve_failed);
  EXPECT_EQ(w.window.states().timeline(w.positions).size(), states + 1);
  EXPECT_FALSE(w.window.states().timeline(w.positions).latest()->solved);
  ASSERT_EQ(frame().status, Status::solve_failed);
  EXPECT_EQ(w.window.states().timeline(w.positions).size(), states + 2);
  const WindowUpdate& third = frame();
  ASSERT_EQ(third.status, Status::solve_failed);
  EXPECT_STRNE(third.reset, "");
  EXPECT_TRUE(w.window.states().timeline(w.positions).empty());
  EXPECT_EQ(w.window.graph().factor_count(), 0u);
  ASSERT_EQ(frame().status, Status::updated);
  EXPECT_EQ(w.window.states().timeline(w.positions).size(), 1u);
}

// W12
struct Everything final : WindowPolicy {
  LeavingState::How how = LeavingState::How::marginalize;
  bool asked = false;
  void choose(const Graph&, const States& states, std::vector<LeavingState>& leaving) override {
    asked = true;
    for (int p = 0; p < states.providers(); ++p)
      for (const State& s : states.timeline({p})) leaving.push_back({{p}, s.time, how});
    leaving.push_back({{0}, at_ms(123456), how});  // and one that is not there
  }
};
TEST(SlidingWindow, KeepsUnsolvedStatesWhateverThePolicyAsks) {
  WindowOptions options = LinearWindow::exact();
  options.slide_before_solve = true;
  LinearWindow w(5, 3, options);
  auto policy = std::make_unique<Everything>();
  const Everything& everything = *policy;
  w.window.set(std::move(policy));
  w.move_to(1000);
  w.give({w.position_at(0)});
  w.give({w.position_at(100)});
  ASSERT_EQ(w.window.update().status, Status::updated);
  EXPECT_TRUE(everything.asked);
  EXPECT_EQ(w.window.last_update().states_marginalized, 0);
  w.give({w.position_at(200)});
  ASSERT_EQ(w.window.update().states_marginalized, 2);
  EXPECT_EQ(w.window.states().timeline(w.positions).size(), 1u);
  EXPECT_LT(w.error(), 1e-9);
}

// W12
TEST(SlidingWindow, KeepsNoPriorWhereItIsNotWanted) {
  WindowOptions options = LinearWindow::exact();
  options.keep_prior = false;
  LinearWindow w(3, 5, options);
  for (int k = 0; k < 12; ++k) {
    w.move_to(100 * k + 100);
    w.give({w.position_at(100 * k), w.sight(100 * k, k / 2)});
    ASSERT_EQ(w.window.update().status, Status::updated);
  }
  const Graph& graph = w.window.graph();
  EXPECT_EQ(graph.priors().slots().size(), 0u);
  EXPECT_EQ(graph.count<Position>(), 3u);
  EXPECT_EQ(graph.count<Point2d>(), 2u);
  EXPECT_EQ(graph.factor_count(), 3u + 3u + 2u);
}

// W13, W14
TEST(SlidingWindow, HasTheSameCountsAndAsksForNoMemoryOverTenThousandSlides) {
  LinearWindow w(5, 8);
  const int gnss = w.window.pending().sensor("gnss");
  std::int64_t before = 0;
  std::size_t variables = 0, factors = 0, landmarks = 0;
  VariableId<Point2d> landmark;
  for (int k = 0; k < 10050; ++k) {
    if (k == 50) before = allocation_count();
    w.position->moved.add(at_ms(100 * k + 100), {{0.1, 0.2}});  // the test's own record of all would grow
    w.level->moved.add(at_ms(100 * k + 100), {});
    PendingFactors& pending = w.window.pending();
    pending.begin(gnss);
    pending.add(Prior{Position{{{0.1 * k, 0.2 * k}}}}, Sigma(0.5), At<Position>{w.positions, at_ms(100 * k)});
    pending.add(Prior{Level{}}, Sigma(0.5), At<Level>{w.levels, at_ms(100 * k)});
    const VariableId<Point2d> l = pending.add(Point2d{});  // seen at this time alone
    pending.add(Sight{{{1.0, 1.0}}}, Sigma(0.1), At<Position>{w.positions, at_ms(100 * k)}, l);
    pending.end();
    const WindowUpdate& update = w.window.update();
    ASSERT_EQ(update.status, Status::updated);
    if (k < 50) {
      variables = w.window.graph().variable_count(), factors = w.window.graph().factor_count();
      landmarks = w.window.graph().count<Point2d>();
      continue;
    }
    ASSERT_EQ(update.states_marginalized, 2);
    ASSERT_EQ(w.window.graph().variable_count(), variables);
    ASSERT_EQ(w.window.graph().factor_count(), factors);
    ASSERT_EQ(w.window.graph().count<Point2d>(), landmarks);
    ASSERT_EQ(w.window.states().timeline(w.positions).size(), 5u);
    ASSERT_LE(w.position->moved.size(), 8u);
    ASSERT_EQ(w.window.pending().size(), 0u);
  }
  EXPECT_EQ(variables, 5u * 3 + 5u);
  if (counts_allocations()) {
    EXPECT_EQ(allocation_count() - before, 0);
  }
}

}  // namespace
}  // namespace oriel
