// The parts of a window, in turn: builders, batch builders, policies, listeners, observers.
#include <gtest/gtest.h>

#include "linear_window.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/window/pose_recorder.h"

namespace oriel {
namespace {

using namespace linear_world;
using Status = WindowUpdate::Status;
using Calls = std::vector<std::string>;

struct ToldBuilder final : FactorBuilder {
  Calls* calls;
  ProviderId positions;
  std::vector<Time> times;
  explicit ToldBuilder(Calls* c) : calls(c) {}
  std::string_view name() const override { return "told"; }
  void drain(const Graph&, const States&, PendingFactors& pending) override {
    calls->push_back("drain");
    for (const Time t : times) {
      pending.begin();
      pending.add(Prior{Position{}}, Sigma(1.0), At<Position>{positions, t});
      pending.end();
    }
    times.clear();
  }
  void entered(std::uint64_t, std::span<const VariableKey>, std::span<const FactorId>) override {
    calls->push_back("entered");
  }
  void before_slide(const Graph& graph, const States&, std::span<const VariableKey> leaving, GraphEdit&) override {
    calls->push_back("before_slide");
    for (const VariableKey id : leaving) EXPECT_NE(graph.find_value(id), nullptr);
  }
  void after_slide(const Graph&, const States&) override { calls->push_back("after_slide"); }
};

struct ToldHook final : InsertionHook {
  Calls* calls;
  explicit ToldHook(Calls* c) : calls(c) {}
  std::string_view name() const override { return "told"; }
  Verdict inserted(const Graph&, const States&, const InsertedGroup&, GraphEdit&) override {
    calls->push_back("hook");
    return {};
  }
};

struct ToldPolicy final : WindowPolicy {
  Calls* calls;
  std::vector<LeavingState> next;
  explicit ToldPolicy(Calls* c) : calls(c) {}
  void choose(const Graph&, const States&, std::vector<LeavingState>& leaving) override {
    calls->push_back("policy");
    leaving = next;
    next.clear();
  }
};

struct ToldListener final : WindowListener {
  Calls* calls;
  explicit ToldListener(Calls* c) : calls(c) {}
  void leaving(const Graph&, const States&, ProviderId, const State&) override { calls->push_back("leaving"); }
  void updated(const Graph&, const States&, const WindowUpdate&) override { calls->push_back("updated"); }
};

struct ToldObserver final : WindowObserver {
  Calls* calls;
  explicit ToldObserver(Calls* c) : calls(c) {}
  void edited() override { calls->push_back("edit"); }
  void solved(const SolveOptions&, const SolverState&, const Summary&, const NativeEngine&) override {
    calls->push_back("solve");
  }
};

struct Told {
  Calls calls;
  SlidingWindow window;
  ToldBuilder* builder = nullptr;
  ToldPolicy* policy = nullptr;
  ToldListener listener{&calls};
  ToldObserver observer{&calls};
  PositionProvider* position = nullptr;
  ProviderId positions;

  explicit Told(const WindowOptions& options = LinearWindow::exact()) : window(options) {
    auto p = std::make_unique<PositionProvider>();
    position = p.get();
    position->moved.begin(at_ms(0));
    position->moved.add(at_ms(10000), {{1.0, 2.0}});
    positions = window.add(std::move(p));
    auto b = std::make_unique<ToldBuilder>(&calls);
    builder = b.get();
    builder->positions = positions;
    window.add(std::move(b));
    window.add(std::make_unique<ToldHook>(&calls));
    auto rule = std::make_unique<ToldPolicy>(&calls);
    policy = rule.get();
    window.set(std::move(rule));
    window.listen(&listener);
    window.core().observe(&observer);
  }
  Calls update() {
    calls.clear();
    window.update();
    return calls;
  }
  std::vector<std::int64_t> times() const {
    std::vector<std::int64_t> all;
    for (const State& s : window.states().timeline(positions)) all.push_back(s.time.ns / 1000000);
    return all;
  }
  using Times = std::vector<std::int64_t>;
};

// W14
TEST(SlidingWindowParts, AreAskedInTheOrderOfAnUpdate) {
  Told told;
  told.builder->times = {at_ms(0), at_ms(100)};
  EXPECT_EQ(told.update(),
            (Calls{"drain", "edit", "hook", "entered", "edit", "hook", "entered", "solve", "policy", "updated"}));
  told.builder->times = {at_ms(200)};
  told.policy->next = {{told.positions, at_ms(0), LeavingState::How::marginalize}};
  EXPECT_EQ(told.update(), (Calls{"drain", "edit", "hook", "entered", "solve", "policy", "leaving", "before_slide",
                                  "edit", "after_slide", "updated"}));
  EXPECT_EQ(told.update(), (Calls{"drain", "updated"}));  // nothing new
}

// W14
TEST(SlidingWindowParts, SlideBeforeTheSolveWhereThatIsAskedFor) {
  WindowOptions options = LinearWindow::exact();
  options.slide_before_solve = true;
  Told told(options);
  told.builder->times = {at_ms(0), at_ms(100)};
  told.update();
  told.builder->times = {at_ms(200)};
  told.policy->next = {{told.positions, at_ms(0), LeavingState::How::marginalize}};
  EXPECT_EQ(told.update(), (Calls{"drain", "edit", "hook", "entered", "policy", "leaving", "before_slide", "edit",
                                  "after_slide", "solve", "updated"}));
}

// W11: what a policy of keyframes may ask for.
TEST(SlidingWindowParts, LetStatesLeaveFromTheMiddleInEitherWay) {
  Told told;
  for (int k = 0; k < 6; ++k) told.builder->times.push_back(at_ms(100 * k));
  told.update();
  const std::size_t factors = told.window.graph().factor_count();
  told.builder->times = {at_ms(600)};
  told.policy->next = {{told.positions, at_ms(200), LeavingState::How::remove}};
  told.update();
  EXPECT_EQ(told.window.last_update().states_removed, 1);
  EXPECT_EQ(told.times(), (Told::Times{0, 100, 300, 400, 500, 600}));
  // With 200 went its measurement and two motions, for which one came; with 600 came two factors.
  EXPECT_EQ(told.window.graph().factor_count(), factors - 2 + 2);
  EXPECT_EQ(told.window.graph().priors().slots().size(), 0u);
  EXPECT_EQ(told.window.states().reach(told.positions, at_ms(200)), Reach::possible);

  told.builder->times = {at_ms(700)};
  told.policy->next = {{told.positions, at_ms(400), LeavingState::How::marginalize},
                       {told.positions, at_ms(0), LeavingState::How::remove}};
  told.update();
  EXPECT_EQ(told.window.last_update().status, Status::updated);
  EXPECT_EQ(told.times(), (Told::Times{100, 300, 500, 600, 700}));
  EXPECT_EQ(told.window.graph().priors().slots().size(), 1u);
  EXPECT_EQ(told.window.states().reach(told.positions, at_ms(400)), Reach::too_old);
  EXPECT_EQ(told.window.states().reach(told.positions, at_ms(50)), Reach::too_old);
  told.builder->times = {at_ms(400)};
  told.update();
  EXPECT_EQ(told.window.last_update().refusals[0][Refusal::too_old], 1);
}

// W15
TEST(SlidingWindowParts, StayWhereASlideFailsAndGoOn) {
  WindowOptions options = LinearWindow::exact();
  options.marginalize.fail_if_undetermined = true;
  Told told(options);
  told.builder->times = {at_ms(0), at_ms(100), at_ms(200)};
  told.update();
  // Nothing determines the oldest state any more.
  std::vector<FactorId> all;
  for (const auto& table : told.window.graph().tables())
    for (std::uint32_t row = 0; row < table->extent(); ++row)
      if (table->slots().is_live(row)) all.push_back({table->ops().key, table->slots().key(row)});
  for (const FactorId id : all) told.window.core().edit().remove(id), (void)told.window.core().commit();
  told.builder->times = {at_ms(300)};
  told.policy->next = {{told.positions, at_ms(0), LeavingState::How::marginalize}};
  told.update();
  const WindowUpdate& update = told.window.last_update();
  EXPECT_EQ(update.status, Status::slide_failed);
  EXPECT_NE(update.error.message.find("nothing determines"), std::string::npos) << update.error.message;
  EXPECT_EQ(update.states_marginalized, 0);
  EXPECT_EQ(told.times(), (Told::Times{0, 100, 200, 300}));
  told.builder->times = {at_ms(400)};
  told.update();
  EXPECT_EQ(told.window.last_update().status, Status::updated);
}

// W10, as far as the window goes: the mean of all sightings of a track, as one factor a state.
class Tracks final : public BatchFactorBuilder {
 public:
  ProviderId positions;
  struct Seen {
    Time time;
    double x = 0.0;
  };
  std::vector<Seen> seen;
  int rebuilds = 0, refusals = 0;
  bool bad = false;

  std::string_view name() const override { return "tracks"; }
  void wanted(std::vector<std::pair<ProviderId, Time>>& times) const override {
    for (const Seen& s : seen) times.push_back({positions, s.time});
  }
  Result<bool> rebuild(const Graph& graph, const States& states, GraphEdit& edit) override {
    ++rebuilds;
    if (seen.size() == built_with_ && !bad) return false;
    for (const FactorId id : factors_)
      if (graph.contains(id)) edit.remove(id);
    next_.clear();
    double mean = 0.0;
    for (const Seen& s : seen) mean += s.x / static_cast<double>(seen.size());
    for (const Seen& s : seen) {
      const VariableKey id = states.find(positions, s.time, kVariableOps<Position>.key);
      if (id.key.generation == 0) continue;
      next_.push_back(
          edit.add(Prior{Position{{{s.x - mean, bad ? NAN : 0.0}}}}, Sigma(0.1), VariableId<Position>{id.key}));
    }
    before_ = std::move(factors_);
    factors_ = next_;
    built_before_ = std::exchange(built_with_, seen.size());
    return true;
  }
  void refused() override {
    ++refusals;
    factors_ = before_;
    built_with_ = built_before_;
  }
  void before_slide(const Graph&, const States& states, std::span<const VariableKey> leaving,
                    GraphEdit& edit) override {
    for (const VariableKey id : leaving)
      std::erase_if(seen, [&](const Seen& s) { return states.find(positions, s.time, id.type) == id; });
    for (const FactorId id : factors_) edit.remove(id);  // none of its factors is absorbed: no sighting counts twice
    factors_.clear();
    built_with_ = 0;
  }
  void after_slide(const Graph& graph, const States&) override {
    for (const FactorId id : factors_) EXPECT_TRUE(graph.contains(id));
  }
  void reset() override { seen.clear(), factors_.clear(), built_with_ = 0; }
  const std::vector<FactorId>& factors() const { return factors_; }

 private:
  std::vector<FactorId> factors_, next_, before_;
  std::size_t built_with_ = 0, built_before_ = 0;
};

// W10
TEST(SlidingWindowParts, RebuildTheFactorsOfABatchBuilderInEveryUpdate) {
  Told told;
  auto owned = std::make_unique<Tracks>();
  Tracks& tracks = *owned;
  tracks.positions = told.positions;
  told.window.add(std::move(owned));
  tracks.seen = {{at_ms(0), 1.0}, {at_ms(100), 3.0}};
  told.update();
  EXPECT_EQ(told.window.last_update().status, Status::updated);
  EXPECT_EQ(told.window.last_update().states_made, 2);
  EXPECT_EQ(told.times(), (Told::Times{0, 100}));
  const std::uint64_t before = fingerprint(told.window.graph());
  told.update();
  EXPECT_EQ(told.window.last_update().status, Status::nothing_new);
  EXPECT_EQ(tracks.rebuilds, 2);
  EXPECT_EQ(fingerprint(told.window.graph()), before);

  tracks.seen.push_back({at_ms(200), 8.0});
  tracks.seen.push_back({at_ms(99999), 0.0});  // a state that cannot be had yet
  told.update();
  EXPECT_EQ(told.times(), (Told::Times{0, 100, 200}));
  EXPECT_EQ(tracks.factors().size(), 3u);

  tracks.bad = true;
  const std::uint64_t good = fingerprint(told.window.graph());
  told.update();
  EXPECT_EQ(tracks.refusals, 1);
  EXPECT_EQ(told.window.last_update().refusals[1][Refusal::refused], 1);
  EXPECT_EQ(fingerprint(told.window.graph()), good);
  for (const FactorId id : tracks.factors()) EXPECT_TRUE(told.window.graph().contains(id));

  tracks.bad = false;
  told.builder->times = {at_ms(300)};
  told.policy->next = {{told.positions, at_ms(0), LeavingState::How::marginalize}};
  told.update();
  EXPECT_EQ(told.window.last_update().status, Status::updated) << told.window.last_update().error.message;
  EXPECT_EQ(tracks.seen.size(), 3u);
  EXPECT_EQ(tracks.factors().size(), 0u);
  told.update();
  EXPECT_EQ(tracks.factors().size(), 2u);
}

// A pose that stands, with an odometry that says so.
class StandingPose final : public StateProvider {
 public:
  std::string_view name() const override { return "pose"; }
  std::span<const VariableOps* const> variables() const override { return kOps; }
  Result<void> begin(GraphEdit& edit, State& state) override {
    const auto x = edit.add(Pose3d{});
    edit.add(Prior{Pose3d{}}, Sigma(0.1), x);
    state.count = 1, state.variables[0] = x;
    return {};
  }
  bool covers(Time, Time) const override { return true; }
  Result<void> predict(GraphEdit& edit, const State& from, State& state) override {
    state.count = 1;
    state.variables[0] = edit.add(edit.value(VariableId<Pose3d>{from.variables[0].key}));
    return {};
  }
  Result<FactorId> link(GraphEdit& edit, const State& from, const State& to) override {
    return edit.add(Between{Pose3d{}}, Sigma(0.1), VariableId<Pose3d>{from.variables[0].key},
                    VariableId<Pose3d>{to.variables[0].key});
  }

 private:
  static constexpr std::array<const VariableOps*, 1> kOps = {&kVariableOps<Pose3d>};
};

// W14
TEST(SlidingWindowParts, RecordEachPoseAtOnceAndInTheEnd) {
  SlidingWindow window;
  const ProviderId poses = window.add(std::make_unique<StandingPose>());
  auto lag = std::make_unique<LagPolicy>();
  ASSERT_TRUE(lag->set({1, 3, {}}).ok());
  window.set(std::move(lag));
  PoseRecorder recorder(poses);
  window.listen(&recorder);
  const int sensor = window.pending().sensor("beacon");
  for (int k = 0; k < 8; ++k) {
    Pose3d measured;
    measured.t = {{1.0 * k, 0.0, 0.0}};
    window.pending().begin(sensor);
    window.pending().add(Prior{measured}, Sigma(0.1), At<Pose3d>{poses, at_ms(100 * k)});
    window.pending().end();
    ASSERT_EQ(window.update().status, Status::updated);
  }
  EXPECT_EQ(recorder.causal().poses().size(), 8u);
  const Trajectory all = recorder.final(window.graph(), window.states());
  ASSERT_EQ(all.poses().size(), 8u);
  for (int k = 0; k < 8; ++k) {
    EXPECT_EQ(all.poses()[k].time, at_ms(100 * k));
    if (k > 0 && k < 7) {  // what came later has moved it on
      EXPECT_GT(all.poses()[k].T_world_body.t[0], recorder.causal().poses()[k].T_world_body.t[0]);
    }
  }
}

}  // namespace
}  // namespace oriel
