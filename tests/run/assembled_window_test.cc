// A window put together by names: its start, its measurements, its reports.
#include "oriel/run/assembled_window.h"

#include <gtest/gtest.h>

#include "oriel/window/constant_velocity_provider.h"
#include "oriel/window/imu_provider.h"
#include "oriel/window/pose_recorder.h"
#include "window/simulated_flight.h"

namespace oriel {
namespace {

SensorSuite sensors_of(const SimulatedFlight& flight) {
  return {.has_imu = true, .imu = flight.noise, .cameras = 2, .rig = flight.rig};
}

PartChoice choice(const NameTable<WindowPart>& table, const char* name) { return {name, table.get(name)->defaults}; }

double seconds_of(Time t) { return (t - SimulatedFlight::time_of(0.0)).seconds(); }

struct Flown {
  Trajectory causal;
  double begun_at = -1.0;  // [s]
  int resets = 0;
  std::string waited_for;  // with the first frame
};

Flown fly(AssembledWindow& window, const SimulatedFlight& flight) {
  PoseRecorder poses(window.body());
  window.window().listen(&poses);
  Flown out;
  std::size_t next = 0;
  for (const SimulatedFlight::Frame& f : flight.frames) {
    while (next < flight.imu.size() && flight.imu[next].time <= f.time)
      EXPECT_TRUE(window.add(flight.imu[next++]).ok());
    const WindowUpdate* update = window.update({f.time, f.features});
    if (update == nullptr && out.waited_for.empty()) out.waited_for = window.waiting_for();
    if (update == nullptr) continue;
    if (out.begun_at < 0.0) out.begun_at = seconds_of(f.time);
    out.resets += update->reset[0] != '\0' ? 1 : 0;
  }
  out.causal = poses.causal();
  return out;
}

// How far the motion of the flight's last second is off [m]: wherever the window puts its world.
double error_of_last_second(const SimulatedFlight& flight, const Trajectory& t) {
  const auto& poses = t.poses();
  const StampedPose& last = poses.back();
  for (const StampedPose& p : poses)
    if ((last.time - p.time).seconds() < 1.01) {
      const Pose3d truth = flight.pose(seconds_of(p.time)).inverse() * flight.pose(seconds_of(last.time));
      return ((p.T_world_body.inverse() * last.T_world_body).t - truth.t).norm();
    }
  return HUGE_VAL;
}

TEST(AssembledWindow, StartsAtRestAndInMotionByItself) {
  const WindowParts parts = shipped_parts();
  for (const double rest : {2.0, 0.0}) {
    const SimulatedFlight flight({.rest_s = rest, .glide = rest > 0.0 ? 0.0 : 0.5, .duration_s = 6.0});
    const auto window = AssembledWindow::make(default_plan(parts), parts, sensors_of(flight));
    ASSERT_TRUE(window) << window.error();
    EXPECT_FALSE((*window)->has_begun());
    const Flown flown = fly(**window, flight);
    EXPECT_EQ(flown.waited_for, "one frame");
    EXPECT_GT(flown.begun_at, 0.9);
    EXPECT_LT(flown.begun_at, 2.1);
    // The frames that the start has looked at are states as well.
    EXPECT_LT(seconds_of(flown.causal.poses().front().time), 0.7);
    EXPECT_EQ(flown.causal.poses().back().time, flight.frames.back().time);
    EXPECT_LT(error_of_last_second(flight, flown.causal), 0.05) << "rest " << rest;
    EXPECT_EQ(flown.resets, 0);
  }
}

// W16: no IMU for five seconds, in which the body flies on; what the cameras see is all there is, and a part of it is
// wrong.
TEST(AssembledWindow, CrossesALongGapOfTheImuWithTheHookThatRefines) {
  SimulatedFlight flight({.rest_s = 1.5, .duration_s = 12.0, .gross_errors = 0.2});
  std::erase_if(flight.imu, [](const ImuSample& s) { return seconds_of(s.time) > 4.0 && seconds_of(s.time) < 9.0; });
  const WindowParts parts = shipped_parts();
  WindowPlan with = default_plan(parts), without = with;
  std::erase_if(without.hooks, [](const PartChoice& p) { return p.name == "refine"; });
  double error[2];
  for (int k = 0; k < 2; ++k) {
    const auto window = AssembledWindow::make(k == 0 ? with : without, parts, sensors_of(flight));
    ASSERT_TRUE(window) << window.error();
    error[k] = error_of_last_second(flight, fly(**window, flight).causal);
  }
  EXPECT_LT(error[0], 0.05);
  EXPECT_GT(error[1], 0.5) << error[0];
}

// Odometry and positions, which no recording has: whoever has them hands them over.
TEST(AssembledWindow, TakesMotionsAndPositions) {
  const WindowParts parts = shipped_parts();
  WindowPlan plan;
  plan.providers = {choice(parts.providers, "odometry")};
  plan.builders = {choice(parts.builders, "gnss")};
  plan.policy = choice(parts.policies, "lag");
  SensorSuite sensors{.has_odometry = true, .has_positions = true};
  const auto window = AssembledWindow::make(plan, parts, sensors);
  ASSERT_TRUE(window) << window.error();
  EXPECT_TRUE((*window)->has_begun());  // nothing waits for frames
  for (int k = 0; k < 30; ++k) {
    const Time t{k * 1'000'000'000LL};
    // Wheels that say 1.1 m where it is 1 m.
    ASSERT_TRUE((*window)->add(MeasuredMotion{t, Pose3d{Rot3d{}, {{1.1, 0.0, 0.0}}}, Mat6d::identity() * 0.01}).ok());
    (*window)->add(MeasuredPosition{t, {{1.0 * k, 0.0, 0.0}}, 0.1});
    EXPECT_EQ((*window)->update().status, WindowUpdate::Status::updated);
  }
  const States& states = (*window)->window().states();
  const State& newest = *states.timeline((*window)->body()).latest();
  EXPECT_NEAR((*window)->window().graph().value(VariableId<Pose3d>{newest.variables[0].key}).t[0], 29.0, 0.15);
  EXPECT_EQ(states.timeline((*window)->body()).size(), 10u);
}

// A provider, a hook and a policy of one's own, in a copy of the tables.
struct CountingHook final : InsertionHook {
  explicit CountingHook(int* groups) : groups_(groups) {}
  std::string_view name() const override { return "counting"; }
  Verdict inserted(const Graph&, const States&, const InsertedGroup&, GraphEdit&) override {
    return ++*groups_, Verdict{};
  }
  int* groups_;
};
struct NewestAlone final : WindowPolicy {
  void choose(const Graph&, const States& states, std::vector<LeavingState>& leaving) override {
    const auto& line = states.timeline({0});
    for (std::size_t k = 0; k + 1 < line.size(); ++k) leaving.push_back({{0}, line[k].time});
  }
};
struct ParkedOptions {
  double drift = 1e-3;
};

// R9
TEST(AssembledWindow, TakesAProviderAHookAndAPolicyOfOnesOwn) {
  WindowParts parts = shipped_parts();
  static int groups = 0;
  groups = 0;
  const auto parked = [](const ParkedOptions& o, WindowAssembly& w) -> Result<void> {
    w.add(std::make_unique<ConstantVelocityProvider>(ConstantVelocityOptions{.acceleration = o.drift}));
    return {};
  };
  const auto counting = [](const ParkedOptions&, WindowAssembly& w) -> Result<void> {
    w.add(std::make_unique<CountingHook>(&groups));
    w.count("groups", [] { return std::int64_t{groups}; });
    return {};
  };
  const auto newest = [](const ParkedOptions&, WindowAssembly& w) -> Result<void> {
    w.set(std::make_unique<NewestAlone>());
    return {};
  };
  ASSERT_TRUE(parts.providers.add("parked", window_part<ParkedOptions>("Stands still.", {}, parked)));
  ASSERT_TRUE(parts.hooks.add("counting", window_part<ParkedOptions>("Counts.", {}, counting)));
  ASSERT_TRUE(parts.policies.add("newest", window_part<ParkedOptions>("One state.", {}, newest)));
  WindowPlan plan;
  plan.providers = {choice(parts.providers, "parked")};
  plan.builders = {choice(parts.builders, "gnss")};
  plan.hooks = {choice(parts.hooks, "counting")};
  plan.policy = choice(parts.policies, "newest");
  const auto window = AssembledWindow::make(plan, parts, {.has_positions = true});
  ASSERT_TRUE(window) << window.error();
  for (int k = 0; k < 5; ++k) {
    (*window)->add(MeasuredPosition{{k * 1'000'000'000LL}, Vec3d::zero(), 0.1});
    EXPECT_EQ((*window)->update().status, WindowUpdate::Status::updated);
  }
  EXPECT_EQ((*window)->window().states().timeline((*window)->body()).size(), 1u);
  EXPECT_EQ((*window)->counts(), (std::vector<std::pair<std::string, std::int64_t>>{{"groups", 5}}));
}

// R9: in words, with the part's own line.
TEST(AssembledWindow, RefusesPartsThatNeedWhatIsNotThere) {
  const WindowParts parts = shipped_parts();
  const auto fault = [&](const WindowPlan& plan, const SensorSuite& sensors) {
    const auto window = AssembledWindow::make(plan, parts, sensors);
    return window ? std::string() : window.error().text();
  };
  const SimulatedFlight flight({.duration_s = 0.1});
  WindowPlan plan = default_plan(parts);
  plan.providers[0].file = "w.yaml", plan.providers[0].line = 4;
  EXPECT_EQ(fault(plan, sensors_of(flight)), "");
  EXPECT_EQ(fault(plan, {.cameras = 2}), "w.yaml:4: the provider imu: expected a recording with IMU samples");
  EXPECT_EQ(fault(plan, {.has_imu = true}),
            "w.yaml:4: the provider imu: expected a recording with a camera, for its start");
  plan.hooks = {{"gate", {}}};
  EXPECT_EQ(fault(plan, sensors_of(flight)),
            "unknown hook 'gate'; expected one of refine, mahalanobis_gate, gap_reset, cheirality, standstill");
  plan.hooks = {};
  plan.builders = {};
  EXPECT_EQ(fault(plan, sensors_of(flight)), "a window needs a builder");
}

}  // namespace
}  // namespace oriel
