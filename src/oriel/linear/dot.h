// Scalar product with eight running sums: the order of its additions is a function of the length alone.
#pragma once
#include "oriel/base/pack.h"

namespace oriel {
inline namespace ORIEL_PACK_ABI {

inline double dot(const double* a, const double* b, int n) {
  Pack s(0.0);
  int i = 0;
  for (; i + Pack::kLanes <= n; i += Pack::kLanes) s += Pack::load(a + i) * Pack::load(b + i);
  double sum = 0.0;
  for (int l = 0; l < Pack::kLanes; ++l) sum += s[l];
  for (; i < n; ++i) sum += a[i] * b[i];
  return sum;
}

}  // namespace ORIEL_PACK_ABI
}  // namespace oriel
