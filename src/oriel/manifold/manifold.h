// What a variable is: a point of a manifold that is stepped along tangent vectors.
//
// A user's struct becomes a variable by having, and nothing else,
//   static constexpr std::string_view kName = "mine/1";   // how it is called in files; the number is its version
//   static constexpr int kDim = 3;                        // dimension of the tangent space
//   T plus(const Vec<double, kDim>& d) const;             // x ⊞ d
//   Vec<double, kDim> minus(const T& x) const;            // y.minus(x) = y ⊟ x, so that x.plus(y.minus(x)) = y
// and by being trivially copyable. Laws (checked by check_manifold_laws, behaviour V3): x ⊞ 0 = x, x ⊞ (y ⊟ x) = y and
// (x ⊞ d) ⊟ x = d within the injectivity radius. Optional members:
//   template <class S> using rebind = T<S>;               // the same over another scalar; all members are scalars then
//   static constexpr bool kLandmark = true;               // many of them, each in few factors: eliminated first
//   static constexpr std::array<std::string_view, kDim> kTangentNames;  // with units, for reports
//   Mat<double, kDim, kDim> world_axes() const;           // B with d_world = B d, orthogonal: for graph/freedom.h
// A constant (a camera, a rig) is a struct with kName and kDim = 0: it takes part in factors and never moves.
#pragma once
#include <array>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <string_view>
#include <type_traits>

#include "oriel/base/matrix.h"

namespace oriel {

template <class... T>
struct Types {
  static constexpr int kCount = sizeof...(T);
};

template <class T>
concept Named = requires {
  { T::kName } -> std::convertible_to<std::string_view>;
};

template <class T>
concept Constant = Named<T> && std::is_trivially_copyable_v<T> &&(T::kDim == 0);

template <class T>
concept Manifold = Named<T> && std::is_trivially_copyable_v<T> &&(T::kDim > 0) &&
                   requires(const T x, const T y, const Vec<double, T::kDim> d) {
  { x.plus(d) } -> std::same_as<T>;
  { y.minus(x) } -> std::same_as<Vec<double, T::kDim>>;
};

// What a factor may be attached to.
template <class T>
concept Variable = Manifold<T> || Constant<T>;

template <class T>
concept Landmark = Manifold<T> && requires {
  requires T::kLandmark;
};

// Directions of its tangent may be named in the axes of the world.
template <class T>
concept HasWorldAxes = Manifold<T> && requires(const T x) {
  { x.world_axes() } -> std::same_as<Mat<double, T::kDim, T::kDim>>;
};

// All members are of one scalar type, and the type exists over others.
template <class T>
concept Rebindable = requires {
  typename T::template rebind<double>;
}
&&std::same_as<typename T::template rebind<double>, T> && (sizeof(T) % sizeof(double) == 0);

// x over another scalar: Dual (derivatives zero) or Pack (all lanes equal).
template <class S, Rebindable T>
typename T::template rebind<S> cast(const T& x) {
  using Out = typename T::template rebind<S>;
  constexpr std::size_t n = sizeof(T) / sizeof(double);
  static_assert(sizeof(Out) == n * sizeof(S), "members of a rebindable type are all of its scalar type");
  std::array<double, n> in;
  std::memcpy(in.data(), &x, sizeof(T));
  std::array<S, n> out;
  for (std::size_t i = 0; i < n; ++i) out[i] = S(in[i]);
  Out y;
  std::memcpy(static_cast<void*>(&y), out.data(), sizeof(Out));
  return y;
}

// The key of a type in edits, journals and messages: FNV-1a of its name (the same in every program).
constexpr std::uint64_t type_key(std::string_view name) {
  std::uint64_t h = 14695981039346656037ull;
  for (char c : name) h = (h ^ static_cast<unsigned char>(c)) * 1099511628211ull;
  return h;
}

}  // namespace oriel
