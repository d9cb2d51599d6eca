// Landmarks of the plane and of space seen from a pose: values by hand, Jacobians in three ways, eight rows at once.
#include <gtest/gtest.h>

#include <cmath>

#include "oriel/residual/check_jacobian.h"
#include "oriel/residual/landmark2.h"
#include "oriel/residual/landmark3.h"
#include "random_values.h"

namespace oriel {
namespace {

using testing_values::Random;

const double kQuarter = std::acos(0.0);
const Pose2d kNorth{Rot2d::exp(kQuarter), {{10, 20}}};  // the robot's x looks north, its y west

template <class R, class... V>
void expect_agreement(const R& residual, double step, const V&... x) {
  const JacobianCheck check = check_jacobian(residual, step, x...);
  EXPECT_TRUE(check.valid) << R::kName;
  EXPECT_LT(check.analytic_and_dual, 1e-12) << R::kName << ": " << check;
  EXPECT_LT(check.worst(), 1e-8) << R::kName << ": " << check;
}

TEST(Sighting2, IsThePlaceOfTheLandmarkInTheRobotsFrame) {
  Vec2d r;  // the landmark is 3 m ahead and 1 m to the right
  ASSERT_TRUE((Sighting2d{{{2.5, -1.5}}}.evaluate(kNorth, Point2d{{{11, 23}}}, r, nullptr, nullptr)));
  EXPECT_NEAR(r[0], 0.5, 1e-14);
  EXPECT_NEAR(r[1], 0.5, 1e-14);
}

TEST(Bearing2, CountsFromTheRobotsXToItsYAndTheShortWayRound) {
  Vec1d r;
  const Point2d west{{{7, 20}}}, behind{{{10.0, 15.0}}};
  ASSERT_TRUE((Bearing2d{1.0}.evaluate(kNorth, west, r, nullptr, nullptr)));
  EXPECT_NEAR(r[0], kQuarter - 1.0, 1e-14);
  ASSERT_TRUE((Bearing2d{-3.0}.evaluate(kNorth, behind, r, nullptr, nullptr)));
  EXPECT_NEAR(std::fabs(r[0]), 2 * kQuarter - 3.0, 1e-14) << "not a whole turn more";
}

TEST(BearingRange2, IsTheBearingAndThenTheRange) {
  Random random(31);
  const Pose2d x = random.value<Pose2d>(2.0);
  const Point2d l = random.value<Point2d>(5.0);
  Vec1d bearing, range;
  Vec2d both;
  ASSERT_TRUE((Bearing2d{0.3}.evaluate(x, l, bearing, nullptr, nullptr)));
  ASSERT_TRUE((Range2d{4.0}.evaluate(x, l, range, nullptr, nullptr)));
  ASSERT_TRUE((BearingRange2d{0.3, 4.0}.evaluate(x, l, both, nullptr, nullptr)));
  EXPECT_EQ(both, (Vec2d{bearing[0], range[0]}));
  EXPECT_NEAR(range[0] + 4.0, (l.p - x.t).norm(), 1e-14);
}

TEST(Sighting3, IsThePlaceOfTheLandmarkInTheSensorsFrame) {
  // The body looks north, the sensor sits 1 m above it and looks to its right: east.
  const Pose3d body{Rot3d::exp({{0, 0, kQuarter}}), {{10, 20, 30}}};
  const SensorPosed sensor{Pose3d{Rot3d::exp({{0, 0, -kQuarter}}), {{0, 0, 1}}}};
  Vec3d r;
  const Point3d east{{{15, 22, 32}}};
  ASSERT_TRUE((Sighting3d{{{4, 3, 2}}}.evaluate(body, east, sensor, r, nullptr, nullptr)));
  EXPECT_LT((r - Vec3d{{1, -1, -1}}).norm(), 1e-14) << "5 m ahead of it, 2 m to its left, 1 m above";
}

// V10
TEST(Landmarks2, HaveTheSameJacobianByThreeWaysNearAndFar) {
  Random random(32);
  for (const double distance : {1e-3, 0.5, 20.0, 1e4}) {
    const Pose2d x = random.value<Pose2d>(1.0);
    const Vec2d away = random.normal<2>(1.0);
    const Point2d l{x.t + away * (distance / away.norm())};
    const double step = std::fmin(1e-3, 1e-2 * distance);  // curved over its own length
    const double bearing = random.uniform(-3.0, 3.0);
    expect_agreement(Sighting2d{random.normal<2>(1.0)}, 1e-3, x, l);
    expect_agreement(Bearing2d{bearing}, step, x, l);
    expect_agreement(Range2d{distance + 0.1}, step, x, l);
    expect_agreement(BearingRange2d{bearing, distance + 0.1}, step, x, l);
  }
}

// V10
TEST(Landmarks3, HaveTheSameJacobianByThreeWaysForEverySensorPose) {
  Random random(33);
  for (const double spread : {0.0, 1e-8, 1.0, 30.0}) {
    const SensorPosed sensor{Pose3d{Rot3d::exp(random.normal<3>(std::fmin(spread, 1.0))), random.normal<3>(spread)}};
    expect_agreement(Sighting3d{random.normal<3>(2.0)}, 1e-3, random.value<Pose3d>(1.0),
                     Point3d{random.normal<3>(spread)}, sensor);
  }
}

TEST(Landmarks2, AreNotValidWhereTheRobotStandsOnTheLandmark) {
  const Point2d here{kNorth.t};
  Vec2d both;
  Vec1d one;
  Mat<double, 2, 3> J_a;
  Mat<double, 2, 2> J_l;
  EXPECT_FALSE((Bearing2d{0.1}.evaluate(kNorth, here, one, nullptr, nullptr)));
  EXPECT_FALSE((Range2d{0.1}.evaluate(kNorth, here, one, nullptr, nullptr)));
  EXPECT_FALSE((BearingRange2d{0.1, 0.1}.evaluate(kNorth, here, both, &J_a, &J_l)));
  EXPECT_TRUE(std::isfinite(both[0]) && std::isfinite(both[1]));
  for (int c = 0; c < 3; ++c) EXPECT_TRUE(std::isfinite(J_a(0, c)) && std::isfinite(J_a(1, c)));
  Vec2d r;
  EXPECT_TRUE((Sighting2d{{{0.5, 0}}}.evaluate(kNorth, here, r, nullptr, nullptr))) << "a place needs no direction";
}

// Lanes that are not valid spoil no other.
TEST(Landmarks2, OfEightRowsAtOnceAreThoseOfEach) {
  Random random(34);
  Vec<Pack, 2> packed;
  Mat<Pack, 2, 3> packed_a;
  Mat<Pack, 2, 2> packed_l;
  BearingRange2<Pack> residual{};
  Point2<Pack> l{};
  Vec2d places[8];
  double bearings[8];
  for (int lane = 0; lane < 8; ++lane) {
    bearings[lane] = random.uniform(-3.0, 3.0);
    places[lane] = lane == 5 ? kNorth.t : kNorth.t + random.normal<2>(4.0);
    residual.bearing.set(lane, bearings[lane]);
    residual.range.set(lane, 2.0 + lane);
    for (int i = 0; i < 2; ++i) l.p[i].set(lane, places[lane][i]);
  }
  const auto valid = residual.evaluate(cast<Pack>(kNorth), l, packed, &packed_a, &packed_l);
  for (int lane = 0; lane < 8; ++lane) {
    Vec2d r;
    Mat<double, 2, 3> J_a;
    Mat<double, 2, 2> J_l;
    const bool one = BearingRange2d{bearings[lane], 2.0 + lane}.evaluate(kNorth, Point2d{places[lane]}, r, &J_a, &J_l);
    EXPECT_EQ(valid[lane], one) << lane;
    EXPECT_EQ(one, lane != 5);
    for (int i = 0; i < 2; ++i) {
      EXPECT_NEAR(packed[i][lane], r[i], 1e-13 * (1.0 + std::fabs(r[i]))) << lane;
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(packed_a(i, c)[lane], J_a(i, c), 1e-12) << lane;
      for (int c = 0; c < 2; ++c) EXPECT_NEAR(packed_l(i, c)[lane], J_l(i, c), 1e-12) << lane;
    }
  }
}

}  // namespace
}  // namespace oriel
