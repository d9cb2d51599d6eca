// r and its dense Jacobian of one row, whatever form the residual has: analytic, dual numbers, central differences.
#pragma once
#include <tuple>
#include <utility>

#include "oriel/manifold/se3.h"
#include "oriel/residual/residual.h"

namespace oriel {
namespace detail {

template <class R, class Ret, int N>
bool unpack(const Ret& ret, Vec<double, N>& r) {
  if constexpr (ReturnShape<Ret>::kOptional) {
    return ret.has_value() && unpack<R>(*ret, r);
  } else if constexpr (requires { ret.m; }) {
    for (int i = 0; i < N; ++i) r[i] = ret[i];
    return true;
  } else {
    r[0] = ret;
    return true;
  }
}

// x ⊞ δ over dual numbers, δ being the variables column .. column + kDim - 1.
template <int C, class V>
auto seed(const V& x, [[maybe_unused]] int column) {
  using S = Dual<C>;
  if constexpr (V::kDim == 0) {
    if constexpr (Rebindable<V>)
      return cast<S>(x);
    else
      return x;
  } else {
    Vec<S, V::kDim> d;
    for (int i = 0; i < V::kDim; ++i) d[i] = S::variable(0.0, column + i);
    return cast<S>(x).plus(d);
  }
}

// The same for rotations and poses by their first derivative, which spares every user's program the exponential over
// dual numbers: q Exp(φ) = q + ½ q [φ, 0] and t + R ρ, up to second order ([ML] eq. 132, 172).
template <int C>
Rot3<Dual<C>> seed(const Rot3d& x, int column) {
  Rot3<Dual<C>> y{x.qx, x.qy, x.qz, x.qw};
  for (int i = 0; i < 3; ++i) {
    const Rot3d q = x * Rot3d{i == 0 ? 0.5 : 0.0, i == 1 ? 0.5 : 0.0, i == 2 ? 0.5 : 0.0, 0.0};
    y.qx.d[column + i] = q.qx, y.qy.d[column + i] = q.qy, y.qz.d[column + i] = q.qz, y.qw.d[column + i] = q.qw;
  }
  return y;
}
template <int C>
Pose3<Dual<C>> seed(const Pose3d& x, int column) {
  Pose3<Dual<C>> y{seed<C>(x.R, column), x.t.template cast<Dual<C>>()};
  const Mat<double, 3, 3> R = x.R.matrix();
  for (int j = 0; j < 3; ++j)
    for (int i = 0; i < 3; ++i) y.t[i].d[column + 3 + j] = R(i, j);
  return y;
}

template <class R, class... V>
concept DualCallable = ((Rebindable<V> || V::kDim == 0) && ...) &&
                       std::is_invocable_v<const R&, const rebound_t<Dual<ResidualTraits<R>::kCols>, V>&...>;

template <class S, int N, int C>
void take(const S& value, int i, Vec<double, N>& r, Mat<double, N, C>& j) {
  r[i] = value.a;
  for (int c = 0; c < C; ++c) j(i, c) = value.d[c];
}
template <class Ret, int N, int C>
bool unpack_dual(const Ret& ret, Vec<double, N>& r, Mat<double, N, C>& j) {
  if constexpr (ReturnShape<Ret>::kOptional) {
    return ret.has_value() && unpack_dual(*ret, r, j);
  } else {
    if constexpr (requires { ret.m; })
      for (int i = 0; i < N; ++i) take(ret[i], i, r, j);
    else
      take(ret, 0, r, j);
    return true;
  }
}

template <class R, std::size_t... I, class... V>
bool evaluate_dual(const R& residual, Vec<double, ResidualTraits<R>::kDim>& r,
                   Mat<double, ResidualTraits<R>::kDim, ResidualTraits<R>::kCols>& j, std::index_sequence<I...>,
                   const V&... x) {
  using T = ResidualTraits<R>;
  return unpack_dual(residual(seed<T::kCols>(x, T::column(I))...), r, j);
}

}  // namespace detail

// Jacobian of any residual by central differences along the tangents, step h; false where it is not valid.
template <Residual R, class... V>
bool differentiate_numerically(const R& residual, Mat<double, ResidualTraits<R>::kDim, ResidualTraits<R>::kCols>& j,
                               double h, const V&... x);

// r, and the Jacobian unless it is null: kDim × kCols, the columns of the variables one after the other. False where
// the residual is not valid at these values; r and j are then meaningless.
template <Residual R, class... V>
bool evaluate_residual(const R& residual, Vec<double, ResidualTraits<R>::kDim>& r,
                       Mat<double, ResidualTraits<R>::kDim, ResidualTraits<R>::kCols>* j, const V&... x) {
  using T = ResidualTraits<R>;
  if constexpr (AnalyticResidual<R>) {
    auto blocks = std::make_tuple(Mat<double, T::kDim, (V::kDim > 0 ? V::kDim : 1)>{}...);
    auto pointers = [&]<std::size_t... I>(std::index_sequence<I...>) {
      auto one = [&]<class B>(B& b, auto dim) {
        if constexpr (decltype(dim)::value > 0)
          return std::make_tuple(j != nullptr ? &b : nullptr);
        else
          return std::tuple<>();
      };
      return std::tuple_cat(one(std::get<I>(blocks), std::integral_constant<int, T::kDims[I]>{})...);
    }
    (std::make_index_sequence<T::kArity>{});
    const bool valid = std::apply([&](auto*... b) { return residual.evaluate(x..., r, b...); }, pointers);
    if (j == nullptr || !valid) return valid;
    [&]<std::size_t... I>(std::index_sequence<I...>) {
      auto one = [&](const auto& b, auto dim, int column) {
        if constexpr (decltype(dim)::value > 0) j->set_block(0, column, b);
      };
      (one(std::get<I>(blocks), std::integral_constant<int, T::kDims[I]>{}, T::column(I)), ...);
    }
    (std::make_index_sequence<T::kArity>{});
    return true;
  } else if (j == nullptr) {
    return detail::unpack<R>(residual(x...), r);
  } else if constexpr (detail::DualCallable<R, V...>) {
    return detail::evaluate_dual(residual, r, *j, std::make_index_sequence<T::kArity>{}, x...);
  } else {
    return detail::unpack<R>(residual(x...), r) && differentiate_numerically(residual, *j, 1e-6, x...);
  }
}

template <Residual R, class... V>
bool differentiate_numerically(const R& residual, Mat<double, ResidualTraits<R>::kDim, ResidualTraits<R>::kCols>& j,
                               double h, const V&... x) {
  using T = ResidualTraits<R>;
  bool valid = true;
  auto values = std::make_tuple(x...);
  auto along = [&](auto& value, int column) {
    using W = std::remove_reference_t<decltype(value)>;
    if constexpr (W::kDim > 0) {
      const W at = value;
      for (int i = 0; i < W::kDim; ++i) {
        Vec<double, W::kDim> d = Vec<double, W::kDim>::zero();
        Vec<double, T::kDim> ahead, behind;
        d[i] = h;
        value = at.plus(d);
        valid =
            std::apply([&](const auto&... v) { return evaluate_residual(residual, ahead, nullptr, v...); }, values) &&
            valid;
        d[i] = -h;
        value = at.plus(d);
        valid =
            std::apply([&](const auto&... v) { return evaluate_residual(residual, behind, nullptr, v...); }, values) &&
            valid;
        for (int k = 0; k < T::kDim; ++k) j(k, column + i) = (ahead[k] - behind[k]) / (2.0 * h);
      }
      value = at;
    }
  };
  [&]<std::size_t... I>(std::index_sequence<I...>) { (along(std::get<I>(values), T::column(I)), ...); }
  (std::make_index_sequence<T::kArity>{});
  return valid;
}

}  // namespace oriel
