// The general window with what it ships, end to end: IMU, stereo tracks, keyframes and hooks, over a simulated flight.
// docs/window.md shows lines of this file.
#include <gtest/gtest.h>

#include "oriel/testing/allocation_counter.h"
#include "oriel/window/cheirality_hook.h"
#include "oriel/window/gap_reset_hook.h"
#include "oriel/window/imu_provider.h"
#include "oriel/window/keyframe_policy.h"
#include "oriel/window/mahalanobis_gate.h"
#include "oriel/window/pose_recorder.h"
#include "oriel/window/sensor_builder.h"
#include "oriel/window/sliding_window.h"
#include "oriel/window/standstill_hook.h"
#include "oriel/window/structureless_builder.h"
#include "oriel/window/track_builder.h"
#include "simulated_flight.h"

namespace oriel {
namespace {

// A position that a receiver says, of the body's origin.
struct GnssPosition {
  static constexpr std::string_view kName = "example.gnss_position/1";
  using Variables = Types<Pose3d>;
  Vec3d p_world;  // [m]
  template <class S>
  Vec<S, 3> operator()(const Pose3<S>& T_world_body) const {
    return T_world_body.translation() - p_world;
  }
};
using GnssBuilder = SensorBuilder<GnssPosition, IsotropicNoise>;

double seconds_of(Time t) { return (t - SimulatedFlight::time_of(0.0)).seconds(); }

ImuNoise with_vibration(ImuNoise n) {
  n.gyro *= 8.0;
  n.accel *= 8.0;
  return n;
}

// Everything that a visual-inertial odometry is made of.
struct Odometry {
  SlidingWindow window;
  ImuProvider* imu = nullptr;
  TrackBuilder* tracks = nullptr;
  StructurelessBuilder* structureless = nullptr;
  StandstillHook* standstill = nullptr;
  GnssBuilder* gnss = nullptr;
  std::unique_ptr<PoseRecorder> poses;

  Odometry(const SimulatedFlight& flight, bool with_landmarks) : window(options()) {
    auto provider = std::make_unique<ImuProvider>(with_vibration(flight.noise));
    imu = provider.get();
    const ProviderId body = window.add(std::move(provider));

    GraphEdit& edit = window.core().edit();
    const VariableId<StereoRigd> rig = edit.add(flight.rig);
    EXPECT_TRUE(window.core().commit().ok());

    if (with_landmarks) {
      auto builder = std::make_unique<TrackBuilder>(body, flight.rig, rig);
      tracks = builder.get();
      window.add(std::move(builder));
    } else {
      StructurelessOptions o;
      o.loss = Cauchy(5.0);
      auto builder = std::make_unique<StructurelessBuilder>(body, flight.rig, rig, o);
      structureless = builder.get();
      window.add(std::move(builder));
    }

    auto receiver = std::make_unique<GnssBuilder>("gnss", body, Huber(2.0));
    gnss = receiver.get();
    const int gnss_sensor = window.add(std::move(receiver));
    auto gate = std::make_unique<MahalanobisGate>(window.core().followed());
    EXPECT_TRUE(gate->set(gnss_sensor, {.probability = 0.999, .with_covariance = true, .rejects_group = true}).ok());
    window.add(std::move(gate));

    window.add(std::make_unique<GapResetHook>(body, Duration::from_seconds(2.0)));
    window.add(std::make_unique<CheiralityHook>());
    auto still = std::make_unique<StandstillHook>(body, *imu, StandstillOptions{}, [this](Time a, Time b) {
      return tracks != nullptr ? tracks->motion(a, b) : -1.0;
    });
    standstill = still.get();
    window.add(std::move(still));

    const auto overlap = [this](const Graph& g, const States& s, Time a, Time b) {
      return tracks != nullptr ? tracks->overlap(g, s, a, b) : structureless->overlap(g, s, a, b);
    };
    window.set(std::make_unique<KeyframePolicy>(body, overlap));
    poses = std::make_unique<PoseRecorder>(body);
    window.listen(poses.get());
  }
  static WindowOptions options() {
    WindowOptions o;
    o.solve.max_iterations = 12;
    o.solve.function_tolerance = 1e-4;
    return o;
  }
  void start_at(const SimulatedFlight& flight, double t) {
    ImuStart start;
    start.T_world_body = flight.pose(t);
    start.pose_noise = level_pose_noise(start.T_world_body, 1e-3, 1e-3, 0.1);
    start.velocity.v = (flight.pose(t + 1e-3).t - flight.pose(t - 1e-3).t) / 2e-3;
    imu->start_at(start);
  }
  void add(const StereoFrame& frame) { tracks != nullptr ? tracks->add(frame) : structureless->add(frame); }
};

// Largest distance from the truth [m].
double worst_error(const SimulatedFlight& flight, const Trajectory& t) {
  double worst = 0.0;
  for (const StampedPose& p : t.poses()) {
    const Pose3d error = flight.pose(seconds_of(p.time)).inverse() * p.T_world_body;
    worst = std::max(worst, error.t.norm());
  }
  return worst;
}

void fly(Odometry& odometry, const SimulatedFlight& flight, std::size_t frames) {
  std::size_t next = 0;
  for (std::size_t k = 0; k < frames; ++k) {
    const SimulatedFlight::Frame& f = flight.frames[k];
    while (next < flight.imu.size() && flight.imu[next].time <= f.time) {
      const Result<void> taken = odometry.imu->add(flight.imu[next++]);
      ASSERT_TRUE(taken.ok()) << taken.error();
    }
    odometry.add({f.time, f.features});
    const WindowUpdate& update = odometry.window.update();
    ASSERT_EQ(update.status, WindowUpdate::Status::updated) << "frame " << k << ": " << update.error;
  }
}

// W14, W16
TEST(GeneralWindow, FollowsAFlightAsWellAsTheOdometryThatIsMadeForIt) {
  const SimulatedFlight flight({.rest_s = 1.0, .duration_s = 10.0});
  Odometry odometry(flight, true);
  odometry.start_at(flight, 0.0);
  fly(odometry, flight, flight.frames.size());
  EXPECT_EQ(odometry.poses->causal().poses().size(), flight.frames.size());
  EXPECT_LT(worst_error(flight, odometry.poses->causal()), 0.05);  // as asked of InertialOdometry
  EXPECT_GT(odometry.standstill->count(), 3);
  EXPECT_LT(odometry.standstill->count(), 12);  // it flies from then on
  EXPECT_LE(odometry.window.graph().count<Pose3d>(), 14u);
  const State& newest = *odometry.window.states().timeline({0}).latest();
  EXPECT_LT((odometry.window.graph().value(ImuProvider::bias(newest)).gyro - flight.bias.gyro).norm(), 2e-3);
}

// W10
TEST(GeneralWindow, FollowsAFlightByStructurelessTracks) {
  const SimulatedFlight flight({.rest_s = 1.0, .duration_s = 6.0, .gross_errors = 0.0});
  Odometry odometry(flight, false);
  odometry.start_at(flight, 0.0);
  fly(odometry, flight, flight.frames.size());
  EXPECT_LT(worst_error(flight, odometry.poses->causal()), 0.05);
}

// W9
TEST(GeneralWindow, TakesAnotherSensorAndGatesItsGrossErrors) {
  const SimulatedFlight flight({.rest_s = 1.0, .duration_s = 5.0});
  Odometry odometry(flight, true);
  odometry.start_at(flight, 0.0);
  int given = 0, wrong = 0;
  for (double t = 0.55; t < 4.5; t += 0.4) {  // between frames: the IMU's motion is split
    Vec3d p = flight.pose(t).t;
    if (++given % 3 == 0) p[1] += 10.0, ++wrong;
    odometry.gnss->add(SimulatedFlight::time_of(t), GnssPosition{p}, Sigma(0.2));
  }
  fly(odometry, flight, flight.frames.size());
  const Refusals refused = odometry.window.refusals()[odometry.window.pending().sensor("gnss")];
  EXPECT_EQ(refused[Refusal::rejected], wrong);
  EXPECT_EQ(refused.total(), wrong);
  EXPECT_LT(worst_error(flight, odometry.poses->causal()), 0.05);
}

// W17
TEST(GeneralWindow, BeginsAnewAfterALongGapAndGoesOnFromWhereItWas) {
  SimulatedFlight flight({.rest_s = 1.0, .duration_s = 9.0});
  const auto in_gap = [](Time t) { return seconds_of(t) > 3.0 && seconds_of(t) < 5.95; };
  std::erase_if(flight.frames, [&](const SimulatedFlight::Frame& f) { return in_gap(f.time); });
  std::erase_if(flight.imu, [&](const ImuSample& s) { return in_gap(s.time); });
  Odometry odometry(flight, true);
  odometry.start_at(flight, 0.0);
  std::size_t next = 0;
  int resets = 0, after = 0;
  for (const SimulatedFlight::Frame& f : flight.frames) {
    while (next < flight.imu.size() && flight.imu[next].time <= f.time)
      ASSERT_TRUE(odometry.imu->add(flight.imu[next++]).ok());
    odometry.add({f.time, f.features});
    const WindowUpdate& update = odometry.window.update();
    if (update.reset[0] != '\0') {
      EXPECT_STREQ(update.reset, "a gap longer than the window can bridge");
      EXPECT_NEAR(seconds_of(f.time), 6.0, 0.1);
      ++resets;
    }
    after += resets > 0 && update.status == WindowUpdate::Status::updated ? 1 : 0;
  }
  EXPECT_EQ(resets, 1);
  EXPECT_GT(after, 25);
  // The motion since is right, although nobody knows what was in between.
  const auto& poses = odometry.poses->causal().poses();
  const StampedPose &last = poses.back(), &before = poses[poses.size() - 11];
  const Pose3d truth = flight.pose(seconds_of(before.time)).inverse() * flight.pose(seconds_of(last.time));
  EXPECT_NEAR(seconds_of(last.time) - seconds_of(before.time), 1.0, 1e-6);
  EXPECT_LT(((before.T_world_body.inverse() * last.T_world_body).t - truth.t).norm(), 0.05);
}

// W14: nothing in an update asks for memory by itself; what is sized by the largest window so far still may.
TEST(GeneralWindow, AsksForMemoryOnlyWhereItsWindowGrows) {
  if (!counts_allocations()) GTEST_SKIP() << "a sanitizer has an operator new of its own";
  const SimulatedFlight flight({.rest_s = 0.0, .duration_s = 14.0, .points = 300});
  Odometry odometry(flight, true);
  odometry.start_at(flight, 0.0);
  odometry.poses->reserve(1000);
  std::size_t next = 0;
  int updates = 0, without = 0;
  for (std::size_t k = 0; k < flight.frames.size(); ++k) {
    while (next < flight.imu.size() && flight.imu[next].time <= flight.frames[k].time)
      ASSERT_TRUE(odometry.imu->add(flight.imu[next++]).ok());
    const std::int64_t before = allocation_count();
    odometry.add({flight.frames[k].time, flight.frames[k].features});
    odometry.window.update();
    if (k < 115) continue;
    ++updates;
    without += allocation_count() == before ? 1 : 0;
  }
  EXPECT_GT(updates, 20);
  EXPECT_GT(2 * without, updates);
}

}  // namespace
}  // namespace oriel
