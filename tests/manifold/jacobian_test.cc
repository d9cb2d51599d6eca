#include "oriel/manifold/jacobian.h"

#include <gtest/gtest.h>

#include <random>

namespace oriel {
namespace {

// Jacobian of f at δ = 0 by dual numbers: f takes Vec<Dual, N> to Vec<Dual, M>.
template <int M, int N, class F>
Mat<double, M, N> dual_jacobian(F f) {
  Vec<Dual<N>, N> d;
  for (int i = 0; i < N; ++i) d[i] = Dual<N>::variable(0.0, i);
  const Vec<Dual<N>, M> e = f(d);
  Mat<double, M, N> J;
  for (int j = 0; j < N; ++j)
    for (int i = 0; i < M; ++i) J(i, j) = e[i].d[j];
  return J;
}
// The same by central differences with one step of extrapolation; f over double.
template <int M, int N, class F>
Mat<double, M, N> numeric_jacobian(F f, double h) {
  Mat<double, M, N> J;
  for (int j = 0; j < N; ++j) {
    const Vec<double, N> d = Vec<double, N>::unit(j) * h, half = d * 0.5;
    J.set_block(0, j, (f(half) - f(-half)) * (4.0 / (3.0 * h)) - (f(d) - f(-d)) * (1.0 / (6.0 * h)));
  }
  return J;
}

template <int R, int C>
double distance(const Mat<double, R, C>& a, const Mat<double, R, C>& b) {
  return (a - b).norm() / (1.0 + a.norm());
}

template <class V>
Vec<double, V::kDim> tangent(double norm, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Vec<double, V::kDim> d;
  for (int i = 0; i < V::kDim; ++i) d[i] = normal(random);
  return d * (norm / d.norm());
}

// Norms of y ⊟ x: the identity, below and above every threshold between series and closed forms, near half a turn.
constexpr double kNorms[] = {0.0, 1e-160, 1e-8, 1e-5, 1e-3, 0.3, 0.4999, 0.5001, 1.0, 2.0, 3.0, 3.14};

template <class V>
void expect_minus_jacobian(double largest, double tolerance) {
  constexpr int n = V::kDim;
  for (unsigned seed = 0; seed < 5; ++seed)
    for (const double norm : kNorms) {
      if (norm > largest) continue;
      const V x = V{}.plus(tangent<V>(0.5, seed + 100)), y = x.plus(tangent<V>(norm, seed));
      const auto J = minus_jacobian(y, x);
      const auto dual = dual_jacobian<n, n>([&](const auto& d) {
        using S = Dual<n>;
        return cast<S>(y).plus(d).minus(cast<S>(x));
      });
      const auto numeric = numeric_jacobian<n, n>([&](const auto& d) { return y.plus(d).minus(x); }, 1e-3);
      EXPECT_LT(distance(J, dual), tolerance) << V::kName << " at norm " << norm;
      EXPECT_LT(distance(J, numeric), 1e-8) << V::kName << " at norm " << norm;
    }
}

// V3
TEST(MinusJacobian, AgreesWithDualAndNumericOnesFromIdentityToNearHalfATurn) {
  expect_minus_jacobian<Rot2d>(3.1, 1e-13);
  expect_minus_jacobian<Pose2d>(3.1, 1e-13);
  expect_minus_jacobian<Rot3d>(3.1, 1e-12);
  expect_minus_jacobian<Pose3d>(3.1, 1e-12);
  expect_minus_jacobian<BalCamerad>(3.1, 1e-12);
  expect_minus_jacobian<Point3d>(10.0, 1e-13);
  expect_minus_jacobian<ImuBiasd>(10.0, 1e-13);
  expect_minus_jacobian<InverseDepthd>(0.3, 1e-13);
}

// V3
TEST(MinusJacobian, OfInverseDepthIsRightOnBothBranches) {
  for (const double rho : {0.01, 0.1, 0.2499, 0.2501, 0.5, 3.0}) {
    const InverseDepthd x{0.5}, y{rho};
    const auto numeric = numeric_jacobian<1, 1>([&](const Vec1d& d) { return y.plus(d).minus(x); }, 1e-6);
    EXPECT_NEAR(minus_jacobian(y, x)(0, 0), numeric(0, 0), 1e-6 * numeric(0, 0)) << rho;
  }
}

// A user's manifold without another scalar: the Jacobian comes from differences.
struct Angle {
  static constexpr std::string_view kName = "test.angle/1";
  static constexpr int kDim = 1;
  double a = 0.0;
  Angle plus(const Vec1d& d) const { return {a + 2.0 * d[0]}; }
  Vec1d minus(const Angle& x) const { return {{std::remainder(a - x.a, 6.283185307179586) * 0.5}}; }
};

TEST(MinusJacobian, ExistsForATypeThatHasNoOtherScalar) {
  EXPECT_NEAR(minus_jacobian(Angle{0.3}, Angle{0.1})(0, 0), 1.0, 1e-9);
}

// The derivative of exp is Jr: Exp(d)⁻¹ Exp(d + δ) ≈ Exp(Jr δ), so Jr⁻¹ times it must be the identity.
template <class V, class InverseJacobian>
void expect_exp_jacobian(InverseJacobian inverse_right_jacobian) {
  constexpr int n = V::kDim;
  for (unsigned seed = 0; seed < 5; ++seed)
    for (const double norm : {0.0, 1e-8, 1e-3, 0.3, 0.55, 1.0, 2.0, 3.1}) {
      const Vec<double, n> d = tangent<V>(norm, seed);
      const V back = V::exp(d).inverse();
      const auto Jr = numeric_jacobian<n, n>([&](const auto& e) { return (back * V::exp(d + e)).minus(V{}); }, 1e-3);
      const auto product = inverse_right_jacobian(d) * Jr, one = Mat<double, n, n>::identity();
      EXPECT_LT(distance(one, product), 1e-8) << V::kName << " at norm " << norm;
    }
}

// V3
TEST(ExpJacobian, IsInvertedByTheInverseRightJacobian) {
  expect_exp_jacobian<Rot3d>([](const Vec3d& d) { return inverse_right_jacobian_so3(d); });
  expect_exp_jacobian<Pose3d>([](const Vec6d& d) { return inverse_right_jacobian_se3(d); });
  expect_exp_jacobian<Pose2d>([](const Vec3d& d) { return inverse_right_jacobian_se2(d); });
}

// V3
TEST(ExpJacobian, OfRotationsIsTheRightJacobian) {
  for (const double norm : kNorms) {
    const Vec3d d = tangent<Rot3d>(norm, 7);
    const Mat3d product = right_jacobian_so3(d) * inverse_right_jacobian_so3(d), one = Mat3d::identity();
    EXPECT_LT(distance(one, product), 1e-13) << norm;
  }
}

// V3: the Jacobian of x ⊞ d by d is Jr(d), seen from x ⊞ d.
TEST(PlusJacobian, IsTheRightJacobianAtTheStep) {
  const Pose3d x = Pose3d::exp({{0.3, -0.2, 0.9, 1, 2, 3}});
  for (unsigned seed = 0; seed < 5; ++seed) {
    const Vec6d d = tangent<Pose3d>(1.5, seed);
    const Pose3d y = x.plus(d);
    const Mat6d J = numeric_jacobian<6, 6>([&](const Vec6d& e) { return x.plus(d + e).minus(y); }, 1e-3);
    EXPECT_LT(distance(Mat6d::identity(), inverse_right_jacobian_se3(d) * J), 1e-8);
  }
}

template <class V>
void expect_adjoint_moves_a_step_through() {
  for (unsigned seed = 0; seed < 5; ++seed) {
    const V T = V::exp(tangent<V>(2.0, seed));
    const auto d = tangent<V>(0.4, seed + 50);
    EXPECT_LT((T * V::exp(d) * T.inverse()).minus(V::exp(adjoint(T) * d)).norm(), 1e-14) << V::kName;
  }
}

TEST(Adjoint, MovesAStepFromTheRightToTheLeft) {
  expect_adjoint_moves_a_step_through<Rot3d>();
  expect_adjoint_moves_a_step_through<Pose3d>();
  expect_adjoint_moves_a_step_through<Pose2d>();
}

}  // namespace
}  // namespace oriel
