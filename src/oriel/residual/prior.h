// Prior: a variable was measured directly. r = x ⊟ value (kDim × 1), in the units of the tangent.
#pragma once
#include "oriel/manifold/jacobian.h"
#include "oriel/manifold/name.h"
#include "oriel/manifold/rebind.h"
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

}  // namespace oriel
