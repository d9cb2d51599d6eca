#include "oriel/base/finite.h"

namespace oriel {

bool all_finite(const double* x, std::size_t n) {
  double sum = 0.0;
  for (std::size_t i = 0; i < n; ++i) sum += x[i] - x[i];  // 0, or NaN
  return sum == 0.0;
}

}  // namespace oriel
