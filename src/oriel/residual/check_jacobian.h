// Are a residual's Jacobians right? For users' tests as for ours: it knows nothing of any test framework.
//
//   JacobianCheck check = check_jacobian(MyResidual{...}, pose, point);
//   EXPECT_LT(check.worst(), 1e-7) << check;
#pragma once
#include <algorithm>
#include <cmath>
#include <limits>
#include <ostream>

#include "oriel/residual/differentiate.h"

namespace oriel {

// Largest |difference| / (1 + largest |entry|) between Jacobians found in different ways; 0 where a way does not exist
// for this residual (no analytic form, or no form over another scalar).
struct JacobianCheck {
  bool valid = false;                 // the residual is valid at these values; else nothing was compared
  double analytic_and_dual = 0.0;     // both exact: expect rounding, below 1e-10
  double analytic_and_numeric = 0.0;  // differences of fourth order: expect below 1e-8
  double dual_and_numeric = 0.0;

  double worst() const {
    return valid ? std::max({analytic_and_dual, analytic_and_numeric, dual_and_numeric})
                 : std::numeric_limits<double>::infinity();
  }
};

inline std::ostream& operator<<(std::ostream& out, const JacobianCheck& c) {
  if (!c.valid) return out << "not valid at these values";
  return out << "analytic-dual " << c.analytic_and_dual << ", analytic-numeric " << c.analytic_and_numeric
             << ", dual-numeric " << c.dual_and_numeric;
}

namespace detail {

// An analytic residual over dual numbers: its values alone are used, their derivatives are the Jacobian.
template <class R, class... V>
concept DualOfAnalytic = AnalyticResidual<R> && Rebindable<R> &&(Rebindable<V>&&...);

template <class R, std::size_t... I, class... V>
bool evaluate_dual_of_analytic(const R& residual, Mat<double, ResidualTraits<R>::kDim, ResidualTraits<R>::kCols>& j,
                               std::index_sequence<I...>, const V&... x) {
  using T = ResidualTraits<R>;
  using S = Dual<T::kCols>;
  Vec<S, T::kDim> r;
  const auto values = std::make_tuple(seed<T::kCols>(x, T::column(I))...);
  const auto no_jacobians =
      std::tuple_cat(std::conditional_t<(V::kDim > 0), std::tuple<std::nullptr_t>, std::tuple<>>{}...);
  const auto dual_residual = cast<S>(residual);
  const bool valid = std::apply(
      [&](auto... null) { return dual_residual.evaluate(std::get<I>(values)..., r, null...); }, no_jacobians);
  Vec<double, T::kDim> unused;
  for (int i = 0; i < T::kDim; ++i) take(r[i], i, unused, j);
  return valid;
}

template <int R, int C>
double deviation(const Mat<double, R, C>& a, const Mat<double, R, C>& b) {
  double largest = 0.0, scale = 0.0;
  for (int i = 0; i < R * C; ++i) {
    const double d = std::fabs(a.m[i] - b.m[i]);
    if (!(d <= largest)) largest = d;  // keeps a NaN
    scale = std::max({scale, std::fabs(a.m[i]), std::fabs(b.m[i])});
  }
  return std::isfinite(largest) ? largest / (1.0 + scale) : std::numeric_limits<double>::infinity();
}

}  // namespace detail

// `step` is that of the central differences, taken at step and step/2 and extrapolated (Richardson), in units of the
// tangent.
template <Residual R, class... V>
JacobianCheck check_jacobian(const R& residual, double step, const V&... x) {
  using T = ResidualTraits<R>;
  JacobianCheck check;
  Vec<double, T::kDim> r;
  Mat<double, T::kDim, T::kCols> given, coarse, fine, dual;
  check.valid = evaluate_residual(residual, r, &given, x...) &&
                differentiate_numerically(residual, coarse, step, x...) &&
                differentiate_numerically(residual, fine, 0.5 * step, x...);
  if (!check.valid) return check;
  const auto numeric = fine * (4.0 / 3.0) - coarse * (1.0 / 3.0);
  if constexpr (AnalyticResidual<R>) check.analytic_and_numeric = detail::deviation(given, numeric);
  if constexpr (DualResidual<R>) check.dual_and_numeric = detail::deviation(given, numeric);
  if constexpr (detail::DualOfAnalytic<R, V...>) {
    check.valid = detail::evaluate_dual_of_analytic(residual, dual, std::make_index_sequence<T::kArity>{}, x...);
    check.analytic_and_dual = detail::deviation(given, dual);
    check.dual_and_numeric = detail::deviation(dual, numeric);
  }
  return check;
}
template <Residual R, class... V>
requires(Variable<V>&&...) JacobianCheck check_jacobian(const R& residual, const V&... x) {
  return check_jacobian(residual, 1e-3, x...);
}

}  // namespace oriel
