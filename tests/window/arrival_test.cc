// What comes into a window by the clock: stamps, states for them, and what is left of old ones.
#include <gtest/gtest.h>

#include "oriel/graph/fingerprint.h"
#include "steady_window.h"

namespace oriel {
namespace {

using namespace linear_world;
using WindowArrival = SteadyLinearWindow;
using Status = WindowUpdate::Status;

// W1
TEST(WindowStamps, OfTwoSensorsShareAStateAndOneNanosecondMakesAnotherBeforeTheEpochToo) {
  LinearWindow w(10);
  w.position->moved.begin(at_ms(-900)), w.all_moved.begin(at_ms(-900));
  w.move_to(-100), w.move_to(200);
  w.builder->sensors = {"gnss", "radar"};
  Measured gnss = w.position_at(-500), radar = w.position_at(-500), later = w.position_at(-500);
  radar.sensor = 1;
  later.a = later.a + Duration{1};
  w.give({gnss}), w.give({radar});
  w.give({w.step(-500, 100)});  // across the epoch
  EXPECT_EQ(w.window.update().states_made, 2);
  EXPECT_EQ(w.window.last_update().entered, 3);
  w.give({later});
  EXPECT_EQ(w.window.update().states_made, 1);
  const Timeline<State>& line = w.window.states().timeline(w.positions);
  ASSERT_EQ(line.size(), 3u);
  EXPECT_EQ(line[0].time, at_ms(-500));
  EXPECT_EQ(line[1].time, at_ms(-500) + Duration{1});
  EXPECT_TRUE(w.window.graph().contains(line[1].motion));
  EXPECT_LT(w.error(), 1e-9);
}

// W4: with a number that is none its factor is refused, and the state with it, at the end and between two.
TEST_F(WindowArrival, MakesNoStateForAFactorThatDoesNotEnter) {
  const std::uint64_t before = fingerprint(w.window.graph());
  const std::size_t states = w.window.states().timeline(w.positions).size();
  w.move_to(1000);
  for (const std::int64_t ms : {650, 850}) {
    Measured bad = w.position_at(ms);
    bad.bad = true;
    w.give({bad});
    w.give({bad, w.tie(ms, ms)});
  }
  const WindowUpdate& update = w.window.update();
  EXPECT_EQ(update.status, Status::nothing_new);
  EXPECT_EQ(update.refusals[0][Refusal::not_finite], 4);
  EXPECT_EQ(update.states_made, 0);
  EXPECT_EQ(fingerprint(w.window.graph()), before);
  EXPECT_EQ(w.window.states().timeline(w.positions).size(), states);
  EXPECT_TRUE(w.window.states().timeline(w.levels).empty());
  EXPECT_FALSE(w.window.states().staged());
  w.give({w.position_at(650)}), w.give({w.position_at(850)});
  EXPECT_EQ(w.window.update().entered, 2);
  EXPECT_LT(w.error(), 1e-9);
}

// Its first state's prior is no number.
struct Broken final : StateProvider {
  static constexpr std::array<const VariableOps*, 1> kOps = {&kVariableOps<Position>};
  std::string_view name() const override { return "broken"; }
  std::span<const VariableOps* const> variables() const override { return kOps; }
  Result<void> begin(GraphEdit& edit, State& state) override {
    const auto x = edit.add(Position{});
    edit.add(Prior{Position{{{NAN, 0.0}}}}, Sigma(1.0), x);
    state.count = 1, state.variables[0] = x;
    return {};
  }
  bool covers(Time, Time) const override { return true; }
  Result<void> predict(GraphEdit&, const State&, State&) override { return Error{}; }
  Result<FactorId> link(GraphEdit&, const State&, const State&) override { return Error{}; }
};

// W4
TEST_F(WindowArrival, HasNoFirstStateWhereItsOwnPriorIsRefused) {
  const ProviderId broken = w.window.add(std::make_unique<Broken>());
  const std::uint64_t before = fingerprint(w.window.graph());
  EXPECT_EQ(w.window.begin(broken, at_ms(700)).error().code, ErrorCode::not_finite);
  EXPECT_EQ(fingerprint(w.window.graph()), before);
  EXPECT_TRUE(w.window.states().timeline(broken).empty());
  EXPECT_FALSE(w.window.states().staged());
  EXPECT_EQ(w.window.states().reach(broken, at_ms(700)), Reach::possible);
}

// Times at which a batch builder wants a state, and a prior on each that is there.
struct Wants final : BatchFactorBuilder {
  ProviderId positions;
  std::vector<Time> times, had;
  std::string_view name() const override { return "wants"; }
  void wanted(std::vector<std::pair<ProviderId, Time>>& all) const override {
    for (const Time t : times) all.push_back({positions, t});
  }
  Result<bool> rebuild(const Graph&, const States& states, GraphEdit& edit) override {
    const std::size_t before = had.size();
    for (const Time t : times)
      if (const State* s = states.timeline(positions).find(t))
        had.push_back(t), edit.add(Prior{Position{}}, Sigma(1.0), VariableId<Position>{s->variables[0].key});
    std::erase_if(times, [&](Time t) { return states.timeline(positions).find(t) != nullptr; });
    return had.size() > before;
  }
  void refused() override {}
  void before_slide(const Graph&, const States&, std::span<const VariableKey>, GraphEdit&) override {}
  void after_slide(const Graph&, const States&) override {}
  void reset() override {}
};

// W4, W5
TEST_F(WindowArrival, MakesTheStatesThatABatchBuilderWantsWhateverBecomesOfOneOfThem) {
  auto owned = std::make_unique<Wants>();
  Wants& wants = *owned;
  wants.positions = w.positions;
  w.window.add(std::move(owned));
  w.move_to(1000);
  w.position->faults.link_fails_in = 1;  // the second half of the first
  wants.times = {at_ms(650), at_ms(820), at_ms(900), at_ms(99999)};
  const WindowUpdate& update = w.window.update();
  EXPECT_EQ(update.status, Status::updated);
  EXPECT_EQ(update.states_made, 2);
  EXPECT_EQ(update.error.message, "no motion today");
  EXPECT_EQ(update.refusals[1][Refusal::no_motion], 1);
  EXPECT_EQ(wants.had, (std::vector<Time>{at_ms(820), at_ms(900)}));
  EXPECT_EQ(w.window.states().timeline(w.positions).find(at_ms(650)), nullptr);
  w.window.update();
  EXPECT_EQ(wants.had.back(), at_ms(650));
  EXPECT_EQ(wants.times, (std::vector<Time>{at_ms(99999)}));  // waits
  for (const State& s : w.window.states().timeline(w.positions))
    if (&s != w.window.states().timeline(w.positions).oldest()) {
      EXPECT_TRUE(w.window.graph().contains(s.motion)) << s.time.ns;
    }
}

// W13
TEST(WindowStamps, LeaveNoIdBehindThatStillMeansSomething) {
  LinearWindow w(3, 9);
  std::vector<VariableKey> variables;
  std::vector<FactorId> motions;
  for (int k = 0; k < 40; ++k) {
    w.move_to(100 * k + 100);
    w.give({w.position_at(100 * k), w.sight(100 * k, k / 4), w.level_at(100 * k)});
    ASSERT_EQ(w.window.update().status, Status::updated);
    const Graph& graph = w.window.graph();
    std::size_t live = 0;
    for (const ProviderId p : {w.positions, w.levels})
      for (const State& s : w.window.states().timeline(p)) {
        for (const VariableKey id : s.all()) {
          EXPECT_NE(graph.find_value(id), nullptr);
          if (std::find(variables.begin(), variables.end(), id) == variables.end()) variables.push_back(id);
          ++live;
        }
        if (s.has_motion()) motions.push_back(s.motion);
      }
    std::size_t found = 0, here = 0;
    for (const VariableKey id : variables) found += graph.find_value(id) != nullptr ? 1 : 0;
    EXPECT_EQ(found, live);
    for (const FactorId id : motions) here += graph.contains(id) ? 1 : 0;
    EXPECT_LE(here, motions.size());
    // What the graph holds is what the timelines, the landmarks in view and the motions between say.
    EXPECT_EQ(graph.count<Position>() + graph.count<Level>() + graph.count<Offset>(), live);
    const auto contents = w.window.core().engine().contents();
    ASSERT_TRUE(contents.ok());
    if (k > 5) {
      EXPECT_LE(w.position->moved.size(), 6u);
      EXPECT_LE(w.level->moved.size(), 6u);
      EXPECT_EQ(w.window.states().reach(w.positions, at_ms(100 * (k - 3))), Reach::too_old);
      EXPECT_EQ(w.window.states().find(w.positions, at_ms(100 * (k - 3)), kVariableOps<Position>.key).key.generation,
                0u);
    }
  }
  EXPECT_EQ(variables.size(), 40u * 3u);
}

// W15: the engine has none until a solve succeeds (L11); what the graph says is as it was.
TEST_F(WindowArrival, HasTheCovarianceThatItHadWhenASolveHasFailed) {
  const auto covariances = [&] {
    NativeEngine engine(w.window.core().followed());
    std::vector<double> all;
    for (const State& s : w.window.states().timeline(w.positions)) {
      const auto c = engine.covariance(VariableId<Position>{s.variables[0].key});
      EXPECT_TRUE(c.ok()) << c.error();
      all.insert(all.end(), c->m, c->m + 4);
    }
    return all;
  };
  const VariableId<Position> newest{w.window.states().timeline(w.positions).latest()->variables[0].key};
  const std::vector<double> before = covariances();
  const auto own = w.window.core().engine().covariance(newest);
  ASSERT_TRUE(own.ok());
  const std::uint64_t graph = fingerprint(w.window.graph());
  MeasuredGroup monsters(5, w.position_at(100 * (k - 1)));  // each is a number, and their sum is none
  for (Measured& m : monsters) m.z = {1e153, 0.0, 0.0}, m.sigma = 0.1;
  w.give(monsters);
  ASSERT_EQ(w.window.update().status, Status::solve_failed);
  EXPECT_EQ(fingerprint(w.window.graph()), graph);
  EXPECT_EQ(covariances(), before);
  EXPECT_EQ(w.window.core().engine().covariance(newest).error().code, ErrorCode::conflict);
  w.give({w.step(100 * (k - 2), 100 * (k - 1))});
  ASSERT_EQ(w.window.update().status, Status::updated);
  const auto after = w.window.core().engine().covariance(newest);
  ASSERT_TRUE(after.ok());
  EXPECT_LT((*after)(0, 0), (*own)(0, 0));
}

}  // namespace
}  // namespace oriel
