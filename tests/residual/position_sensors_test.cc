// GNSS, velocities in the body's frame and ranges: values by hand, Jacobians in three ways.
#include <gtest/gtest.h>

#include <cmath>

#include "oriel/residual/body_velocity.h"
#include "oriel/residual/check_jacobian.h"
#include "oriel/residual/gnss.h"
#include "oriel/residual/range.h"
#include "random_values.h"

namespace oriel {
namespace {

using testing_values::Random;

const Pose3d kTurnedLeft{Rot3d::exp({{0, 0, std::acos(0.0)}}), {{10, 20, 30}}};  // the body's x looks north

template <class R, class... V>
void expect_agreement(const R& residual, double step, const V&... x) {
  const JacobianCheck check = check_jacobian(residual, step, x...);
  EXPECT_LT(check.analytic_and_dual, 1e-12) << R::kName << ": " << check;
  EXPECT_LT(check.worst(), 1e-8) << R::kName << ": " << check;
}

TEST(GnssPosition, IsWhereTheAntennaIsAndNotTheBody) {
  const LeverArmd antenna{{{1.0, 0.5, 2.0}}};
  Vec3d r;
  ASSERT_TRUE((GnssPositiond{{{9.5, 21.0, 32.0}}}.evaluate(kTurnedLeft, antenna, r, nullptr)));
  EXPECT_LT(r.norm(), 1e-14);
  ASSERT_TRUE((GnssPositiond{{{9.0, 21.0, 32.0}}}.evaluate(kTurnedLeft, antenna, r, nullptr)));
  EXPECT_NEAR(r[0], 0.5, 1e-14);  // estimate minus measurement
}

// V10
TEST(GnssPosition, HasTheSameJacobianByThreeWays) {
  Random random(21);
  for (const double lever : {0.0, 1e-8, 0.3, 20.0}) {
    const LeverArmd antenna{random.normal<3>(lever)};
    expect_agreement(GnssPositiond{random.normal<3>(10.0)}, 1e-3, random.value<Pose3d>(1.0), antenna);
  }
}

TEST(BodyVelocity, OfADriveNorthIsAheadForABodyThatLooksNorth) {
  Vec3d r;
  const Velocity3d north{{{0.0, 3.0, 0.0}}};
  ASSERT_TRUE((BodyVelocityd{{{3.0, 0.0, 0.0}}}.evaluate(kTurnedLeft, north, r, nullptr, nullptr)));
  EXPECT_LT(r.norm(), 1e-14);
}

// V10
TEST(BodyVelocity, HasTheSameJacobianByThreeWaysAtRestToo) {
  Random random(22);
  for (const double speed : {0.0, 1e-8, 1.0, 30.0})
    expect_agreement(BodyVelocityd{random.normal<3>(1.0)}, 1e-3, random.value<Pose3d>(1.0),
                     random.value<Velocity3d>(speed));
}

TEST(Range, IsTheDistanceFromTheAntennaToThePlace) {
  const LeverArmd antenna{{{1.0, 0.0, 0.0}}};  // at (10, 21, 30)
  const Vec3d place = {{13.0, 21.0, 34.0}};
  Vec1d r;
  ASSERT_TRUE((RangeToPointd{4.5}.evaluate(kTurnedLeft, Point3d{place}, antenna, r, nullptr, nullptr)));
  EXPECT_NEAR(r[0], 0.5, 1e-14);
  ASSERT_TRUE((RangeToBeacond{4.5}.evaluate(kTurnedLeft, Beacond{place}, antenna, r, nullptr)));
  EXPECT_NEAR(r[0], 0.5, 1e-14);
}

// V10
TEST(Range, HasTheSameJacobianByThreeWaysNearAndFar) {
  Random random(23);
  for (const double distance : {1e-3, 0.5, 20.0, 1e4}) {
    const Pose3d x = random.value<Pose3d>(1.0);
    const LeverArmd antenna{random.normal<3>(0.5)};
    const Vec3d away = random.normal<3>(1.0), place = x * antenna.p_body_sensor + away * (distance / away.norm());
    const double step = std::fmin(1e-3, 1e-2 * distance);  // curved over its own length
    expect_agreement(RangeToPointd{distance + 0.1}, step, x, Point3d{place}, antenna);
    expect_agreement(RangeToBeacond{distance - 0.1}, step, x, Beacond{place}, antenna);
  }
}

TEST(Range, IsNotValidAtThePlaceItselfWhereItHasNoDirection) {
  const LeverArmd antenna{{{0.2, 0.0, 0.1}}};
  const Vec3d place = kTurnedLeft * antenna.p_body_sensor;
  Vec1d r;
  Mat<double, 1, 6> J;
  EXPECT_FALSE((RangeToBeacond{1.0}.evaluate(kTurnedLeft, Beacond{place}, antenna, r, &J)));
  EXPECT_TRUE(std::isfinite(r[0]));
}

// Eight rows at once are eight times one row: lanes that are not valid spoil no other.
TEST(Range, OfEightRowsAtOnceIsThatOfEach) {
  Random random(24);
  Vec<Pack, 1> packed;
  Mat<Pack, 1, 6> J_packed;
  RangeToBeacon<Pack> residual{};
  Pose3<Pack> x = cast<Pack>(kTurnedLeft);
  Beacon<Pack> beacon{};
  double places[8][3], ranges[8];
  for (int lane = 0; lane < 8; ++lane) {
    ranges[lane] = random.uniform(1.0, 5.0);
    for (int i = 0; i < 3; ++i) places[lane][i] = lane == 5 ? kTurnedLeft.t[i] : random.uniform(-5.0, 5.0);
    residual.range.set(lane, ranges[lane]);
    for (int i = 0; i < 3; ++i) beacon.p_world_beacon[i].set(lane, places[lane][i]);
  }
  const auto valid = residual.evaluate(x, beacon, LeverArm<Pack>{}, packed, &J_packed);
  for (int lane = 0; lane < 8; ++lane) {
    Vec1d r;
    Mat<double, 1, 6> J;
    const Beacond place{{{places[lane][0], places[lane][1], places[lane][2]}}};
    EXPECT_EQ((RangeToBeacond{ranges[lane]}.evaluate(kTurnedLeft, place, {}, r, &J)), valid[lane]) << lane;
    if (lane == 5) continue;
    EXPECT_NEAR(packed[0][lane], r[0], 1e-14 * (1.0 + std::fabs(r[0])));
    for (int i = 0; i < 6; ++i) EXPECT_NEAR(J_packed(0, i)[lane], J(0, i), 1e-13);
  }
}

}  // namespace
}  // namespace oriel
