// Between: the motion from one variable to another was measured.
#pragma once
#include "oriel/manifold/jacobian.h"
#include "oriel/manifold/name.h"
#include "oriel/manifold/rebind.h"
#include "oriel/residual/linearize_rows.h"
#include "oriel/residual/residual.h"

namespace oriel {

namespace detail {
struct BetweenName {
  static constexpr std::string_view kName = "between/1";
};
template <class V>
concept AnalyticGroup = Group<V> && AnalyticMinus<V> && requires(const V a) {
  adjoint(a);
};
}  // namespace detail

// Groups:  r = (a⁻¹ b) ⊟ measured = Log(measured⁻¹ a⁻¹ b), so J_b = Jr⁻¹(r) and J_a = -Jr⁻¹(r) Ad(b⁻¹ a), because
//          a⁻¹ moved by Exp(-δ) on its left is b's motion by Exp(-Ad(b⁻¹ a) δ) on the right ([ML] eq. 20, 30).
// Vectors: r = b - a - measured.
// kDim × 1, in the units of the tangent. A user's group (operator*, inverse) is differentiated by dual numbers.
template <class V>
struct Between {
  static_assert(Group<V> || kAdditive<V>, "Between needs a group (operator* and inverse) or a vector");
  static constexpr std::string_view kName = ComposedName<detail::BetweenName, V>::kName;
  static constexpr int kDim = V::kDim;
  using Variables = Types<over_scalar_t<double, V>, over_scalar_t<double, V>>;
  template <class T>
  using rebind = Between<over_scalar_t<T, V>>;
  using Scalar = ScalarOf<V>;
  using Jacobian = Mat<Scalar, kDim, kDim>;

  V measured;  // a⁻¹ b, or b - a

  Valid<Scalar> evaluate(const V& a, const V& b, Vec<Scalar, kDim>& r, Jacobian* J_a, Jacobian* J_b) const
      requires(kAdditive<V>) {
    r = b.minus(a) - measured.minus(V{});
    if (J_a != nullptr) {
      *J_a = -Jacobian::identity();
      *J_b = Jacobian::identity();
    }
    return always_valid<Scalar>();
  }
  Valid<Scalar> evaluate(const V& a, const V& b, Vec<Scalar, kDim>& r, Jacobian* J_a, Jacobian* J_b) const
      requires(detail::AnalyticGroup<V>) {
    const V ab = a.inverse() * b;
    r = ab.minus(measured);
    if (J_a != nullptr) {
      *J_b = analytic_minus_jacobian(ab, measured, r);
      *J_a = -(*J_b * adjoint(ab.inverse()));
    }
    return always_valid<Scalar>();
  }
  template <class W>
  requires(!detail::AnalyticGroup<V> && !kAdditive<V>) auto operator()(const W& a, const W& b) const {
    if constexpr (std::is_same_v<W, V>)
      return (a.inverse() * b).minus(measured);
    else
      return (a.inverse() * b).minus(cast<ScalarOf<W>>(measured));
  }
};
template <class V>
Between(V) -> Between<V>;

// Compiled once, in the library; with other values or noise they are compiled where they are used.
extern template void linearize_rows<Between<Pose2d>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Between<Pose2d>, DiagonalNoise<3>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Between<Pose2d>, FullNoise<3>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Between<Pose3d>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Between<Pose3d>, DiagonalNoise<6>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Between<Pose3d>, FullNoise<6>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Between<ImuBiasd>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Between<ImuBiasd>, DiagonalNoise<6>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
