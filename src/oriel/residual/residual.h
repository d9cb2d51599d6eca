// What a residual is: pure maths, a measurement against values, without ids.
//
// A user's struct becomes a residual by having
//   static constexpr std::string_view kName = "mine/1";
//   using Variables = Types<Pose3d, Point3d>;             // what it is attached to, in order
// its measurement as members, being trivially copyable, and one of
//   (dual)      template <class S> Vec<S, 2> operator()(const Pose3<S>&, const Point3<S>&) const;
//               The return type may be S (dimension 1), Vec<S, N>, or std::optional of one: nullopt where the factor is
//               not valid (a point behind the camera). Constants are passed as they are. Its Jacobian comes from dual
//               numbers, or from central differences where a variable has no rebind<S>.
//   (analytic)  static constexpr int kDim = 2;
//               Valid<S> evaluate(const Pose3<S>& x, const Point3<S>& p, Vec<S, 2>& r, Mat<S, 2, 6>* J_x,
//                                 Mat<S, 2, 3>* J_p) const;
//               One Jacobian for each variable that is not a constant, by its tangent at zero; all null or none. If the
//               struct itself is a template over its scalar with rebind<S>, eight rows are evaluated at once (S =
//               Pack).
#pragma once
#include <array>
#include <concepts>
#include <optional>
#include <tuple>
#include <type_traits>

#include "oriel/base/pack.h"
#include "oriel/manifold/dual.h"
#include "oriel/manifold/manifold.h"

namespace oriel {

// bool for one row, a mask for eight.
template <class S>
using Valid = std::conditional_t<std::is_same_v<S, Pack>, Pack::Mask, bool>;
template <class S>
Valid<S> always_valid() {
  if constexpr (std::is_same_v<S, Pack>)
    return Pack(0.0) <= Pack(0.0);
  else
    return true;
}

namespace detail {

template <class S, class V>
struct Rebound {
  using type = V;
};
template <class S, Rebindable V>
struct Rebound<S, V> {
  using type = typename V::template rebind<S>;
};
template <class S, class V>
using rebound_t = typename Rebound<S, V>::type;

template <class T>
struct ReturnShape {
  static constexpr int kDim = 1;
  static constexpr bool kOptional = false;
};
template <class S, int N>
struct ReturnShape<Vec<S, N>> {
  static constexpr int kDim = N;
  static constexpr bool kOptional = false;
};
template <class T>
struct ReturnShape<std::optional<T>> {
  static constexpr int kDim = ReturnShape<T>::kDim;
  static constexpr bool kOptional = true;
};

template <class T>
concept HasVariables = Named<T> && std::is_trivially_copyable_v<T> && requires {
  typename T::Variables;
};
template <class T>
concept SaysItsDimension = requires {
  { T::kDim } -> std::convertible_to<int>;
};

template <class R, class S, class Vars>
struct Call;
template <class R, class S, class... V>
struct Call<R, S, Types<V...>> {
  static constexpr bool kValid = std::is_invocable_v<const R&, const rebound_t<S, V>&...>;
};
template <class R, class... V>
auto return_of(Types<V...>) -> std::invoke_result_t<const R&, const V&...>;

}  // namespace detail

template <class R>
concept DualResidual = detail::HasVariables<R> && detail::Call<R, double, typename R::Variables>::kValid;
template <class R>
concept AnalyticResidual = detail::HasVariables<R> && detail::SaysItsDimension<R> && !DualResidual<R>;
template <class R>
concept Residual = DualResidual<R> || AnalyticResidual<R>;

template <class R>
constexpr int residual_dim() {
  if constexpr (DualResidual<R>)
    return detail::ReturnShape<std::remove_cvref_t<decltype(detail::return_of<R>(typename R::Variables{}))>>::kDim;
  else
    return R::kDim;
}

// Compile-time facts of a residual.
template <class R, class Vars = typename R::Variables>
struct ResidualTraits;
template <class R, class... V>
struct ResidualTraits<R, Types<V...>> {
  static constexpr int kDim = residual_dim<R>();
  static constexpr int kArity = sizeof...(V);
  static constexpr std::array<int, kArity> kDims = {V::kDim...};
  static constexpr int kCols = (V::kDim + ... + 0);
  static constexpr int column(int arg) {
    int c = 0;
    for (int i = 0; i < arg; ++i) c += kDims[i];
    return c;
  }
  template <int I>
  using Var = std::tuple_element_t<I, std::tuple<V...>>;
};

}  // namespace oriel
