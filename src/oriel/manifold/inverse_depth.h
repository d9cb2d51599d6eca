// Inverse depth ρ > 0 [1/m] of a landmark along the ray of its anchor observation.
#pragma once
#include "oriel/base/pack.h"
#include "oriel/manifold/manifold.h"

namespace oriel {

// ρ ⊞ d = ρ + d while d ≥ -ρ/2, and (ρ/2) exp(1 + 2 d/ρ) below: once continuously differentiable, a bijection of the
// real line onto the positive numbers, so ρ stays positive under any step (behaviour V4) and is Gaussian where it is
// well known. Its slope at d = 0 is 1.
template <class S>
struct InverseDepth {
  static constexpr std::string_view kName = "inverse_depth/1";
  static constexpr int kDim = 1;
  static constexpr bool kLandmark = true;
  static constexpr std::array<std::string_view, 1> kTangentNames = {"inverse depth [1/m]"};
  static constexpr double kLeast = 1e-12;  // where the exponential would round to zero
  template <class T>
  using rebind = InverseDepth<T>;

  S rho = S(1.0);  // [1/m]

  InverseDepth plus(const Vec<S, 1>& d) const {
    using std::exp;
    const auto linear = d[0] >= rho * S(-0.5);
    const S u = S(1.0) + S(2.0) * select(linear, S(0.0), d[0]) / rho;
    const S low = rho * S(0.5) * exp(select(linear, S(0.0), u));
    const S moved = select(linear, rho + d[0], low);
    return {select(moved < S(kLeast), S(kLeast), moved)};
  }
  Vec<S, 1> minus(const InverseDepth& x) const {
    using std::log;
    const auto linear = rho >= x.rho * S(0.5);
    const S ratio = select(linear, S(1.0), S(2.0) * rho / x.rho);
    return {{select(linear, rho - x.rho, x.rho * S(0.5) * (log(ratio) - S(1.0)))}};
  }
};
using InverseDepthd = InverseDepth<double>;

}  // namespace oriel
