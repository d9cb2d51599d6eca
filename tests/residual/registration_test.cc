// Similarities, registration, directions and cameras with free intrinsics: values by hand, Jacobians in three ways.
#include "oriel/residual/registration.h"

#include <numbers>

#include "oriel/manifold/positive.h"
#include "oriel/residual/calibrated_reprojection.h"
#include "oriel/residual/direction.h"
#include "oriel/residual/sim3.h"
#include "random_values.h"
#include "residual/jacobian_agreement.h"

namespace oriel {
namespace {

using testing_values::Random;

const Pose3d kTurnedLeft{Rot3d::exp({{0, 0, std::numbers::pi / 2}}), {{10, 20, 30}}};  // its x looks along y

template <class V>
void check_prior(double spread) {
  Random random(31);
  for (const double distance : {0.0, 1e-160, 1e-8, 1e-4, 0.1, spread}) {
    const V value = random.value<V>(spread), x = value.plus(random.normal<V::kDim>(distance));
    expect_all(Prior{value}, x);
  }
}
// V10
TEST(Prior, HasTheSameJacobianByThreeWaysForSimilaritiesDirectionsAndScalars) {
  check_prior<Sim3d>(0.5);
  check_prior<UnitVector3d>(0.7);
  check_prior<Positived>(2.0);
  check_prior<PinholeIntrinsicsd>(100.0);
}

// V10
TEST(Between, HasTheSameJacobianByThreeWaysForSimilarities) {
  Random random(32);
  for (const double distance : {0.0, 1e-160, 1e-8, 1e-4, 0.1, 0.4}) {
    const Sim3d a = random.value<Sim3d>(1.0), measured = random.value<Sim3d>(0.5);
    expect_all(Between{measured}, a, a * measured * Sim3d::exp(random.normal<7>(distance)));
  }
  for (const double angle : {3.0, 3.13}) {
    const Sim3d a = random.value<Sim3d>(1.0), measured = random.value<Sim3d>(0.5);
    expect_agreement(Between{measured}, a, a * measured * Sim3d::exp({{0, 0.6 * angle, 0.8 * angle, 1, 2, 3, 0.7}}));
  }
}

TEST(Between, OfSimilaritiesIsTheLogarithmOfTheScaleThatDrifted) {
  Sim3d a, b;
  b.t = {{4.0, 0.0, 0.0}};
  b.s = 2.0;
  Vec<double, 7> r;
  ASSERT_TRUE((Between<Sim3d>{b}.evaluate(a, b, r, nullptr, nullptr)));
  EXPECT_EQ(r.norm(), 0.0);
  Sim3d drifted = b;
  drifted.s = 2.2;
  ASSERT_TRUE((Between<Sim3d>{b}.evaluate(a, drifted, r, nullptr, nullptr)));
  EXPECT_NEAR(r[6], std::log(1.1), 1e-15);
  EXPECT_NEAR(r.squared_norm(), r[6] * r[6], 1e-30);
}

TEST(Registration, MeasuresInTheFrameOfTheFirstPose) {
  const Pose3d& a = kTurnedLeft;
  Vec3d r;
  // The origin of b lies at (3, 2, 1) of a, and was matched to (3, 2, 0).
  const Pose3d b{Rot3d{}, a * Vec3d{{3, 2, 1}}};
  const Vec3d matched = {{3, 2, 0}}, origin = Vec3d::zero();
  ASSERT_TRUE((PointToPointd{matched, origin}.evaluate(a, b, r, nullptr, nullptr)));
  EXPECT_LT((r - Vec3d{{0, 0, 1}}).norm(), 1e-14);
  Vec1d height;
  ASSERT_TRUE((PointToPlaned{{{9, 9, 0}}, {{{0, 0, 1}}}, origin}.evaluate(a, b, height, nullptr, nullptr)));
  EXPECT_NEAR(height[0], 1.0, 1e-14);
  Vec2d across;
  ASSERT_TRUE((PointToLined{matched, {{{1, 0, 0}}}, origin}.evaluate(a, b, across, nullptr, nullptr)));
  EXPECT_NEAR(across.norm(), 1.0, 1e-14);
  ASSERT_TRUE((PointToLined{matched, {{{0, 0, 1}}}, origin}.evaluate(a, b, across, nullptr, nullptr)));
  EXPECT_NEAR(across.norm(), 0.0, 1e-14);
}

// V10
TEST(Registration, HasTheSameJacobianByThreeWays) {
  Random random(33);
  for (const double size : {0.0, 1e-8, 1.0, 50.0})
    for (int i = 0; i < 5; ++i) {
      const Pose3d a = random.value<Pose3d>(1.0), b = i == 0 ? a : random.value<Pose3d>(1.0);
      const Vec3d p_a = random.normal<3>(size), p_b = random.normal<3>(size);
      UnitVector3d across = random.value<UnitVector3d>(1.0);
      if (i == 1) across.v = {{1.0, 0.0, 0.0}};  // where its basis jumps
      expect_all(PointToPointd{p_a, p_b}, a, b);
      expect_all(PointToPlaned{p_a, across, p_b}, a, b);
      expect_all(PointToLined{p_a, across, p_b}, a, b);
    }
}

TEST(Direction, IsTheAngleBetweenWhatIsSeenAndWhatIsThere) {
  Vec2d r;
  const DirectionToPointd ahead{{{1, 0, 0}}};
  const Vec3d p = kTurnedLeft * Vec3d{{2.0, 0.0, 0.0}}, q = kTurnedLeft * Vec3d{{2.0, 0.0, 2.0}};
  ASSERT_TRUE((ahead.evaluate(kTurnedLeft, Point3d{p}, r, nullptr, nullptr)));
  EXPECT_LT(r.norm(), 1e-15);
  ASSERT_TRUE((ahead.evaluate(kTurnedLeft, Point3d{q}, r, nullptr, nullptr)));
  EXPECT_NEAR(r.norm(), std::numbers::pi / 4, 1e-14);
}

// V10
TEST(Direction, HasTheSameJacobianByThreeWaysFromAheadToNearlyBehind) {
  Random random(34);
  for (const double angle : {0.0, 1e-160, 1e-8, 0.19, 0.21, 1.6, 3.0, 3.13})
    for (const double distance : {0.5, 30.0}) {
      const Pose3d x = random.value<Pose3d>(1.0);
      const UnitVector3d z = random.value<UnitVector3d>(1.0), y = z.plus({{0.6 * angle, 0.8 * angle}});
      const Point3d p{x * (y.v * distance)};
      const JacobianCheck check = check_jacobian(DirectionToPointd{z}, angle > 3.1 ? 1e-4 : 1e-3, x, p);
      EXPECT_LT(check.analytic_and_dual, 1e-11) << angle << ' ' << distance << ": " << check;
      EXPECT_LT(check.worst(), 1e-7) << angle << ' ' << distance << ": " << check;
      expect_pack_equals_double(DirectionToPointd{z}, x, p);
    }
}

TEST(Direction, IsNotValidWhereThereIsNone) {
  Vec2d r;
  const Pose3d x = kTurnedLeft;
  EXPECT_FALSE((DirectionToPointd{{{0, 0, 1}}}.evaluate(x, Point3d{x.t}, r, nullptr, nullptr)));
  EXPECT_FALSE((DirectionToPointd{{{0, 0, 1}}}.evaluate(x, Point3d{x * Vec3d{{0, 0, -2}}}, r, nullptr, nullptr)));
}

TEST(CalibratedReprojection, ProjectsAsAPinholeWithRadialDistortion) {
  const PinholeIntrinsicsd camera{500, 400, 320, 240, -0.3, 0.1};
  const Vec3d h = {{0.4, -0.2, 2.0}};  // x = 0.2, y = -0.1, s = 0.05
  const double d = 1.0 - 0.3 * 0.05 + 0.1 * 0.0025;
  Vec2d r;
  const CalibratedReprojectiond seen{{{300.0, 200.0}}};
  ASSERT_TRUE((seen.evaluate(kTurnedLeft, Point3d{kTurnedLeft * h}, camera, r, nullptr, nullptr, nullptr)));
  EXPECT_NEAR(r[0], 500 * d * 0.2 + 320 - 300, 1e-12);
  EXPECT_NEAR(r[1], 400 * d * -0.1 + 240 - 200, 1e-12);
}

// V10, V8
TEST(CalibratedReprojection, HasTheSameJacobianByThreeWaysAndEndsWhereItsModelEnds) {
  Random random(35);
  const PinholeIntrinsicsd camera{500, 400, 320, 240, -0.3, 0.1};
  for (const double depth : {0.06, 0.5, 2.0, 1e3})
    for (const double side : {0.0, 1e-9, 0.3, 0.9}) {
      const Pose3d pose = random.value<Pose3d>(1.0);
      const Point3d p{pose * Vec3d{{side * depth, -0.5 * side * depth, depth}}};
      const CalibratedReprojectiond seen{random.normal<2>(100.0)};
      const JacobianCheck check = check_jacobian(seen, std::fmin(1e-3, 1e-2 * depth), pose, p, camera);
      EXPECT_LT(check.analytic_and_dual, 1e-12) << depth << ' ' << side << ": " << check;
      EXPECT_LT(check.worst(), 1e-7) << depth << ' ' << side << ": " << check;
      expect_pack_equals_double(seen, pose, p, camera);
    }
  Vec2d r;
  const auto valid = [&](const Vec3d& h) {
    const PinholeIntrinsicsd barrel{500, 400, 320, 240, -0.3, 0.0};
    return CalibratedReprojectiond{}.evaluate(Pose3d{}, Point3d{h}, barrel, r, nullptr, nullptr, nullptr);
  };
  EXPECT_FALSE(valid({{0.0, 0.0, 0.04}}));
  EXPECT_FALSE(valid({{0.0, 0.0, -1.0}}));
  // 1 + 3 k1 s is positive up to s = 1.11.
  EXPECT_TRUE(valid({{1.0, 0.0, 1.0}}));
  EXPECT_FALSE(valid({{1.2, 0.0, 1.0}}));
}

}  // namespace
}  // namespace oriel
