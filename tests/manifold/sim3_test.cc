// Similarities against the series of the matrix exponential, and their coefficients where closed forms cancel.
#include "oriel/manifold/sim3.h"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "oriel/manifold/jacobian.h"

namespace oriel {
namespace {

using Tangent = Vec<double, 7>;
using Matrix = Mat<long double, 4, 4>;

// exp of [hat(φ) + λ I, ρ; 0, 0] by its series, after halving it eight times.
Matrix exp_by_series(const Tangent& d) {
  constexpr int kHalvings = 8;
  Matrix a = Matrix::zero();
  const Mat3d W = hat(d.segment<3>(0));
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) a(i, j) = W(i, j);
    a(i, i) = d[6];
    a(i, 3) = d[3 + i];
  }
  a *= std::ldexp(1.0L, -kHalvings);
  Matrix sum = Matrix::identity(), term = sum;
  for (int n = 1; n < 30; ++n) {
    term = term * a * (1.0L / n);
    sum += term;
  }
  for (int i = 0; i < kHalvings; ++i) sum = sum * sum;
  return sum;
}

double deviation(const Sim3d& T, const Matrix& m) {
  const Mat3d sR = T.R.matrix() * T.s;
  double largest = 0.0, scale = 1.0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j) {
      const double expected = static_cast<double>(m(i, j));
      largest = std::max(largest, std::fabs((j < 3 ? sR(i, j) : T.t[i]) - expected));
      scale = std::max(scale, std::fabs(expected));
    }
  return largest / scale;
}

// Every meeting of small and large angles with small and large changes of scale, the thresholds (θ, λ, q = 1/2) too.
template <class F>
void for_each_tangent(F f) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  const double kSizes[] = {0.0, 1e-300, 1e-12, 1e-8, 1e-4, 1e-2, 0.1, 0.3535, 0.4999, 0.5, 0.5001, 0.7, 1.0, 2.0, 3.1};
  for (const double theta : kSizes)
    for (const double size : kSizes)
      for (const double lambda : {size, -size}) {
        Vec3d axis = {{normal(random), normal(random), normal(random)}};
        axis *= theta / axis.norm();
        f(Tangent{{axis[0], axis[1], axis[2], normal(random), normal(random), normal(random), lambda}});
      }
}

// V3
TEST(Sim3, ExpIsTheMatrixExponential) {
  for_each_tangent([](const Tangent& d) { EXPECT_LT(deviation(Sim3d::exp(d), exp_by_series(d)), 2e-15) << d; });
}

// V3
TEST(Sim3, LogIsItsInverse) {
  for_each_tangent([](const Tangent& d) { EXPECT_LT((Sim3d::exp(d).log() - d).norm(), 3e-14) << d; });
}

TEST(Sim3, MapsPointsAsItsMatrixDoes) {
  const Sim3d T = Sim3d::exp({{0.3, -0.2, 0.9, 1.0, 2.0, 3.0, 0.7}}),
              U = Sim3d::exp({{1, 0, -1, 0.5, 0.1, -3.0, -2.0}});
  const Vec3d p = {{4.0, -5.0, 6.0}};
  EXPECT_LT((T * (U * p) - (T * U) * p).norm(), 1e-14 * (T * (U * p)).norm());
  EXPECT_LT((T.inverse() * (T * p) - p).norm(), 1e-14);
  EXPECT_NEAR((T * p - T * Vec3d::zero()).norm(), std::exp(0.7) * p.norm(), 1e-13);
}

TEST(Sim3, AdjointCarriesAStepToTheOtherSide) {
  const Sim3d T = Sim3d::exp({{0.3, -0.2, 0.9, 1.0, 2.0, 3.0, 0.7}});
  const Tangent d = {{0.02, 0.5, -0.1, 0.3, 0.4, -0.7, 0.2}};
  const Sim3d left = T * Sim3d::exp(d) * T.inverse();
  EXPECT_LT(left.minus(Sim3d::exp(adjoint(T) * d)).norm(), 1e-13);
}

// V3: ∂((y ⊞ δ) ⊟ x)/∂δ against differences of fourth order.
TEST(Sim3, HasTheJacobianOfItsMinusEverywhere) {
  constexpr double h = 1e-3;
  for_each_tangent([](const Tangent& e) {
    if (e.segment<3>(0).norm() > 3.0) return;  // the differences would step over half a turn
    const Sim3d x = Sim3d::exp({{0.3, -0.2, 0.9, 1.0, 2.0, 3.0, 0.7}}), y = x.plus(e);
    const Mat<double, 7, 7> J = minus_jacobian(y, x);
    for (int i = 0; i < 7; ++i) {
      const auto slope = [&](double step) {
        const Tangent d = Tangent::unit(i) * step;
        return (y.plus(d).minus(x) - y.plus(-d).minus(x)) * (0.5 / step);
      };
      const Tangent numeric = slope(0.5 * h) * (4.0 / 3.0) - slope(h) * (1.0 / 3.0);
      EXPECT_LT((J.col(i) - numeric).norm(), 1e-9 * (1.0 + numeric.norm())) << "column " << i << " at " << e;
    }
  });
}

TEST(Sim3, KeepsAPositiveScaleUnderAnyStep) {
  for (const double lambda : {-1e4, 1e4, -700.0, 700.0}) {
    Tangent d = Tangent::zero();
    d[6] = lambda;
    Sim3d T;
    for (int i = 0; i < 3; ++i) T = T.plus(d);
    EXPECT_GT(T.scale(), 0.0);
    EXPECT_TRUE(std::isfinite(T.scale()));
  }
}

}  // namespace
}  // namespace oriel
