// Robust losses ρ(s) of the squared whitened norm s = ‖r‖², a small value at run time. The cost of a factor is ½ρ(s);
// its rows are scaled by √ρ'(s) when they are linearized (iteratively re-weighted least squares: the gradient is exact,
// the Hessian is the Gauss–Newton one). All have ρ(0) = 0 and ρ'(0) = 1.
#pragma once
#include <cmath>
#include <cstdint>
#include <string_view>
#include <type_traits>

#include "oriel/base/pack.h"

namespace oriel {

enum class LossKind : std::uint8_t { none, huber, cauchy };

struct Loss {
  LossKind kind = LossKind::none;
  double scale = 1.0;  // in whitened units (sigmas), > 0

  static constexpr Loss none() { return {}; }
};

// ρ(s) = s up to k², then 2k√s - k². Huber, Robust Estimation of a Location Parameter, 1964.
constexpr Loss Huber(double k) { return {LossKind::huber, k}; }
// ρ(s) = c² log(1 + s/c²).
constexpr Loss Cauchy(double c) { return {LossKind::cauchy, c}; }

template <class S>
struct LossValue {
  S rho, weight;  // ρ(s) and ρ'(s)
};

template <class S>
LossValue<S> evaluate_loss(LossKind kind, const S& scale, const S& s) {
  using std::log, std::sqrt;
  const S k2 = scale * scale;
  if (kind == LossKind::huber) {
    const auto inside = s <= k2;
    const S root = sqrt(select(inside, k2, s));
    return {select(inside, s, S(2.0) * scale * root - k2), select(inside, S(1.0), scale / root)};
  }
  if (kind == LossKind::cauchy) {
    const S u = s / k2;
    if constexpr (std::is_same_v<S, double>)
      return {k2 * std::log1p(u), 1.0 / (1.0 + u)};  // keeps the digits of small residuals
    else
      return {k2 * log(S(1.0) + u), S(1.0) / (S(1.0) + u)};
  }
  return {s, S(1.0)};
}

// Eight rows, each with a kind (as a number) and a scale of its own.
inline LossValue<Pack> evaluate_losses(Pack kind, Pack scale, Pack s) {
  LossValue<Pack> value = {s, Pack(1.0)};
  const auto is_huber = (kind >= Pack(1.0)) & (kind <= Pack(1.0)), is_cauchy = kind > Pack(1.0);
  bool huber = false, cauchy = false;
  for (int l = 0; l < Pack::kLanes; ++l) huber |= is_huber.v[l] != 0, cauchy |= is_cauchy.v[l] != 0;
  if (huber) {
    const auto v = evaluate_loss(LossKind::huber, scale, s);
    value = {select(is_huber, v.rho, value.rho), select(is_huber, v.weight, value.weight)};
  }
  for (int l = 0; cauchy && l < Pack::kLanes; ++l) {
    if (is_cauchy.v[l] == 0) continue;
    const auto v = evaluate_loss(LossKind::cauchy, scale[l], s[l]);
    value.rho.set(l, v.rho);
    value.weight.set(l, v.weight);
  }
  return value;
}

constexpr std::string_view name_of(LossKind kind) {
  return kind == LossKind::huber ? "huber" : kind == LossKind::cauchy ? "cauchy" : "none";
}

}  // namespace oriel
