#include "oriel/manifold/laws.h"

#include <gtest/gtest.h>

#include <numbers>

#include "oriel/manifold/jacobian.h"
#include "oriel/manifold/positive.h"
#include "oriel/manifold/sim3.h"
#include "oriel/manifold/unit_vector.h"

namespace oriel {
namespace {

constexpr double kPi = std::numbers::pi;

template <class V>
void expect_laws(const LawOptions& options) {
  const auto violations = check_manifold_laws<V>(options);
  EXPECT_TRUE(violations.empty()) << V::kName << ": " << violations.front();
}

// V3
TEST(ManifoldLaws, HoldForEveryShippedManifold) {
  expect_laws<Point3d>({});
  expect_laws<Point2d>({});
  expect_laws<Velocity3d>({});
  expect_laws<ImuBiasd>({});
  expect_laws<VectorNd<1>>({});
  expect_laws<VectorNd<9>>({});
  expect_laws<Rot2d>({});
  expect_laws<Pose2d>({});
  expect_laws<Rot3d>({});
  expect_laws<Pose3d>({});
  expect_laws<BalCamerad>({});
  expect_laws<InverseDepthd>({.radius = 0.9});
  expect_laws<Sim3d>({});
  expect_laws<UnitVector3d>({});
  expect_laws<Positived>({.radius = 20.0});
}

// V3
TEST(ManifoldLaws, HoldForRotationsUpToHalfATurn) {
  expect_laws<Rot2d>({.radius = kPi, .tolerance = 1e-12});
  expect_laws<Pose2d>({.radius = kPi, .tolerance = 1e-10});
  expect_laws<Rot3d>({.radius = kPi, .tolerance = 1e-12});
  expect_laws<Pose3d>({.radius = kPi, .tolerance = 1e-10});
  expect_laws<Sim3d>({.radius = kPi, .tolerance = 1e-10});
  expect_laws<UnitVector3d>({.radius = kPi, .tolerance = 1e-10, .points = 2000});
}

// V3
TEST(ManifoldLaws, HoldWithinAHairOfHalfATurn) {
  for (const double gap : {1e-3, 1e-6, 1e-9, 1e-12}) {
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3d d = Vec3d::unit(axis) * (kPi - gap);
      const Rot3d x = Rot3d::exp({{0.3, -1.2, 2.0}});
      EXPECT_LT((x.plus(d).minus(x) - d).norm(), 1e-14) << "axis " << axis << " gap " << gap;
    }
  }
}

// A manifold that breaks its laws: minus forgets the second component.
struct Broken {
  static constexpr std::string_view kName = "test.broken/1";
  static constexpr int kDim = 2;
  double x = 0.0, y = 0.0;
  Broken plus(const Vec2d& d) const { return {x + d[0], y + d[1]}; }
  Vec2d minus(const Broken& o) const { return {{x - o.x, 0.0}}; }
};

TEST(ManifoldLaws, NamesTheLawThatABrokenManifoldBreaks) {
  const auto violations = check_manifold_laws<Broken>();
  ASSERT_FALSE(violations.empty());
  EXPECT_EQ(violations.front().law, "(x ⊞ d) ⊟ x = d");
  EXPECT_GT(violations.front().deviation, 1e-9);
}

double orthonormality_error(const Mat3d& R) {
  const Mat3d e = R.transposed() * R - Mat3d::identity();
  return e.norm();
}

// V3
TEST(Manifolds, KeepTheirInvariantsThroughAHundredThousandUpdates) {
  Rot3d R;
  Pose3d T;
  Pose2d P;
  Sim3d S;
  UnitVector3d v;
  Positived x;
  double least = 1.0;
  for (int i = 0; i < 100000; ++i) {
    const double s = 0.1 + 1e-6 * i;
    R = R.plus({{s, -0.5 * s, 0.3}});
    T = T.plus({{s, -0.5 * s, 0.3, 0.1, 0.0, -0.1}});
    P = P.plus({{s, 0.1, -0.1}});
    S = S.plus({{s, -0.5 * s, 0.3, 0.1, 0.0, -0.1, i % 1000 < 500 ? 0.9 : -0.91}});
    v = v.plus({{s, -3.0 * s}});
    x = x.plus({{i % 1000 < 500 ? 9.0 : -11.0}});
    least = std::min({least, S.s, x.x});
  }
  EXPECT_LT(orthonormality_error(R.matrix()), 1e-10);
  EXPECT_LT(orthonormality_error(T.R.matrix()), 1e-10);
  EXPECT_NEAR(P.R.c * P.R.c + P.R.s * P.R.s, 1.0, 1e-10);
  EXPECT_LT(orthonormality_error(S.R.matrix()), 1e-10);
  EXPECT_NEAR(v.v.norm(), 1.0, 1e-14);
  EXPECT_GT(least, 0.0);
  EXPECT_TRUE(std::isfinite(S.s) && std::isfinite(x.x));
}

TEST(Rotations, ComeBackFromTheirMatrix) {
  for (const Vec3d phi :
       {Vec3d{{0, 0, 0}}, Vec3d{{3.1, 0, 0}}, Vec3d{{0, -3.1, 0.1}}, Vec3d{{0.1, 0, 3.14}}, Vec3d{{1, 2, -1}}}) {
    const Rot3d R = Rot3d::exp(phi);
    EXPECT_LT(Rot3d::from_matrix(R.matrix()).minus(R).norm(), 1e-14);
  }
}

}  // namespace
}  // namespace oriel
