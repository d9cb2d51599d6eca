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

// Lane k of the result is the sum over the lanes of x[k], made in pairs: seven additions, and half the exchanges of
// turning the tile over first.
inline V8 sum_each(const V8 (&x)[8]) {
  V8 y[4], z[2];
#pragma GCC unroll 4
  for (int i = 0; i < 4; ++i)
    y[i] = __builtin_shufflevector(x[2 * i], x[2 * i + 1], 0, 8, 2, 10, 4, 12, 6, 14) +
           __builtin_shufflevector(x[2 * i], x[2 * i + 1], 1, 9, 3, 11, 5, 13, 7, 15);
#pragma GCC unroll 2
  for (int i = 0; i < 2; ++i)
    z[i] = __builtin_shufflevector(y[2 * i], y[2 * i + 1], 0, 1, 8, 9, 4, 5, 12, 13) +
           __builtin_shufflevector(y[2 * i], y[2 * i + 1], 2, 3, 10, 11, 6, 7, 14, 15);
  return __builtin_shufflevector(z[0], z[1], 0, 1, 2, 3, 8, 9, 10, 11) +
         __builtin_shufflevector(z[0], z[1], 4, 5, 6, 7, 12, 13, 14, 15);
}

// to += from, D <= 9 values: whole vectors first.
template <int D>
inline void add(double* to, const double* from) {
  using V4 = double __attribute__((vector_size(32)));
  using V2 = double __attribute__((vector_size(16)));
  auto piece = [&]<class V>(V, int at) {
    V x, y;
    std::memcpy(&x, to + at, sizeof(V));
    std::memcpy(&y, from + at, sizeof(V));
    x += y;
    std::memcpy(to + at, &x, sizeof(V));
  };
  if constexpr (D >= 8) piece(V8{}, 0);
  if constexpr (D % 8 >= 4) piece(V4{}, D / 8 * 8);
  if constexpr (D % 4 >= 2) piece(V2{}, D / 4 * 4);
  if constexpr (D % 2 == 1) to[D - 1] += from[D - 1];
}
// The same from the first D <= 8 lanes of a vector.
template <int D>
inline void add(double* to, V8 from) {
  using V4 = double __attribute__((vector_size(32)));
  using V2 = double __attribute__((vector_size(16)));
  auto piece = [to]<class V>(V v, int at) {
    V x;
    std::memcpy(&x, to + at, sizeof(V));
    x += v;
    std::memcpy(to + at, &x, sizeof(V));
  };
  static_assert(D <= 8);
  if constexpr (D == 8) piece(from, 0);
  if constexpr (D % 8 >= 4) piece(V4{from[0], from[1], from[2], from[3]}, 0);
  if constexpr (D % 4 >= 2) piece(V2{from[D / 4 * 4], from[D / 4 * 4 + 1]}, D / 4 * 4);
  if constexpr (D % 2 == 1) to[D - 1] += from[D - 1];
}

}  // namespace oriel::lanes
