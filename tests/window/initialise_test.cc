// How a window starts: from rest, in motion, or not yet, and why.
#include "oriel/window/initialise.h"

#include <gtest/gtest.h>

#include "simulated_flight.h"

namespace oriel {
namespace {

Initialiser initialiser_for(const SimulatedFlight& flight, std::size_t frames) {
  Initialiser i(flight.rig, true, flight.noise, {});
  for (std::size_t k = 0; k < frames; ++k) i.add({flight.frames[k].time, flight.frames[k].features});
  return i;
}

ImuBuffer all_imu(const SimulatedFlight& flight) {
  ImuBuffer buffer;
  for (const ImuSample& s : flight.imu) EXPECT_TRUE(buffer.add(s).ok());
  return buffer;
}

TEST(Standstill, EndsWithTheBlockBeforeTheMotionStarts) {
  const SimulatedFlight flight({.rest_s = 3.2, .duration_s = 6.0});
  const auto still = find_standstill(flight.imu, flight.imu.front().time, flight.imu.back().time, {});
  ASSERT_TRUE(still.has_value());
  EXPECT_GE(still->length.seconds(), 2.9);
  EXPECT_LE(still->length.seconds(), 3.6);
  EXPECT_LT((still->gyro - flight.bias.gyro).norm(), 1e-3);
}

TEST(Standstill, IsNotSeenInMotionOrInTooShortATime) {
  const SimulatedFlight moving({.duration_s = 3.0}), still({.rest_s = 3.0, .duration_s = 3.0});
  const Time t0 = moving.imu.front().time;
  EXPECT_FALSE(find_standstill(moving.imu, t0 + Duration{1'000'000'000}, moving.imu.back().time, {}).has_value());
  EXPECT_FALSE(find_standstill(still.imu, t0, t0 + Duration{900'000'000}, {}).has_value());
}

TEST(Standstill, IsSeenThroughVibrationThatAveragesOut) {
  SimulatedFlight flight({.rest_s = 3.0, .duration_s = 2.9});
  for (std::size_t k = 0; k < flight.imu.size(); ++k) flight.imu[k].accel[1] += k % 2 == 0 ? 1.0 : -1.0;
  EXPECT_TRUE(find_standstill(flight.imu, flight.imu.front().time, flight.imu.back().time, {}).has_value());
}

TEST(Level, TurnsUpToTheZAxisEvenFromUpsideDown) {
  for (const Vec3d& up : {Vec3d{{9.1, 0.1, -3.7}}, Vec3d{{0.0, 0.0, -9.81}}, Vec3d{{0.0, 0.0, 2.0}}}) {
    const Vec3d z = level(up) * (up / up.norm());
    EXPECT_NEAR(z[2], 1.0, 1e-12);
  }
}

TEST(InertialAlignment, FindsBiasVelocityAndGravityFromTruePoses) {
  const SimulatedFlight flight({.duration_s = 4.0});
  std::vector<TimedPose> poses;
  const Pose3d T_first_world = flight.pose(1.0).inverse();
  for (int k = 0; k <= 10; ++k)
    poses.push_back({SimulatedFlight::time_of(1.0 + 0.2 * k), T_first_world * flight.pose(1.0 + 0.2 * k)});
  const auto found = align_inertial(poses, all_imu(flight), flight.noise, {});
  ASSERT_TRUE(found.ok());
  EXPECT_LT((found->bias.gyro - flight.bias.gyro).norm(), 1e-3);
  EXPECT_LT((found->gravity - T_first_world.R * kStandardGravity).norm(), 0.15);
  const Vec3d v = (flight.pose(2.001).t - flight.pose(1.999).t) / 0.002;
  EXPECT_LT((found->velocities[5] - T_first_world.R * v).norm(), 0.02);
}

TEST(Initialiser, StartsAtRestWithTheFirstFrame) {
  const SimulatedFlight flight({.rest_s = 2.0, .duration_s = 3.0});
  Initialiser i = initialiser_for(flight, 16);
  const Initialisation start = i.attempt(all_imu(flight));
  ASSERT_EQ(start.kind, Initialisation::Kind::standstill);
  ASSERT_EQ(start.states.size(), 1u);
  EXPECT_EQ(start.states[0].time, flight.frames[0].time);
  const Vec3d up_body = flight.pose(0.0).R.inverse() * Vec3d{{0.0, 0.0, 1.0}};
  EXPECT_GT((start.states[0].T_world_body.R * up_body)[2], std::cos(0.01));  // the accelerometer's bias tilts it
}

TEST(Initialiser, StartsInMotionWithTheTruePosesUpToAShiftAndATurnAboutTheVertical) {
  const SimulatedFlight flight({.duration_s = 5.0});
  Initialiser i = initialiser_for(flight, 0);
  for (std::size_t k = 10; k < 28; ++k) i.add({flight.frames[k].time, flight.frames[k].features});
  const Initialisation start = i.attempt(all_imu(flight));
  ASSERT_EQ(start.kind, Initialisation::Kind::moving) << start.reason;
  EXPECT_EQ(start.states.back().frame, 17u);
  for (std::size_t k = 1; k < start.states.size(); ++k) {
    const Pose3d truth =
        flight.pose(1.0).inverse() * flight.pose(1.0 + 0.1 * static_cast<double>(start.states[k].frame));
    const Pose3d found = start.states[0].T_world_body.inverse() * start.states[k].T_world_body;
    EXPECT_LT(found.minus(truth).norm(), 0.08);  // depths of the first frame: 0.35 m a point
  }
  const Vec3d up_body = flight.pose(1.0).R.inverse() * Vec3d{{0.0, 0.0, 1.0}};
  EXPECT_GT((start.states[0].T_world_body.R * up_body)[2], std::cos(0.02));
}

TEST(Initialiser, SaysWhyItCanNotStartYet) {
  const SimulatedFlight flight({.duration_s = 4.0});
  const ImuBuffer imu = all_imu(flight);
  EXPECT_STREQ(initialiser_for(flight, 1).attempt(imu).reason, "one frame");
  EXPECT_STREQ(initialiser_for(flight, 8).attempt(imu).reason, "moving, and too few frames");
}

TEST(Initialiser, DoesNotStartInMotionWithoutPointsToGoBy) {
  const SimulatedFlight flight({.duration_s = 3.0, .points = 3});
  const Initialisation none = initialiser_for(flight, 30).attempt(all_imu(flight));
  EXPECT_EQ(none.kind, Initialisation::Kind::none);
  EXPECT_STREQ(none.reason, "too few frames with stereo poses and IMU samples");
}

TEST(Initialiser, StartsWithTheFramesAfterTheFirstSamples) {
  SimulatedFlight flight({.duration_s = 5.0});
  std::erase_if(flight.imu, [](const ImuSample& s) { return s.time < SimulatedFlight::time_of(1.52); });
  const Initialisation start = initialiser_for(flight, 40).attempt(all_imu(flight));
  ASSERT_EQ(start.kind, Initialisation::Kind::moving) << start.reason;
  EXPECT_EQ(start.states.front().frame, 16u);
}

TEST(Initialiser, DoesNotStartWhereGravityHasTheWrongLength) {
  SimulatedFlight flight({.duration_s = 4.0});
  for (ImuSample& s : flight.imu) s.accel *= 0.7;  // a wrong scale, as from a wrong unit
  Initialiser i = initialiser_for(flight, 0);
  for (std::size_t k = 10; k < 40; ++k) i.add({flight.frames[k].time, flight.frames[k].features});
  const Initialisation none = i.attempt(all_imu(flight));
  EXPECT_EQ(none.kind, Initialisation::Kind::none);
  EXPECT_STREQ(none.reason, "gravity has the wrong length: poses and IMU disagree");
}

}  // namespace
}  // namespace oriel
