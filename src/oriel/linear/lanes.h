// Eight lanes of a batch: loading, storing, and turning a tile of eight by eight over.
#pragma once
#include <cstring>

#include "oriel/base/pack.h"
#include "oriel/residual/batch.h"

namespace oriel::lanes {

inline constexpr int kLanes = Pack::kLanes;
inline constexpr int kStride = Batch::kRows;
using V8 = Pack::Native;

inline V8 load(const double* p) {
  V8 v;
  std::memcpy(&v, p, sizeof(v));
  return v;
}
inline void store(double* p, V8 v) { std::memcpy(p, &v, sizeof(v)); }

// Rows to columns of an 8 × 8 tile, in three rounds of exchanges.
inline void turn(V8 (&x)[8]) {
  V8 a[8], b[8];
  for (int i = 0; i < 8; i += 2) {
    a[i] = __builtin_shufflevector(x[i], x[i + 1], 0, 8, 2, 10, 4, 12, 6, 14);
    a[i + 1] = __builtin_shufflevector(x[i], x[i + 1], 1, 9, 3, 11, 5, 13, 7, 15);
  }
  for (int i = 0; i < 8; i += 4)
    for (int k = 0; k < 2; ++k) {
      b[i + k] = __builtin_shufflevector(a[i + k], a[i + 2 + k], 0, 1, 8, 9, 4, 5, 12, 13);
      b[i + 2 + k] = __builtin_shufflevector(a[i + k], a[i + 2 + k], 2, 3, 10, 11, 6, 7, 14, 15);
    }
  for (int k = 0; k < 4; ++k) {
    x[k] = __builtin_shufflevector(b[k], b[4 + k], 0, 1, 2, 3, 8, 9, 10, 11);
    x[4 + k] = __builtin_shufflevector(b[k], b[4 + k], 4, 5, 6, 7, 12, 13, 14, 15);
  }
}

}  // namespace oriel::lanes
