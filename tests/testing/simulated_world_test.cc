// The simulated world against what it claims: the statistics of every sensor, every fault, and its order.
#include "oriel/testing/simulated_world.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <set>

#include "oriel/residual/between.h"
#include "oriel/residual/body_velocity.h"
#include "oriel/residual/gnss.h"
#include "oriel/residual/imu_residual.h"
#include "oriel/residual/range.h"
#include "oriel/residual/reprojection.h"
#include "oriel/sensor/preintegration.h"

namespace oriel {
namespace {

using Sensor = SimulatedSensor;
using Kind = SimulatedFaultKind;

// All sensors, fewer tracks than usual.
SimulatedWorldOptions all_sensors(double seconds) {
  SimulatedWorldOptions o;
  o.seconds = seconds;
  o.cameras.tracks = 40;
  o.gnss.timing.rate_hz = 10.0;
  o.odometry.timing.rate_hz = 20.0;
  o.ranges.timing.rate_hz = 25.0;
  return o;
}

std::vector<SimulatedMeasurement> all_of(SimulatedWorld& world) {
  std::vector<SimulatedMeasurement> all;
  for (SimulatedMeasurement m; world.next(m);) all.push_back(m);
  return all;
}
std::vector<SimulatedMeasurement> all_of(const SimulatedWorldOptions& options) {
  auto world = SimulatedWorld::make(options);
  EXPECT_TRUE(world.ok()) << world.error();
  return all_of(*world);
}

bool same(const SimulatedMeasurement& a, const SimulatedMeasurement& b) {
  const bool features = a.features.size() == b.features.size();
  for (std::size_t k = 0; features && k < a.features.size(); ++k)
    if (a.features[k].track != b.features[k].track || a.features[k].pixel0 != b.features[k].pixel0 ||
        a.features[k].pixel1 != b.features[k].pixel1 || a.features[k].has_right != b.features[k].has_right)
      return false;
  return features && a.sensor == b.sensor && a.stamp == b.stamp && a.arrival == b.arrival && a.time == b.time &&
         a.imu.gyro == b.imu.gyro && a.imu.accel == b.imu.accel && a.position == b.position && a.v_body == b.v_body &&
         a.T_since_body.t == b.T_since_body.t && a.beacon == b.beacon && a.range == b.range;
}

// Sum of squares of whitened numbers: `count` of them should have this mean, within five of its sigmas, √(2 / count).
struct Chi {
  double sum = 0.0;
  std::int64_t count = 0;
  template <int N>
  void add(const Vec<double, N>& whitened) {
    sum += whitened.squared_norm();
    count += N;
  }
  void expect_unit() const {
    ASSERT_GT(count, 100);
    EXPECT_NEAR(sum / static_cast<double>(count), 1.0, 5.0 * std::sqrt(2.0 / static_cast<double>(count)));
  }
};

TEST(SimulatedWorld, IsTheSameFromTheSameSeedAndAnotherFromAnother) {
  SimulatedWorldOptions o = all_sensors(3.0);
  const auto a = all_of(o), b = all_of(o);
  ASSERT_EQ(a.size(), b.size());
  ASSERT_EQ(a.size(), 601u + 61u + 31u + 61u + 76u);
  for (std::size_t k = 0; k < a.size(); ++k) EXPECT_TRUE(same(a[k], b[k])) << k;
  o.seed = 2;
  const auto c = all_of(o);
  ASSERT_EQ(a.size(), c.size());
  int equal = 0;
  for (std::size_t k = 0; k < a.size(); ++k) equal += same(a[k], c[k]) ? 1 : 0;
  EXPECT_EQ(equal, 0);
}

TEST(SimulatedWorld, HasAnImuThatFollowsItsOwnPathWithoutNoise) {
  SimulatedWorldOptions o;
  o.seconds = 10.0;
  o.cameras.timing.rate_hz = 0.0;
  o.imu.noise = {};
  auto world = SimulatedWorld::make(o);
  std::vector<ImuSample> samples;
  for (SimulatedMeasurement m; world->next(m);) samples.push_back(m.imu);
  for (const double at : {0.0, 3.3, 8.0}) {
    const Time t0 = o.start + Duration::from_seconds(at), t1 = t0 + Duration::from_seconds(2.0);
    const SimulatedTruth a = world->truth(t0), b = world->truth(t1);
    const auto motion = preintegrate(samples, t0, t1, a.bias, {1e-4, 1e-3, 1e-5, 1e-4});
    ASSERT_TRUE(motion.ok()) << motion.error();
    const PreintegratedImud& m = motion->motion;
    const Rot3d& R = a.T_world_body.R;
    const Vec3d p = a.T_world_body.t + a.velocity.v * m.dt + kStandardGravity * (0.5 * m.dt * m.dt) + R * m.dp;
    EXPECT_LT((p - b.T_world_body.t).norm(), 1e-4);
    EXPECT_LT((a.velocity.v + kStandardGravity * m.dt + R * m.dv - b.velocity.v).norm(), 1e-4);
    EXPECT_LT(b.T_world_body.R.minus(R * m.dR).norm(), 1e-5);
  }
}

TEST(SimulatedWorld, HasWhiteImuNoiseOfItsDensityAndBiasesThatWalkAsTheyShould) {
  SimulatedWorldOptions o;
  o.seconds = 120.0;
  o.cameras.timing.rate_hz = 0.0;
  auto world = SimulatedWorld::make(o);
  Chi gyro, accel, gyro_walk, accel_walk;
  const double dt = 0.005;
  ImuBiasd before{};
  for (SimulatedMeasurement m; world->next(m);) {
    const SimulatedTruth x = world->truth(m.time);
    const Vec3d force = x.T_world_body.R.inverse() * (x.path.a_world - kStandardGravity);
    gyro.add((m.imu.gyro - x.path.rate_body - x.bias.gyro) * (std::sqrt(dt) / o.imu.noise.gyro));
    accel.add((m.imu.accel - force - x.bias.accel) * (std::sqrt(dt) / o.imu.noise.accel));
    if (m.time > o.start) {
      gyro_walk.add((x.bias.gyro - before.gyro) / (std::sqrt(dt) * o.imu.noise.gyro_walk));
      accel_walk.add((x.bias.accel - before.accel) / (std::sqrt(dt) * o.imu.noise.accel_walk));
    }
    before = x.bias;
  }
  for (const Chi& chi : {gyro, accel, gyro_walk, accel_walk}) chi.expect_unit();
  const ImuBiasd late = world->truth(o.start + Duration::from_seconds(100.0)).bias;
  const ImuBiasd early = world->truth(o.start + Duration::from_seconds(1.0)).bias;
  EXPECT_NE(late.accel, early.accel);
  EXPECT_EQ(world->truth(o.start + Duration::from_seconds(100.0)).bias.accel, late.accel);  // asked backwards and again
}

// W16: samples as a sensor gives them (noise at each sample, shared by the steps before and after it), preintegrated by
// `preintegrate`: the residual at the truth, whitened by the covariance that is claimed, has unit variance.
TEST(SimulatedWorld, HasAnImuWhosePreintegratedResidualsAtTheTruthAreTheirNoise) {
  Chi all, rotation, velocity, position, biases;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    SimulatedWorldOptions o;
    o.seed = seed;
    o.seconds = 40.0;
    o.cameras.timing.rate_hz = 0.0;
    auto world = SimulatedWorld::make(o);
    std::vector<ImuSample> samples;
    for (SimulatedMeasurement m; world->next(m);) samples.push_back(m.imu);
    for (std::int64_t k = 0; k < 80; ++k) {
      const Time t0 = o.start + Duration{k * 500'000'000}, t1 = t0 + Duration{500'000'000};
      const SimulatedTruth a = world->truth(t0), b = world->truth(t1);
      const auto motion = preintegrate(samples, t0, t1, a.bias, o.imu.noise);
      ASSERT_TRUE(motion.ok()) << motion.error();
      Vec<double, 15> r;
      (void)ImuResiduald{motion->motion}.evaluate(a.T_world_body, a.velocity, a.bias, b.T_world_body, b.velocity,
                                                  b.bias, r, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr);
      const auto& P = motion->covariance;
      const auto sigmas = [&](int first) {
        return Vec3d{{r[first] / std::sqrt(P(first, first)), r[first + 1] / std::sqrt(P(first + 1, first + 1)),
                      r[first + 2] / std::sqrt(P(first + 2, first + 2))}};
      };
      rotation.add(sigmas(0)), velocity.add(sigmas(3)), position.add(sigmas(6));
      biases.add(sigmas(9)), biases.add(sigmas(12));
      Mat<double, 15, 1> white = r;
      FullNoise<15>::whiten(imu_noise(*motion).w, white);
      all.add(white);
    }
  }
  for (const Chi& chi : {all, rotation, velocity, position, biases}) chi.expect_unit();
}

TEST(SimulatedWorld, HasPixelsGnssOdometryAndRangesWhoseResidualsAtTheTruthAreTheirNoise) {
  const SimulatedWorldOptions o = all_sensors(30.0);
  auto world = SimulatedWorld::make(o);
  Chi pixels, gnss, velocity, motion, range;
  const LeverArmd gnss_antenna{o.gnss.p_body_antenna}, range_antenna{o.ranges.p_body_antenna};
  std::int64_t stereo = 0, features = 0;
  for (SimulatedMeasurement m; world->next(m);) {
    const SimulatedTruth x = world->truth(m.time);
    Vec3d r3;
    Vec1d r1;
    Vec4d r4;
    Vec6d r6;
    if (m.sensor == Sensor::gnss) {
      (void)GnssPositiond{m.position}.evaluate(x.T_world_body, gnss_antenna, r3, nullptr);
      gnss.add(r3 / o.gnss.sigma);
    } else if (m.sensor == Sensor::odometry) {
      (void)BodyVelocityd{m.v_body}.evaluate(x.T_world_body, x.velocity, r3, nullptr, nullptr);
      velocity.add(r3 / o.odometry.velocity_sigma);
      (void)Between{m.T_since_body}.evaluate(world->truth(m.motion_since).T_world_body, x.T_world_body, r6, nullptr,
                                             nullptr);
      motion.add(r6.segment<3>(0) / o.odometry.rotation_sigma);
      motion.add(r6.segment<3>(3) / o.odometry.translation_sigma);
    } else if (m.sensor == Sensor::range) {
      const Beacond beacon{world->beacons()[static_cast<std::size_t>(m.beacon)]};
      (void)RangeToBeacond{m.range}.evaluate(x.T_world_body, beacon, range_antenna, r1, nullptr);
      range.add(r1 / o.ranges.sigma);
    }
    for (const FeatureObservation& f : m.features) {
      ++features;
      if (!f.has_right) continue;
      ++stereo;
      const Point3d point{*world->landmark(f.track)};
      ASSERT_TRUE((StereoPointReprojectiond{f.pixel0, f.pixel1}.evaluate(x.T_world_body, point, world->rig(), r4,
                                                                         nullptr, nullptr)));
      pixels.add(r4 / o.cameras.pixel_sigma);
    }
  }
  for (const Chi& chi : {pixels, gnss, velocity, motion, range}) chi.expect_unit();
  EXPECT_EQ(features, 601 * 40);
  EXPECT_GT(stereo, features / 2);
}

TEST(SimulatedWorld, ForgetsWhatIsFarBehindAndMeasuresTheSame) {  // W15
  SimulatedWorldOptions o = all_sensors(60.0), forgetful = o;
  forgetful.memory_s = 5.0;
  auto all = SimulatedWorld::make(o), some = SimulatedWorld::make(forgetful);
  std::int64_t frames = 0;
  for (SimulatedMeasurement a, b; all->next(a);) {
    ASSERT_TRUE(some->next(b));
    ASSERT_TRUE(same(a, b));
    for (const double ago : {0.0, 4.9}) {
      const Time time = a.time - Duration::from_seconds(ago);
      if (a.sensor != Sensor::camera || time < o.start) continue;
      ++frames;
      ASSERT_EQ(all->truth(time).bias.gyro, some->truth(time).bias.gyro);
      ASSERT_EQ(all->truth(time).bias.accel, some->truth(time).bias.accel);
    }
    for (const FeatureObservation& f : b.features) ASSERT_EQ(*all->landmark(f.track), *some->landmark(f.track));
  }
  EXPECT_GT(frames, 2000);
  EXPECT_EQ(some->landmarks(), all->landmarks());
  EXPECT_NE(all->landmark(0), nullptr);
  EXPECT_EQ(some->landmark(0), nullptr);
  EXPECT_EQ(some->landmark(some->landmarks()), nullptr);
  // The oldest bias that it still knows is of 5 s ago, or of the block of 256 samples in which that lies.
  const Time oldest = o.start + Duration::from_seconds(60.0 - 5.0 - 1.5);
  EXPECT_EQ(some->truth(o.start).bias.gyro, some->truth(oldest).bias.gyro);
  EXPECT_NE(some->truth(o.start).bias.gyro, some->truth(oldest + Duration::from_seconds(1.6)).bias.gyro);
}

TEST(SimulatedWorld, KeepsTracksOverSeveralFramesAndReplacesThoseItLoses) {
  SimulatedWorldOptions o;
  o.seconds = 20.0;
  o.cameras.tracks = 60;
  std::map<std::int64_t, int> seen;
  for (const SimulatedMeasurement& m : all_of(o)) {
    std::set<std::int64_t> once;
    for (const FeatureObservation& f : m.features) {
      EXPECT_TRUE(once.insert(f.track).second);
      ++seen[f.track];
    }
  }
  std::int64_t observations = 0;
  for (const auto& [track, n] : seen) observations += n;
  const double length = static_cast<double>(observations) / static_cast<double>(seen.size());
  EXPECT_GT(length, 8.0);
  EXPECT_LT(length, 100.0);
}

TEST(SimulatedWorld, HandsOverInTheOrderOfArrivalEachAsLateAsItsSensorIs) {
  SimulatedWorldOptions o = all_sensors(4.0);
  o.cameras.timing.latency = Duration::from_seconds(0.08);
  o.gnss.timing.latency = Duration::from_seconds(0.2);
  o.gnss.timing.latency_spread = Duration::from_seconds(0.5);
  const auto late = all_of(o);
  ASSERT_EQ(late.size(), all_of(all_sensors(4.0)).size());
  int overtaken = 0;
  Time newest_gnss;
  for (std::size_t k = 0; k < late.size(); ++k) {
    const SimulatedMeasurement& m = late[k];
    EXPECT_EQ(m.stamp, m.time);
    if (k > 0) {
      EXPECT_GE(m.arrival, late[k - 1].arrival);
    }
    const double delay = (m.arrival - m.time).seconds();
    if (m.sensor == Sensor::gnss) {
      EXPECT_GE(delay, 0.2);
      EXPECT_LE(delay, 0.7);
      overtaken += m.time < newest_gnss ? 1 : 0;
      newest_gnss = std::max(newest_gnss, m.time);
    } else {
      EXPECT_DOUBLE_EQ(delay, m.sensor == Sensor::camera ? 0.08 : 0.0);
    }
  }
  EXPECT_GT(overtaken, 5);
}

TEST(SimulatedWorld, StampsBySensorClocksThatMayBeOff) {
  SimulatedWorldOptions o = all_sensors(1.0);
  o.cameras.timing.clock_offset = Duration{-7'000'000};
  for (const SimulatedMeasurement& m : all_of(o))
    EXPECT_EQ((m.stamp - m.time).ns, m.sensor == Sensor::camera ? -7'000'000 : 0);
}

TEST(SimulatedWorld, StandsStillWhenItIsTold) {
  SimulatedWorldOptions o;
  o.seconds = 8.0;
  o.rests = {{0.0, 2.0}, {5.0, 6.0}};
  o.imu.noise = {};
  auto world = SimulatedWorld::make(o);
  for (SimulatedMeasurement m; world->next(m);) {
    const double t = (m.time - o.start).seconds();
    if (m.sensor != Sensor::imu || !(t <= 2.0 || (t >= 5.0 && t <= 6.0))) continue;
    const SimulatedTruth x = world->truth(m.time);
    EXPECT_LT(x.velocity.v.norm(), 1e-12);
    EXPECT_NEAR((m.imu.accel - x.bias.accel).norm(), 9.81, 1e-9);
    EXPECT_LT((m.imu.gyro - x.bias.gyro).norm(), 1e-12);
  }
}

TEST(SimulatedWorld, RefusesOptionsThatMakeNoWorldAndSaysWhatWasExpected) {
  const auto refused = [](auto change) {
    SimulatedWorldOptions o;
    change(o);
    const auto world = SimulatedWorld::make(o);
    return !world.ok() && world.error().message.find("expected") != std::string::npos;
  };
  EXPECT_TRUE(refused([](auto& o) { o.seconds = -1.0; }));
  EXPECT_TRUE(refused([](auto& o) { o.seconds = std::nan(""); }));
  EXPECT_TRUE(refused([](auto& o) { o.imu.timing.rate_hz = -200.0; }));
  EXPECT_TRUE(refused([](auto& o) { o.cameras.pixel_sigma = -1.0; }));
  EXPECT_TRUE(refused([](auto& o) { o.cameras.nearest_birth = 0.1; }));
  EXPECT_TRUE(refused([](auto& o) { o.cameras.timing.latency = Duration{-1}; }));
  EXPECT_TRUE(refused([](auto& o) { o.spacing_s = 0.0; }));
  EXPECT_TRUE(refused([](auto& o) { o.rests = {{4.0, 2.0}}; }));
  EXPECT_TRUE(refused([](auto& o) { o.faults = {{Kind::outlier, Sensor::gnss, {}, 1.5}}; }));
}

}  // namespace
}  // namespace oriel
