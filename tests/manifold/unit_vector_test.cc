// Directions: great circles, the basis across them, and the derivative of the way from one to another.
#include "oriel/manifold/unit_vector.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>
#include <random>
#include <vector>

#include "oriel/manifold/jacobian.h"
#include "oriel/manifold/positive.h"

namespace oriel {
namespace {

std::vector<UnitVector3d> directions() {
  std::vector<UnitVector3d> all;
  for (const double a : {-1.0, 0.0, 1e-12, 1.0})
    for (const double b : {-1.0, 0.0, 1e-12, 1.0})
      for (const double c : {-1.0, -1e-12, -0.0, 0.0, 1e-12, 1.0})
        if (std::fabs(a) + std::fabs(b) + std::fabs(c) > 0.5) all.push_back(UnitVector3d::from_vector({{a, b, c}}));
  return all;
}

TEST(UnitVector3, HasAnOrthonormalBasisAcrossEveryDirection) {
  for (const UnitVector3d& x : directions()) {
    const Mat<double, 3, 2> B = x.basis();
    EXPECT_NEAR(B.col(0).dot(B.col(0)), 1.0, 1e-15) << x.v;
    EXPECT_NEAR(B.col(1).dot(B.col(1)), 1.0, 1e-15) << x.v;
    EXPECT_NEAR(B.col(0).dot(B.col(1)), 0.0, 1e-15) << x.v;
    EXPECT_LT(transposed_times(B, x.v).norm(), 1e-15) << x.v;
  }
}

// V3
TEST(UnitVector3, StepsAlongGreatCircles) {
  for (const UnitVector3d& x : directions())
    for (const double angle : {1e-200, 1e-9, 0.2, 0.4999, 0.5001, 1.5, 3.1}) {
      const Vec2d d = {{0.6 * angle, -0.8 * angle}};
      const UnitVector3d y = x.plus(d);
      EXPECT_NEAR(std::atan2(cross(x.v, y.v).norm(), x.v.dot(y.v)), angle, 1e-15 + 1e-14 * angle);
      // A vector's own rounding, which grows as the ways to the opposite side come together: the stretch is θ/sin θ.
      EXPECT_LT((y.minus(x) - d).norm(), 1e-15 * std::max(1.0, angle / std::sin(angle)));
    }
}

TEST(UnitVector3, FindsAWayOfHalfATurnToTheOppositeDirection) {
  for (const UnitVector3d& x : directions()) {
    const UnitVector3d opposite{-x.v};
    const Vec2d d = opposite.minus(x);
    EXPECT_NEAR(d.norm(), std::numbers::pi, 1e-15);
    EXPECT_LT((x.plus(d).v + x.v).norm(), 1e-14);
  }
}

// V3
TEST(UnitVector3, HasTheJacobianOfItsMinusUpToTheOppositeSide) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  for (const double angle : {0.0, 1e-160, 1e-8, 1e-3, 0.19, 0.2, 0.21, 1.0, 1.57, 1.6, 2.9, 3.1})
    for (int i = 0; i < 20; ++i) {
      const auto x = UnitVector3d::from_vector({{normal(random), normal(random), normal(random)}});
      Vec2d d = {{normal(random), normal(random)}};
      d *= angle / d.norm();
      const UnitVector3d y = x.plus(d);
      const Mat2d J = minus_jacobian(y, x);
      const double h = angle > 3.0 ? 1e-4 : 1e-3;
      for (int k = 0; k < 2; ++k) {
        const auto slope = [&](double step) {
          const Vec2d e = Vec2d::unit(k) * step;
          return (y.plus(e).minus(x) - y.plus(-e).minus(x)) * (0.5 / step);
        };
        const Vec2d numeric = slope(0.5 * h) * (4.0 / 3.0) - slope(h) * (1.0 / 3.0);
        EXPECT_LT((J.col(k) - numeric).norm(), 1e-8 * (1.0 + numeric.norm())) << angle;
      }
    }
}

// V4
TEST(Positive, StaysPositiveUnderAnyStep) {
  for (const double d : {-1e308, -1e4, 1e4, 1e308}) {
    const Positived x = Positived{3.0}.plus({{d}}).plus({{d}});
    EXPECT_GT(x.x, 0.0);
    EXPECT_TRUE(std::isfinite(x.x));
  }
  EXPECT_NEAR((Positived{3.0}.plus({{0.1}}).x), 3.0 * std::exp(0.1), 1e-15);
}

}  // namespace
}  // namespace oriel
