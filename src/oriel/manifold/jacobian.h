// Jacobians that every manifold has: of y ⊟ x, and the adjoint of the groups. All are over any scalar.
#pragma once
#include "oriel/manifold/bal_camera.h"
#include "oriel/manifold/dual.h"
#include "oriel/manifold/inverse_depth.h"
#include "oriel/manifold/se2.h"
#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"

namespace oriel {

// Types that are vectors: plus adds, minus subtracts.
template <class V>
inline constexpr bool kAdditive = false;
template <class S>
inline constexpr bool kAdditive<Point3<S>> = true;
template <class S>
inline constexpr bool kAdditive<Point2<S>> = true;
template <class S>
inline constexpr bool kAdditive<Velocity3<S>> = true;
template <class S>
inline constexpr bool kAdditive<ImuBias<S>> = true;
template <class S, int N>
inline constexpr bool kAdditive<VectorN<S, N>> = true;

// The scalar that a variable is over.
template <class V>
using ScalarOf = typename decltype(std::declval<const V&>().minus(std::declval<const V&>()))::Scalar;

// Ad(R) of rotations (those of poses stand in se2.h and se3.h). [ML] eq. 139.
template <class S>
Mat<S, 3, 3> adjoint(const Rot3<S>& R) {
  return R.matrix();
}
template <class S>
Mat<S, 1, 1> adjoint(const Rot2<S>&) {
  return {{S(1.0)}};
}

// ∂((y ⊞ δ) ⊟ x)/∂δ at δ = 0, where e = y ⊟ x. An overload here (or in a user's namespace) makes priors and betweens of
// the type analytic; y, x decide the type, and e is handed over because whoever asks has it already.
template <class S>
Mat<S, 3, 3> analytic_minus_jacobian(const Rot3<S>&, const Rot3<S>&, const Vec<S, 3>& e) {
  return inverse_right_jacobian_so3(e);
}
template <class S>
Mat<S, 6, 6> analytic_minus_jacobian(const Pose3<S>&, const Pose3<S>&, const Vec<S, 6>& e) {
  return inverse_right_jacobian_se3(e);
}
template <class S>
Mat<S, 1, 1> analytic_minus_jacobian(const Rot2<S>&, const Rot2<S>&, const Vec<S, 1>&) {
  return {{S(1.0)}};
}
template <class S>
Mat<S, 3, 3> analytic_minus_jacobian(const Pose2<S>&, const Pose2<S>&, const Vec<S, 3>& e) {
  return inverse_right_jacobian_se2(e);
}
template <class S>
Mat<S, 9, 9> analytic_minus_jacobian(const BalCamera<S>&, const BalCamera<S>&, const Vec<S, 9>& e) {
  Mat<S, 9, 9> J = Mat<S, 9, 9>::identity();
  J.set_block(0, 0, inverse_right_jacobian_so3(e.template segment<3>(0)));
  return J;
}
// The derivative of the logarithmic branch of InverseDepth's minus; plus has slope 1 at zero.
template <class S>
Mat<S, 1, 1> analytic_minus_jacobian(const InverseDepth<S>& y, const InverseDepth<S>& x, const Vec<S, 1>&) {
  const S half = x.rho * S(0.5);
  return {{select(y.rho >= half, S(1.0), half / y.rho)}};
}
template <class V>
requires(kAdditive<V>) Mat<ScalarOf<V>, V::kDim, V::kDim> analytic_minus_jacobian(const V&, const V&,
                                                                                  const Vec<ScalarOf<V>, V::kDim>&) {
  return Mat<ScalarOf<V>, V::kDim, V::kDim>::identity();
}

template <class V>
concept AnalyticMinus = requires(const V y, const V x) {
  analytic_minus_jacobian(y, x, y.minus(x));
};

// A Lie group: minus is Log(x⁻¹ y).
template <class V>
concept Group = requires(const V a, const V b) {
  { a* b } -> std::same_as<V>;
  { a.inverse() } -> std::same_as<V>;
};

// The same for any variable: analytic, else by dual numbers, else by central differences.
template <Manifold V>
Mat<double, V::kDim, V::kDim> minus_jacobian(const V& y, const V& x) {
  constexpr int n = V::kDim;
  if constexpr (AnalyticMinus<V>) {
    return analytic_minus_jacobian(y, x, y.minus(x));
  } else if constexpr (Rebindable<V>) {
    Vec<Dual<n>, n> d;
    for (int i = 0; i < n; ++i) d[i] = Dual<n>::variable(0.0, i);
    const auto e = cast<Dual<n>>(y).plus(d).minus(cast<Dual<n>>(x));
    Mat<double, n, n> J;
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) J(i, j) = e[i].d[j];
    return J;
  } else {
    constexpr double h = 1e-6;
    Mat<double, n, n> J;
    for (int j = 0; j < n; ++j) {
      const Vec<double, n> d = Vec<double, n>::unit(j) * h;
      J.set_block(0, j, (y.plus(d).minus(x) - y.plus(-d).minus(x)) * (0.5 / h));
    }
    return J;
  }
}

}  // namespace oriel
