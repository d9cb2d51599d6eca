// Residuals, losses and noise against their definitions, written down a second time in the plainest way.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "oriel/residual/bal.h"
#include "oriel/residual/between.h"
#include "oriel/residual/loss.h"
#include "oriel/residual/noise.h"
#include "oriel/residual/pose_graph.h"
#include "oriel/residual/prior.h"
#include "oriel/residual/reprojection.h"
#include "random_values.h"

namespace oriel {
namespace {

using testing_values::euroc_like_rig;
using testing_values::Random;

TEST(Loss, IsItsFormula) {
  for (const double s : {0.0, 1e-12, 0.5, 1.0, 1.81, 100.0, 1e8}) {
    for (const double k : {0.5, 1.0, 1.345}) {
      const auto huber = evaluate_loss(LossKind::huber, k, s), cauchy = evaluate_loss(LossKind::cauchy, k, s);
      const double root = std::sqrt(s);
      EXPECT_NEAR(huber.rho, root <= k ? s : 2 * k * root - k * k, 1e-14 * (1 + s));
      EXPECT_NEAR(huber.weight, root <= k ? 1.0 : k / root, 1e-14);
      EXPECT_NEAR(cauchy.rho, k * k * std::log(1 + s / (k * k)), 1e-14 * (1 + s));
      EXPECT_NEAR(cauchy.weight, 1 / (1 + s / (k * k)), 1e-14);
    }
    const auto none = evaluate_loss(LossKind::none, 1.0, s);
    EXPECT_EQ(none.rho, s);
    EXPECT_EQ(none.weight, 1.0);
  }
}

TEST(Loss, HasItsWeightAsSlope) {
  for (const LossKind kind : {LossKind::none, LossKind::huber, LossKind::cauchy})
    for (const double s : {0.3, 0.9, 1.1, 7.0, 300.0}) {
      const double h = 1e-5 * s;
      const double slope = (evaluate_loss(kind, 1.0, s + h).rho - evaluate_loss(kind, 1.0, s - h).rho) / (2 * h);
      EXPECT_NEAR(evaluate_loss(kind, 1.0, s).weight, slope, 1e-8) << name_of(kind) << " at " << s;
    }
}

// L8
TEST(Loss, OfEachRedescendingKindIsItsFormula) {
  constexpr double c = 1.7, c2 = c * c;
  for (const double s : {0.0, 1e-9, 0.4, 2.0, 2.8, 2.95, 40.0, 1e6}) {
    const double tolerance = 1e-13 * (1.0 + s);
    EXPECT_NEAR(evaluate_loss(GemanMcClure(c), s).rho, c2 * s / (c2 + s), tolerance);
    EXPECT_NEAR(evaluate_loss(Tukey(c), s).rho, s < c2 ? c2 / 3.0 * (1.0 - std::pow(1.0 - s / c2, 3)) : c2 / 3.0,
                tolerance);
    EXPECT_NEAR(evaluate_loss(TruncatedSquares(c), s).rho, std::min(s, c2), tolerance);
    const double mu = 0.3, low = c2 * mu / (mu + 1.0), high = c2 * (mu + 1.0) / mu;
    const double between = 2.0 * c * std::sqrt(s * mu * (mu + 1.0)) - mu * (c2 + s);
    EXPECT_NEAR(evaluate_loss(TruncatedSquares(c, mu), s).rho, s <= low ? s : s >= high ? c2 : between, tolerance);
    for (const double alpha : {1.0, 0.5, -1.0, -2.0, -10.0}) {
      const double b = std::fabs(alpha - 2.0),
                   rho = 2.0 * c2 * b / alpha * (std::pow(s / (c2 * b) + 1.0, alpha / 2.0) - 1.0);
      EXPECT_NEAR(evaluate_loss(Barron(c, alpha), s).rho, rho, 1e-12 * (1.0 + s)) << alpha;
    }
  }
}

// L8
TEST(Loss, OfBarronHasTheKnownOnesAsMembers) {
  constexpr double c = 1.3, c2 = c * c;
  for (const double s : {0.0, 1e-6, 0.7, 9.0, 1e4}) {
    EXPECT_DOUBLE_EQ(evaluate_loss(Barron(c, 2.0), s).rho, s);
    // Cauchy's, with another scale; its neighbours are near it: dρ/dα is at most 2c² times the square of the logarithm.
    const double log_u = std::log1p(0.5 * s / c2);
    for (const double alpha : {0.0, 1e-13, -1e-13, 1e-7})
      EXPECT_NEAR(evaluate_loss(Barron(c, alpha), s).rho, 2.0 * c2 * log_u,
                  2.0 * c2 * std::fabs(alpha) * log_u * (1.0 + log_u) + 1e-13 * (1.0 + s));
    const double welsch = 2.0 * c2 * (1.0 - std::exp(-0.5 * s / c2));
    EXPECT_NEAR(evaluate_loss(Barron(c, -std::numeric_limits<double>::infinity()), s).rho, welsch, 1e-12);
    EXPECT_NEAR(evaluate_loss(Barron(c, -1e9), s).rho, welsch, 1e-6 * (1.0 + s));
    EXPECT_NEAR(evaluate_loss(Barron(c, -2.0), s).rho, evaluate_loss(GemanMcClure(2.0 * c), s).rho, 1e-12 * (1.0 + s));
    EXPECT_NEAR(evaluate_loss(TruncatedSquares(c, 1e12), s).rho, evaluate_loss(TruncatedSquares(c), s).rho, 1e-9);
  }
}

// L8
TEST(Loss, OfEachRedescendingKindHasItsWeightAsSlopeAndBeginsAsSquares) {
  for (const Loss& loss :
       {GemanMcClure(1.1), Tukey(1.1), TruncatedSquares(1.1), TruncatedSquares(1.1, 0.2), Barron(1.1, 1.5),
        Barron(1.1, 0.0), Barron(1.1, -3.0), Barron(1.1, -std::numeric_limits<double>::infinity())}) {
    EXPECT_EQ(evaluate_loss(loss, 0.0).rho, 0.0) << name_of(loss.kind);
    EXPECT_EQ(evaluate_loss(loss, 0.0).weight, 1.0) << name_of(loss.kind);
    for (const double s : {0.3, 0.9, 1.15, 7.0, 300.0}) {
      const double h = 1e-5 * s, slope = (evaluate_loss(loss, s + h).rho - evaluate_loss(loss, s - h).rho) / (2 * h);
      EXPECT_NEAR(evaluate_loss(loss, s).weight, slope, 1e-8) << name_of(loss.kind) << " at " << s;
      EXPECT_GE(evaluate_loss(loss, s).weight, 0.0);
    }
  }
}

TEST(Prior, IsNamedAfterItsVariable) {
  EXPECT_EQ(Prior<Pose3d>::kName, "prior/1(pose3/1)");
  EXPECT_EQ(Between<Pose2d>::kName, "between/1(pose2/1)");
  EXPECT_EQ(Prior<Pose3<Pack>>::kName, Prior<Pose3d>::kName);
}

TEST(Between, IsZeroAtItsMeasurement) {
  Random random(3);
  const Pose3d a = random.value<Pose3d>(1.0), z = random.value<Pose3d>(1.0);
  Vec6d r;
  ASSERT_TRUE(Between{z}.evaluate(a, a * z, r, nullptr, nullptr));
  EXPECT_LT(r.norm(), 1e-14);
}

TEST(PoseGraphEdge3, IsTranslationAndQuaternionVectorOfTheErrorPose) {
  Random random(4);
  for (int i = 0; i < 20; ++i) {
    const Pose3d a = random.value<Pose3d>(1.0), b = random.value<Pose3d>(1.0), z = random.value<Pose3d>(1.0);
    Vec6d r;
    ASSERT_TRUE(PoseGraphEdge3<double>{z}.evaluate(a, b, r, nullptr, nullptr));
    const Pose3d E = z.inverse() * a.inverse() * b;
    const Vec3d phi = E.R.log();  // its angle is at most π, so sin(θ/2) is the vector part with w ≥ 0
    const double angle = phi.norm();
    EXPECT_LT((r.segment<3>(0) - E.t).norm(), 1e-13);
    EXPECT_LT((r.segment<3>(3) - phi * (std::sin(0.5 * angle) / angle)).norm(), 1e-13);
  }
}

TEST(PoseGraphEdge2, WrapsTheAngle) {
  constexpr double kPi = std::numbers::pi;
  const Pose2d a{Rot2d::exp(3.0), {{1, 2}}}, b{Rot2d::exp(-3.0), {{2, 2}}}, z{Rot2d::exp(0.1), {{0.5, -0.5}}};
  Vec3d r;
  ASSERT_TRUE(PoseGraphEdge2<double>{z}.evaluate(a, b, r, nullptr, nullptr));
  EXPECT_NEAR(r[2], -6.1 + 2 * kPi, 1e-14);
  // R_aᵀ (t_b - t_a) with t_b - t_a = (1, 0), less t_z, turned by -0.1.
  const double ex = std::cos(3.0) - 0.5, ey = -std::sin(3.0) + 0.5;
  EXPECT_NEAR(r[0], std::cos(0.1) * ex + std::sin(0.1) * ey, 1e-14);
  EXPECT_NEAR(r[1], -std::sin(0.1) * ex + std::cos(0.1) * ey, 1e-14);
}

TEST(BalReprojection, IsItsDefinition) {
  const Vec<double, 9> file = {{0.3, -0.2, 0.5, 1.0, 2.0, -3.0, 520.0, -0.1, 0.03}};
  const Point3d X{{{0.4, -0.7, -9.0}}};
  // Rodrigues: R X = X cos θ + (k × X) sin θ + k (k·X)(1 - cos θ).
  const Vec3d axis = file.segment<3>(0);
  const double angle = axis.norm();
  const Vec3d k = axis / angle;
  const Vec3d P = X.p * std::cos(angle) + cross(k, X.p) * std::sin(angle) + k * (k.dot(X.p) * (1 - std::cos(angle))) +
                  file.segment<3>(3);
  const double px = -P[0] / P[2], py = -P[1] / P[2], s = px * px + py * py;
  const double scale = 520.0 * (1.0 - 0.1 * s + 0.03 * s * s);
  Vec2d r;
  const BalCamerad camera = BalCamerad::from_file(file);
  const BalReprojection<double> residual{Vec2d{{10.0, 20.0}}};
  ASSERT_TRUE(residual.evaluate(camera, X, r, nullptr, nullptr));
  EXPECT_NEAR(r[0], scale * px - 10.0, 1e-11);
  EXPECT_NEAR(r[1], scale * py - 20.0, 1e-11);
  EXPECT_LT((camera.to_file() - file).norm(), 1e-14);
}

// The chain of poses as one would write it on paper.
Vec2d pixel_of(const StereoRigd& rig, int camera, const Pose3d& T_world_body, const Vec3d& p_world) {
  const Pose3d T_world_camera = T_world_body * rig.cameras[camera].T_body_camera();
  Vec2d pixel;
  EXPECT_TRUE(rig.cameras[camera].camera.project(T_world_camera.inverse() * p_world, pixel, nullptr));
  return pixel;
}

TEST(Reprojection, OfAnInverseDepthIsThatOfThePointBehindIt) {
  Random random(5);
  const StereoRigd rig = euroc_like_rig();
  const Pose3d a = random.value<Pose3d>(1.0), b = a.plus(random.normal<6>(0.1));
  const Vec2d bearing = {{0.21, -0.13}}, zero = Vec2d::zero();
  const InverseDepthd depth{0.4};
  const Vec3d p_world = a * rig.cameras[0].T_body_camera() * Vec3d{{bearing[0] / 0.4, bearing[1] / 0.4, 1 / 0.4}};
  Vec<double, 4> r;
  ASSERT_TRUE(
      (StereoReprojection<double>{bearing, zero, zero}.evaluate(a, b, depth, rig, r, nullptr, nullptr, nullptr)));
  EXPECT_LT((r.segment<2>(0) - pixel_of(rig, 0, b, p_world)).norm(), 1e-10);
  EXPECT_LT((r.segment<2>(2) - pixel_of(rig, 1, b, p_world)).norm(), 1e-10);
  Vec2d r2;
  ASSERT_TRUE((MonoReprojection<double, 1>{bearing, zero}.evaluate(a, b, depth, rig, r2, nullptr, nullptr, nullptr)));
  EXPECT_LT((r2 - r.segment<2>(2)).norm(), 1e-10);
  ASSERT_TRUE((AnchorReprojection<double>{bearing, zero}.evaluate(depth, rig, r2, nullptr)));
  EXPECT_LT((r2 - pixel_of(rig, 1, a, p_world)).norm(), 1e-10);
  ASSERT_TRUE((StereoPointReprojection<double>{zero, zero}.evaluate(b, Point3d{p_world}, rig, r, nullptr, nullptr)));
  EXPECT_LT((r.segment<2>(0) - pixel_of(rig, 0, b, p_world)).norm(), 1e-10);
  EXPECT_LT((r.segment<2>(2) - pixel_of(rig, 1, b, p_world)).norm(), 1e-10);
}

TEST(Reprojection, IsInvalidBehindTheCameraAndTooCloseToIt) {
  const StereoRigd rig = euroc_like_rig();
  const Pose3d body;
  const Pose3d T_body_camera = rig.cameras[0].T_body_camera();
  Vec2d r;
  for (const double z : {-5.0, -1e-3, 0.0, 0.5 * kLeastDepth}) {
    const Point3d point{T_body_camera * Vec3d{{0.01 * z, 0.0, z}}};
    EXPECT_FALSE((MonoPointReprojection<double>{Vec2d::zero()}.evaluate(body, point, rig, r, nullptr, nullptr))) << z;
  }
  const Point3d near_enough{T_body_camera * Vec3d{{0.0, 0.0, 1.01 * kLeastDepth}}};
  EXPECT_TRUE((MonoPointReprojection<double>{Vec2d::zero()}.evaluate(body, near_enough, rig, r, nullptr, nullptr)));
  // The anchor sees it, but the body has moved past it.
  const Pose3d past = body * Pose3d{{}, T_body_camera.R * Vec3d{{0.0, 0.0, 4.0}}};
  const MonoReprojection<double> residual{Vec2d::zero(), Vec2d::zero()};
  EXPECT_TRUE((residual.evaluate(body, past, InverseDepthd{0.2}, rig, r, nullptr, nullptr, nullptr)));
  EXPECT_FALSE((residual.evaluate(body, past, InverseDepthd{0.3}, rig, r, nullptr, nullptr, nullptr)));
}

}  // namespace
}  // namespace oriel
