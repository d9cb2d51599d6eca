// GNSS, wheel odometry and ranges of a simulated world in one graph, against its truth.
#include <gtest/gtest.h>

#include <cmath>

#include <vector>

#include "oriel/evaluate/nees.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/graph/wire.h"
#include "oriel/residual/between.h"
#include "oriel/residual/body_velocity.h"
#include "oriel/residual/gnss.h"
#include "oriel/residual/range.h"
#include "oriel/run/registry.h"
#include "oriel/solve/native_engine.h"
#include "oriel/testing/simulated_world.h"

namespace oriel {
namespace {

using Sensor = SimulatedSensor;

// A state for each odometry measurement; the other sensors measure at the same times.
struct Fusion {
  Graph graph;
  std::vector<VariableId<Pose3d>> poses;
  std::vector<VariableId<Velocity3d>> velocities;
  Time last;
};

SimulatedWorldOptions sensors(std::uint64_t seed) {
  SimulatedWorldOptions o;
  o.seed = seed;
  o.seconds = 5.0;
  o.imu.timing.rate_hz = o.cameras.timing.rate_hz = 0.0;
  o.gnss.timing.rate_hz = 2.0;
  o.odometry.timing.rate_hz = o.ranges.timing.rate_hz = 10.0;
  return o;
}

void build(SimulatedWorld& world, Fusion& f) {
  const SimulatedWorldOptions& o = world.options();
  GraphEdit edit = f.graph.edit();
  const auto gnss_antenna = edit.add(LeverArmd{o.gnss.p_body_antenna});
  const auto range_antenna = edit.add(LeverArmd{o.ranges.p_body_antenna});
  std::vector<VariableId<Beacond>> beacons;
  for (const Vec3d& p : world.beacons()) beacons.push_back(edit.add(Beacond{p}));
  std::vector<SimulatedMeasurement> others;
  for (SimulatedMeasurement m; world.next(m);) {
    if (m.sensor != Sensor::odometry) {
      others.push_back(m);
      continue;
    }
    const Pose3d guess =
        f.poses.empty() ? world.truth(m.time).T_world_body : edit.value(f.poses.back()) * m.T_since_body;
    f.poses.push_back(edit.add(guess));
    f.velocities.push_back(edit.add(Velocity3d{guess.R * m.v_body}));
    edit.add(BodyVelocityd{m.v_body}, Sigma(o.odometry.velocity_sigma), f.poses.back(), f.velocities.back());
    if (f.poses.size() < 2) continue;
    const double r = o.odometry.rotation_sigma, t = o.odometry.translation_sigma;
    edit.add(Between{m.T_since_body}, Sigmas(Vec6d{{r, r, r, t, t, t}}), f.poses[f.poses.size() - 2], f.poses.back());
    f.last = m.time;
  }
  for (const SimulatedMeasurement& m : others) {
    const auto k = static_cast<std::size_t>(std::lround((m.time - o.start).seconds() * 10.0));
    if (m.sensor == Sensor::gnss)
      edit.add(GnssPositiond{m.position}, Sigma(o.gnss.sigma), f.poses[k], gnss_antenna);
    else
      edit.add(RangeToBeacond{m.range}, Sigma(o.ranges.sigma), f.poses[k], beacons[static_cast<std::size_t>(m.beacon)],
               range_antenna);
  }
  ASSERT_TRUE(f.graph.apply(edit).ok());
}

TEST(FusedSensors, FindTheTruthAsWellAsTheirCovariancesSay) {
  constexpr std::size_t kRuns = 60;
  NeesTable table("pose and velocity", 9, 1);
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    auto world = SimulatedWorld::make(sensors(seed));
    ASSERT_TRUE(world.ok()) << world.error();
    Fusion f;
    build(*world, f);
    NativeEngine engine(f.graph);
    const Summary summary = engine.solve();
    ASSERT_TRUE(summary.converged()) << summary;
    ASSERT_EQ(summary.invalid_factors, 0);
    const SimulatedTruth truth = world->truth(f.last);
    const VariableKey ids[] = {f.poses.back(), f.velocities.back()};
    const auto covariance = engine.joint_covariance(ids);
    ASSERT_TRUE(covariance.ok()) << covariance.error();
    Vec<double, 9> e;
    e.set_segment(0, truth.T_world_body.minus(f.graph.value(f.poses.back())));
    e.set_segment(6, truth.velocity.v - f.graph.value(f.velocities.back()).v);
    table.add(0, *normalized_error_squared({e.m, 9}, *covariance));
  }
  EXPECT_TRUE(table.consistent_at_end()) << table.mean() << " of 9";
}

// As a message to a worker or a journal.
TEST(FusedSensors, TravelAsBytesByTheNamesOfTheirTypes) {
  auto world = SimulatedWorld::make(sensors(1));
  Fusion f;
  const Subscription subscription = f.graph.subscribe();
  build(*world, f);
  GraphEdit net, received;
  f.graph.collect(subscription, net);
  Bytes bytes;
  append_edit(bytes, net);
  Graph follower;
  const auto message = read_message(bytes);
  ASSERT_TRUE(message.ok()) << message.error();
  const auto read = read_edit(*message, shipped_types(), follower, received);
  ASSERT_TRUE(read.ok()) << read.error();
  ASSERT_TRUE(follower.apply(received).ok());
  EXPECT_EQ(fingerprint(follower), fingerprint(f.graph));
}

}  // namespace
}  // namespace oriel
