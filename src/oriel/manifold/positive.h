// A positive number x, e.g. a scale, a standard deviation or a time constant, stepped in its logarithm: x ⊞ d = x
// exp(d), y ⊟ x = log(y/x). A step is a relative change, whatever the size of x.
#pragma once
#include "oriel/base/pack.h"
#include "oriel/manifold/manifold.h"

namespace oriel {

template <class S>
struct Positive {
  static constexpr std::string_view kName = "positive/1";
  static constexpr int kDim = 1;
  static constexpr std::array<std::string_view, 1> kTangentNames = {"relative change"};
  // It stays in here under any step; exp alone would round to zero or to infinity.
  static constexpr double kLeast = 1e-300, kLargest = 1e300;
  template <class T>
  using rebind = Positive<T>;

  S x = S(1.0);

  Positive plus(const Vec<S, 1>& d) const {
    using std::exp;
    const S moved = x * exp(d[0]);
    const S low = select(moved < S(kLeast), S(kLeast), moved);
    return {select(low > S(kLargest), S(kLargest), low)};
  }
  Vec<S, 1> minus(const Positive& from) const {
    using std::log;
    return {{log(x / from.x)}};
  }
};
using Positived = Positive<double>;

// log(y exp(δ)/x) = log(y/x) + δ.
template <class S>
Mat<S, 1, 1> analytic_minus_jacobian(const Positive<S>&, const Positive<S>&, const Vec<S, 1>&) {
  return {{S(1.0)}};
}

}  // namespace oriel
