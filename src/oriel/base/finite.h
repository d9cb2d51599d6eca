// all_finite(x): no NaN and no infinity in any floating-point member of a plain struct, found without a macro.
#pragma once
#include <cmath>
#include <concepts>
#include <cstddef>
#include <type_traits>
#include <utility>

#include "oriel/base/matrix.h"

namespace oriel {

template <class T>
bool all_finite(const T& x);

// Of n doubles, one after the other.
bool all_finite(const double* x, std::size_t n);

namespace detail {

// A type that exists over other scalars has members of its scalar alone, so that it need not be taken apart.
template <class T>
concept DoublesOnly = requires {
  typename T::template rebind<double>;
}
&&std::is_same_v<typename T::template rebind<double>, T> && (sizeof(T) % sizeof(double) == 0);

struct Anything {
  template <class T>
  operator T() const;  // NOLINT(google-explicit-constructor): used unevaluated, to count members
};
template <class T, int N>
consteval bool takes() {
  return []<int... I>(std::integer_sequence<int, I...>) {
    return requires { T{(static_cast<void>(I), Anything{})...}; };
  }
  (std::make_integer_sequence<int, N>{});
}
template <class T>
consteval int member_count() {
  if constexpr (takes<T, 8>())
    return 8;
  else if constexpr (takes<T, 7>())
    return 7;
  else if constexpr (takes<T, 6>())
    return 6;
  else if constexpr (takes<T, 5>())
    return 5;
  else if constexpr (takes<T, 4>())
    return 4;
  else if constexpr (takes<T, 3>())
    return 3;
  else if constexpr (takes<T, 2>())
    return 2;
  else if constexpr (takes<T, 1>())
    return 1;
  else
    return 0;
}

template <class... T>
bool each_finite(const T&... x) {
  return (all_finite(x) && ... && true);
}
template <class T>
bool members_finite(const T& x) {
  constexpr int n = member_count<T>();
  if constexpr (n == 0) {
    return true;
  } else if constexpr (n == 1) {
    const auto& [a] = x;
    return each_finite(a);
  } else if constexpr (n == 2) {
    const auto& [a, b] = x;
    return each_finite(a, b);
  } else if constexpr (n == 3) {
    const auto& [a, b, c] = x;
    return each_finite(a, b, c);
  } else if constexpr (n == 4) {
    const auto& [a, b, c, d] = x;
    return each_finite(a, b, c, d);
  } else if constexpr (n == 5) {
    const auto& [a, b, c, d, e] = x;
    return each_finite(a, b, c, d, e);
  } else if constexpr (n == 6) {
    const auto& [a, b, c, d, e, f] = x;
    return each_finite(a, b, c, d, e, f);
  } else if constexpr (n == 7) {
    const auto& [a, b, c, d, e, f, g] = x;
    return each_finite(a, b, c, d, e, f, g);
  } else {
    const auto& [a, b, c, d, e, f, g, h] = x;
    return each_finite(a, b, c, d, e, f, g, h);
  }
}

}  // namespace detail

// A struct may answer for itself with a member `bool finite() const`; so must one with arrays or more than 8 members.
template <class T>
bool all_finite(const T& x) {
  if constexpr (std::is_floating_point_v<T>) {
    return std::isfinite(x);
  } else if constexpr (requires {
                         { x.finite() } -> std::same_as<bool>;
                       }) {
    return x.finite();
  } else if constexpr (detail::DoublesOnly<T>) {
    return all_finite(reinterpret_cast<const double*>(&x), sizeof(T) / sizeof(double));
  } else if constexpr (requires {
                         T::kSize;
                         typename T::Scalar;
                         x.m[0];
                       }) {
    for (int i = 0; i < T::kSize; ++i)
      if (!all_finite(x.m[i])) return false;
    return true;
  } else if constexpr (std::is_aggregate_v<T> && !std::is_array_v<T>) {
    return detail::members_finite(x);
  } else {
    return true;
  }
}

}  // namespace oriel
