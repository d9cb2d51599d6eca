// Prior: a variable was measured directly. r = x ⊟ value (kDim × 1), in the units of the tangent.
#pragma once
#include "oriel/manifold/jacobian.h"
#include "oriel/manifold/name.h"
#include "oriel/manifold/rebind.h"
#include "oriel/residual/linearize_rows.h"
#include "oriel/residual/residual.h"

namespace oriel {

namespace detail {
struct PriorName {
  static constexpr std::string_view kName = "prior/1";
};
}  // namespace detail

// Prior{Pose3d{}} is attached to one Pose3d. It is analytic for the shipped manifolds; for a user's it is found by dual
// numbers or central differences, unless there is an analytic_minus_jacobian (manifold/jacobian.h).
template <class V>
struct Prior {
  static constexpr std::string_view kName = ComposedName<detail::PriorName, V>::kName;
  static constexpr int kDim = V::kDim;
  using Variables = Types<over_scalar_t<double, V>>;
  template <class T>
  using rebind = Prior<over_scalar_t<T, V>>;
  using Scalar = ScalarOf<V>;

  V value;

  Valid<Scalar> evaluate(const V& x, Vec<Scalar, kDim>& r, Mat<Scalar, kDim, kDim>* J) const
      requires(AnalyticMinus<V>) {
    r = x.minus(value);
    if (J != nullptr) *J = analytic_minus_jacobian(x, value, r);
    return always_valid<Scalar>();
  }
  template <class W>
  requires(!AnalyticMinus<V>) auto operator()(const W& x) const {
    if constexpr (std::is_same_v<W, V>)
      return x.minus(value);
    else
      return x.minus(cast<ScalarOf<W>>(value));
  }
};
template <class V>
Prior(V) -> Prior<V>;

// Compiled once, in the library; with other values or noise they are compiled where they are used.
extern template void linearize_rows<Prior<Pose2d>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Prior<Pose2d>, DiagonalNoise<3>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Prior<Pose2d>, FullNoise<3>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Prior<Pose3d>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Prior<Pose3d>, DiagonalNoise<6>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Prior<Pose3d>, FullNoise<6>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Prior<Velocity3d>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Prior<Velocity3d>, DiagonalNoise<3>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Prior<ImuBiasd>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Prior<ImuBiasd>, DiagonalNoise<6>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Prior<Point3d>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Prior<Point3d>, DiagonalNoise<3>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
