// Each fault does what it says, where and when it was asked for, and nothing else.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "oriel/testing/simulated_world.h"

namespace oriel {
namespace {

using Sensor = SimulatedSensor;
using Kind = SimulatedFaultKind;

SimulatedWorldOptions quick(std::vector<SimulatedFault> faults) {
  SimulatedWorldOptions o;
  o.seconds = 4.0;
  o.cameras.tracks = 20;
  o.gnss.timing.rate_hz = o.odometry.timing.rate_hz = o.ranges.timing.rate_hz = 20.0;
  o.faults = std::move(faults);
  return o;
}

std::vector<SimulatedMeasurement> all_of(std::vector<SimulatedFault> faults) {
  auto world = SimulatedWorld::make(quick(std::move(faults)));
  EXPECT_TRUE(world.ok()) << world.error();
  std::vector<SimulatedMeasurement> all;
  for (SimulatedMeasurement m; world->next(m);) all.push_back(m);
  return all;
}

std::vector<SimulatedMeasurement> of(Sensor sensor, std::vector<SimulatedMeasurement> all) {
  std::erase_if(all, [&](const SimulatedMeasurement& m) { return m.sensor != sensor; });
  return all;
}

bool within(const SimulatedMeasurement& m, double from, double to) {
  const double t = (m.time - SimulatedWorldOptions{}.start).seconds();
  return t >= from && t < to;
}

bool same(const SimulatedMeasurement& a, const SimulatedMeasurement& b) {
  if (a.features.size() != b.features.size()) return false;
  for (std::size_t k = 0; k < a.features.size(); ++k)
    if (a.features[k].pixel0 != b.features[k].pixel0 || a.features[k].track != b.features[k].track) return false;
  return a.stamp == b.stamp && a.imu.gyro == b.imu.gyro && a.imu.accel == b.imu.accel && a.position == b.position &&
         a.v_body == b.v_body && a.T_since_body.t == b.T_since_body.t && a.range == b.range;
}

TEST(SimulatedFaults, OfOneSensorChangeNoNumberOfAnotherNorOfAnotherTime) {
  const auto sound = all_of({});
  for (const Sensor sensor : {Sensor::imu, Sensor::camera, Sensor::gnss, Sensor::odometry, Sensor::range}) {
    auto faulty = all_of({{Kind::outlier, sensor, {1.0, 2.0}, 0.5}, {Kind::not_a_number, sensor, {2.0, 2.5}, 0.3}});
    ASSERT_EQ(sound.size(), faulty.size());
    int changed = 0;
    for (std::size_t k = 0; k < sound.size(); ++k) {
      const bool equal = same(sound[k], faulty[k]);
      EXPECT_EQ(faulty[k].faulty, !equal);
      if (equal) continue;
      ++changed;
      EXPECT_EQ(faulty[k].sensor, sensor);
      EXPECT_TRUE(within(faulty[k], 1.0, 2.5));
    }
    EXPECT_GT(changed, 5);
  }
}

TEST(SimulatedFaults, DropsWhatIsToDropOut) {
  const auto sound = of(Sensor::imu, all_of({})), gap = of(Sensor::imu, all_of({{Kind::dropout, Sensor::imu, {1, 2}}}));
  EXPECT_EQ(sound.size() - gap.size(), 200u);
  for (const SimulatedMeasurement& m : gap) EXPECT_FALSE(within(m, 1.0, 2.0));
  const auto half = of(Sensor::imu, all_of({{Kind::dropout, Sensor::imu, {0, 4}, 0.5}}));
  EXPECT_NEAR(static_cast<double>(half.size()), 400.0, 70.0);  // five sigmas
}

TEST(SimulatedFaults, MakesTheAskedShareOfFeaturesOutliers) {
  const auto sound = of(Sensor::camera, all_of({})),
             wild = of(Sensor::camera, all_of({{Kind::outlier, Sensor::camera, {0, 5}, 0.3}}));
  int far = 0, all = 0;
  for (std::size_t k = 0; k < sound.size(); ++k)
    for (std::size_t i = 0; i < sound[k].features.size(); ++i) {
      ++all;
      far += (sound[k].features[i].pixel0 - wild[k].features[i].pixel0).norm() > 1e-9 ? 1 : 0;
    }
  EXPECT_NEAR(static_cast<double>(far) / all, 0.3, 0.06);  // five sigmas
}

TEST(SimulatedFaults, PutsASingleNaNIntoEachMeasurementItStrikes) {
  for (const SimulatedMeasurement& m : of(Sensor::imu, all_of({{Kind::not_a_number, Sensor::imu, {1, 2}}}))) {
    int bad = 0;
    for (int i = 0; i < 3; ++i) bad += (std::isnan(m.imu.gyro[i]) ? 1 : 0) + (std::isnan(m.imu.accel[i]) ? 1 : 0);
    EXPECT_EQ(bad, within(m, 1.0, 2.0) ? 1 : 0);
  }
}

TEST(SimulatedFaults, RepeatsStampsAndSetsThemBack) {
  const auto repeated = of(Sensor::imu, all_of({{Kind::repeated_stamp, Sensor::imu, {1.0, 1.004}}}));
  const auto backward = of(Sensor::imu, all_of({{Kind::backward_stamp, Sensor::imu, {1.0, 1.004}}}));
  ASSERT_EQ(repeated.size(), 801u);
  EXPECT_EQ(repeated[200].stamp, repeated[199].stamp);
  EXPECT_EQ(repeated[200].imu.time, repeated[200].stamp);
  EXPECT_EQ((backward[200].stamp - backward[199].stamp).ns, -15'000'000);
  for (std::size_t k = 201; k < 801; ++k) {
    EXPECT_EQ(repeated[k].stamp, repeated[k].time);
    EXPECT_EQ(backward[k].stamp, backward[k].time);
  }
}

TEST(SimulatedFaults, BlindsTheCameraWhichThenBeginsItsTracksAnew) {
  std::int64_t newest_before = 0, oldest_after = 1 << 30;
  for (const SimulatedMeasurement& m : of(Sensor::camera, all_of({{Kind::blind, Sensor::camera, {1, 2}}}))) {
    EXPECT_EQ(m.features.empty(), within(m, 1.0, 2.0));
    for (const FeatureObservation& f : m.features)
      if (within(m, 0.0, 1.0))
        newest_before = std::max(newest_before, f.track);
      else
        oldest_after = std::min(oldest_after, f.track);
  }
  EXPECT_GT(oldest_after, newest_before);
}

TEST(SimulatedFaults, SaturatesTheImuAtTheAskedShareOfItsRange) {
  const SimulatedImu imu;
  int clipped = 0;
  for (const SimulatedMeasurement& m : of(Sensor::imu, all_of({{Kind::saturation, Sensor::imu, {1, 2}, 1.0, 0.02}}))) {
    for (int i = 0; i < 3; ++i) {
      const bool at_end = std::fabs(m.imu.accel[i]) == 0.02 * imu.accel_range;
      clipped += at_end ? 1 : 0;
      EXPECT_FALSE(at_end && !within(m, 1.0, 2.0));
      if (within(m, 1.0, 2.0)) {
        EXPECT_LE(std::fabs(m.imu.accel[i]), 0.02 * imu.accel_range);
      }
    }
  }
  EXPECT_GT(clipped, 100);
}

}  // namespace
}  // namespace oriel
