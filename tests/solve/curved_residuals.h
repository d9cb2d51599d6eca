// Residuals that are far from linear, for tests of minimizers.
#pragma once
#include <cmath>

#include "oriel/manifold/vector.h"
#include "oriel/residual/residual.h"

namespace oriel::testing {

using Scalar = VectorNd<1>;

struct Rosenbrock {  // r = [10 (y - x²), 1 - x], minimum 0 at (1, 1)
  static constexpr std::string_view kName = "test.rosenbrock/1";
  using Variables = Types<VectorNd<2>>;
  double scale = 10.0;
  template <class S>
  Vec<S, 2> operator()(const VectorN<S, 2>& x) const {
    return {S(scale) * (x.v[1] - x.v[0] * x.v[0]), S(1.0) - x.v[0]};
  }
};

struct ArcTangent {  // Gauss–Newton diverges from |x| > 1.39
  static constexpr std::string_view kName = "test.arc_tangent/1";
  static constexpr int kDim = 1;
  using Variables = Types<Scalar>;
  double shift = 0.0;
  bool evaluate(const Scalar& x, Vec1d& r, Mat<double, 1, 1>* j) const {
    const double z = x.v[0] - shift;
    r[0] = std::atan(z);
    if (j != nullptr) (*j)(0, 0) = 1.0 / (1.0 + z * z);
    return true;
  }
};

}  // namespace oriel::testing
