// Behaviour V10 for all shipped residuals, and that eight rows at once are eight times one row.
#include <gtest/gtest.h>

#include "oriel/residual/bal.h"
#include "oriel/residual/between.h"
#include "oriel/residual/pose_graph.h"
#include "oriel/residual/prior.h"
#include "oriel/residual/reprojection.h"
#include "random_values.h"
#include "residual/jacobian_agreement.h"

namespace oriel {
namespace {

using testing_values::euroc_like_rig;
using testing_values::Random;

template <class V>
void check_prior(double spread) {
  Random random(11);
  for (const double distance : {0.0, 1e-160, 1e-8, 1e-4, 0.1, spread}) {
    const V value = random.value<V>(spread), x = value.plus(random.normal<V::kDim>(distance));
    expect_all(Prior{value}, x);
  }
}
// V10
TEST(Prior, HasTheSameJacobianByThreeWaysForEveryManifold) {
  check_prior<Rot2d>(0.5);
  check_prior<Pose2d>(0.5);
  check_prior<Rot3d>(0.5);
  check_prior<Pose3d>(0.5);
  check_prior<Point2d>(1.0);
  check_prior<Point3d>(1.0);
  check_prior<Velocity3d>(1.0);
  check_prior<ImuBiasd>(1.0);
  check_prior<VectorNd<5>>(1.0);
  check_prior<InverseDepthd>(0.05);
  check_prior<BalCamerad>(0.5);
}

template <class V>
void check_between() {
  Random random(12);
  for (const double distance : {0.0, 1e-160, 1e-8, 1e-4, 0.1, 0.5}) {
    const V a = random.value<V>(1.0), measured = random.value<V>(0.5);
    V b = a.plus(measured.minus(V{}));
    if constexpr (Group<V>) b = a * measured;
    b = b.plus(random.normal<V::kDim>(distance));
    expect_all(Between{measured}, a, b);
  }
}
// V10
TEST(Between, HasTheSameJacobianByThreeWaysForEveryGroupAndVector) {
  check_between<Rot2d>();
  check_between<Pose2d>();
  check_between<Rot3d>();
  check_between<Pose3d>();
  check_between<Point2d>();
  check_between<Point3d>();
  check_between<Velocity3d>();
  check_between<ImuBiasd>();
  check_between<VectorNd<3>>();
}

// V10
TEST(Between, KeepsItsJacobianNearHalfATurn) {
  Random random(13);
  for (const double angle : {3.0, 3.13}) {
    const Vec3d axis = random.normal<3>(1.0);
    const Rot3d error = Rot3d::exp(axis * (angle / axis.norm()));
    const Pose3d a = random.value<Pose3d>(1.0), measured = random.value<Pose3d>(0.5);
    expect_agreement(Between{measured}, a, a * measured * Pose3d{error, {{1, 2, 3}}});
    expect_agreement(Between{measured.R}, a.R, a.R * measured.R * error);
  }
}

// V10
TEST(PoseGraphEdge3, HasTheSameJacobianByThreeWays) {
  Random random(14);
  for (int i = 0; i < 50; ++i) {
    const Pose3d a = random.value<Pose3d>(1.0), measured = random.value<Pose3d>(1.0);
    const Pose3d b = i % 2 == 0 ? a * measured : random.value<Pose3d>(0.7);
    expect_all(PoseGraphEdge3<double>{measured}, a, b);
  }
}

// V10
TEST(PoseGraphEdge2, HasTheSameJacobianByThreeWays) {
  Random random(15);
  for (int i = 0; i < 50; ++i) {
    const Pose2d a = random.value<Pose2d>(1.0), measured = random.value<Pose2d>(1.0);
    const Pose2d b = i % 2 == 0 ? a * measured : random.value<Pose2d>(0.7);
    expect_all(PoseGraphEdge2<double>{measured}, a, b);
  }
}

// V10
TEST(BalReprojection, HasTheSameJacobianByThreeWaysInFrontAndBehind) {
  Random random(16);
  for (int i = 0; i < 50; ++i) {
    const Vec3d phi = random.normal<3>(i % 5 == 0 ? 1e-9 : 0.7), t = random.normal<3>(1.0);
    const BalCamerad camera{Rot3d::exp(phi), t, 500.0, random.uniform(-0.2, 0.2), random.uniform(-0.05, 0.05)};
    const Vec3d P = {{random.uniform(-2, 2), random.uniform(-2, 2), i % 2 == 0 ? -6.0 : 5.0}};
    const Point3d point{camera.R_camera_world.inverse() * (P - t)};
    expect_all(BalReprojection<double>{random.normal<2>(100.0)}, camera, point);
  }
}

// V10
TEST(Reprojection, OfAnchoredInverseDepthsHasTheSameJacobianByThreeWaysNearAndFar) {
  Random random(17);
  const StereoRigd rig = euroc_like_rig();
  for (const double rho : {1e-9, 1e-3, 0.1, 0.5, 1.5}) {
    const Pose3d a = random.value<Pose3d>(1.0), b = a.plus(random.normal<6>(0.05));
    const Vec2d bearing = random.normal<2>(0.15), pixel0 = random.normal<2>(100.0), pixel1 = random.normal<2>(100.0);
    const InverseDepthd depth{rho};
    const double step = std::fmin(1e-3, 0.2 * rho);  // stays on the straight branch of the inverse depth
    auto check = [&](const auto& residual, const auto&... x) {
      const JacobianCheck c = check_jacobian(residual, step, x...);
      EXPECT_LT(c.analytic_and_dual, 1e-12) << c;
      if (rho > 1e-6) {
        EXPECT_LT(c.worst(), 1e-7) << c;
      }
      expect_pack_equals_double(residual, x...);
    };
    check(StereoReprojection<double>{bearing, pixel0, pixel1}, a, b, depth, rig);
    check(MonoReprojection<double>{bearing, pixel0}, a, b, depth, rig);
    check(MonoReprojection<double, 1>{bearing, pixel1}, a, b, depth, rig);
    check(AnchorReprojection<double>{bearing, pixel1}, depth, rig);
  }
}

// V10
TEST(Reprojection, OfPointsHasTheSameJacobianByThreeWays) {
  Random random(18);
  const StereoRigd rig = euroc_like_rig();
  for (int i = 0; i < 20; ++i) {
    const Pose3d b = random.value<Pose3d>(1.0);
    const double z = random.uniform(0.5, 20.0);
    const Vec3d p_camera = {{z * random.uniform(-0.5, 0.5), z * random.uniform(-0.4, 0.4), z}};
    const Point3d point{b * (rig.cameras[0].T_body_camera() * p_camera)};
    const Vec2d pixel0 = random.normal<2>(100.0), pixel1 = random.normal<2>(100.0);
    expect_all(StereoPointReprojection<double>{pixel0, pixel1}, b, point, rig);
    expect_all(MonoPointReprojection<double>{pixel0}, b, point, rig);
    expect_all(MonoPointReprojection<double, 1>{pixel1}, b, point, rig);
  }
}

// A residual whose Jacobian is wrong in one entry.
struct Wrong {
  static constexpr std::string_view kName = "test.wrong/1";
  static constexpr int kDim = 2;
  using Variables = Types<Point2d>;
  bool evaluate(const Point2d& x, Vec2d& r, Mat2d* J) const {
    r = {{x.p[0] * x.p[1], x.p[1]}};
    if (J != nullptr) *J = {{x.p[1], 0.01, x.p[0], 1.0}};
    return true;
  }
};

// V10
TEST(CheckJacobian, FindsAWrongEntry) { EXPECT_GT(check_jacobian(Wrong{}, Point2d{{{1.0, 2.0}}}).worst(), 1e-3); }

}  // namespace
}  // namespace oriel
