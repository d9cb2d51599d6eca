// Robust losses ρ(s) of the squared whitened norm s = ‖r‖², a small value at run time. The cost of a factor is ½ρ(s);
// its rows are scaled by √ρ'(s) when they are linearized (iteratively re-weighted least squares: the gradient is exact,
// the Hessian is the Gauss–Newton one). All have ρ(0) = 0 and ρ'(0) = 1.
#pragma once
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string_view>
#include <type_traits>

#include "oriel/base/pack.h"
#include "oriel/manifold/manifold.h"

namespace oriel {

enum class LossKind : std::uint8_t { none, huber, cauchy, custom, geman_mcclure, tukey, truncated, barron };

template <class S>
struct LossValue {
  S rho, weight;  // ρ(s) and ρ'(s)
};

// What the library must know of a user's loss: a table of functions, as for variables and residuals. Journals and
// messages name it; a reader finds it in its TypeList.
struct LossOps {
  std::string_view name;
  std::uint64_t key = 0;
  LossValue<double> (*evaluate)(double scale, double s) = nullptr;
};

// A user's loss is a struct with a name and a function: ρ with ρ(0) = 0, ρ'(0) = 1, both finite, ρ' ≥ 0.
//   struct Mine {
//     static constexpr std::string_view kName = "mine/1";
//     static LossValue<double> evaluate(double scale, double s);
//   };
template <class L>
concept LossFunction = requires(double x) {
  { L::kName } -> std::convertible_to<std::string_view>;
  { L::evaluate(x, x) } -> std::same_as<LossValue<double>>;
};
template <LossFunction L>
inline constexpr LossOps kLossOps = {L::kName, type_key(L::kName), &L::evaluate};

struct Loss {
  LossKind kind = LossKind::none;
  double scale = 1.0;            // in whitened units (sigmas), > 0
  const LossOps* ops = nullptr;  // of a custom one
  double shape = 0.0;            // Barron's α, and the μ of a truncated one; else 0

  static constexpr Loss none() { return {}; }
};

// Why it is none, e.g. "the scale of its loss must be positive"; empty where all is well.
constexpr std::string_view fault_of(const Loss& loss) {
  const auto finite = [](double x) { return x - x == 0.0; };
  if (loss.kind > LossKind::barron) return "its loss is of no kind";
  if ((loss.kind == LossKind::custom) != (loss.ops != nullptr)) return "a custom loss has functions, and no other has";
  if (loss.kind != LossKind::none && !(finite(loss.scale) && loss.scale > 0.0))
    return "the scale of its loss must be positive";
  if (loss.kind == LossKind::truncated) return loss.shape > 0.0 ? "" : "the shape of a truncated loss must be positive";
  if (loss.kind == LossKind::barron) return loss.shape <= 2.0 ? "" : "the shape of Barron's loss must be at most 2";
  return loss.shape == 0.0 ? "" : "a loss of its kind has no shape";
}

// ρ(s) = s up to k², then 2k√s - k². Huber, Robust Estimation of a Location Parameter, 1964.
constexpr Loss Huber(double k) { return {LossKind::huber, k}; }
// ρ(s) = c² log(1 + s/c²).
constexpr Loss Cauchy(double c) { return {LossKind::cauchy, c}; }
// ρ(s) = c² s / (c² + s). Geman and McClure, Statistical Methods for Tomographic Image Restoration, 1987.
constexpr Loss GemanMcClure(double c) { return {LossKind::geman_mcclure, c}; }
// ρ(s) = c²/3 (1 - (1 - s/c²)³) up to c², then c²/3: Tukey's biweight. Beaton and Tukey, 1974.
constexpr Loss Tukey(double c) { return {LossKind::tukey, c}; }
// ρ(s) = min(s, c²). With a finite μ its graduated form, convex as μ → 0 and truncated as μ → ∞:
// ρ(s) = s below c² μ/(μ+1), 2c√(s μ(μ+1)) - μ(c² + s) up to c² (μ+1)/μ, then c².
// Yang, Antonante, Tzoumas, Carlone, Graduated Non-Convexity for Robust Spatial Perception, 2020, eq. 6 (there ε is c̄).
constexpr Loss TruncatedSquares(double c, double mu = std::numeric_limits<double>::infinity()) {
  return {LossKind::truncated, c, nullptr, mu};
}
// ρ(s) = 2c² b/α ((s/(c² b) + 1)^(α/2) - 1) with b = |α - 2|; its limits at α = 2 (squares), 0 (Cauchy's form) and -∞
// (Welsch's). α ≤ 2; 1 is the pseudo-Huber one, -2 Geman and McClure's. Barron, A General and Adaptive Robust Loss
// Function, 2019, eq. 8, twice as large and c² times: so that ρ'(0) = 1.
constexpr Loss Barron(double c, double alpha) { return {LossKind::barron, c, nullptr, alpha}; }
// A user's own.
template <LossFunction L>
constexpr Loss CustomLoss(double scale) {
  return {LossKind::custom, scale, &kLossOps<L>};
}

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

namespace detail {
LossValue<double> evaluate_redescending(const Loss& loss, double s) noexcept;  // those that are not inline
}

// Of whatever kind.
inline LossValue<double> evaluate_loss(const Loss& loss, double s) {
  if (loss.kind == LossKind::custom) return loss.ops->evaluate(loss.scale, s);
  if (loss.kind > LossKind::custom) return detail::evaluate_redescending(loss, s);
  return evaluate_loss(loss.kind, loss.scale, s);
}

// Eight rows, each with a loss of its own, whose kind (as a number) and scale stand beside it. Only lanes of `good`
// have an s that a loss of the user's could make sense of.
inline LossValue<Pack> evaluate_losses(const Loss* const* loss, Pack kind, Pack scale, Pack s, Pack::Mask good) {
  LossValue<Pack> value = {s, Pack(1.0)};
  const auto is_huber = (kind >= Pack(1.0)) & (kind <= Pack(1.0)), is_other = kind > Pack(1.0);
  if (bits(is_huber) != 0) {
    const auto v = evaluate_loss(LossKind::huber, scale, s);
    value = {select(is_huber, v.rho, value.rho), select(is_huber, v.weight, value.weight)};
  }
  const unsigned other = bits(is_other & good);
  for (int l = 0; other != 0 && l < Pack::kLanes; ++l) {
    if ((other >> l & 1) == 0) continue;
    const auto v = evaluate_loss(*loss[l], s[l]);
    value.rho.set(l, v.rho);
    value.weight.set(l, v.weight);
  }
  return value;
}

constexpr std::string_view name_of(LossKind kind) {
  constexpr std::string_view kNames[] = {"none",          "huber", "cauchy",    "custom",
                                         "geman-mcclure", "tukey", "truncated", "barron"};
  return kNames[static_cast<std::size_t>(kind)];
}

}  // namespace oriel
