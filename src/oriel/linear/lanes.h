// Eight lanes of a batch: loading, storing, and turning a tile of eight by eight over. What holds more sums than a Pack
// has registers to spare works part by part: a Native is one register.
#pragma once
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "oriel/base/pack.h"
#include "oriel/residual/batch.h"

namespace oriel::lanes {
inline namespace ORIEL_PACK_ABI {

inline constexpr int kLanes = Pack::kLanes, kParts = Pack::kParts, kNative = Pack::kNative;
inline constexpr int kStride = Batch::kRows;
using V8 = Pack;
using Native = Pack::Native;
using V2 = double __attribute__((vector_size(16)));
#if defined(__AVX__)
using V4 = double __attribute__((vector_size(32)));
#else
struct V4 {
  V2 v[2];
  V4& operator+=(V4 x) { return v[0] += x.v[0], v[1] += x.v[1], *this; }
  V4& operator-=(V4 x) { return v[0] -= x.v[0], v[1] -= x.v[1], *this; }
  friend V4 operator*(V4 x, double s) { return {{x.v[0] * s, x.v[1] * s}}; }
};
#endif

template <class V>
inline V load_as(const double* p) {
  if constexpr (std::is_same_v<V, V8>) {
    return Pack::load(p);
  } else {
    V v;
    std::memcpy(&v, p, sizeof(v));
    return v;
  }
}
inline V8 load(const double* p) { return Pack::load(p); }
template <class V>
inline void store(double* p, const V& v) {
  if constexpr (std::is_same_v<V, V8>)
    v.store(p);
  else
    std::memcpy(p, &v, sizeof(v));
}

// GCC folds a load into each multiply-add that takes its value, which then loads it as often, and two loads a cycle are
// all there are. What went through here is in its register.
template <class V>
[[gnu::always_inline]] inline void keep(V& v) {
#if defined(__x86_64__)
  asm("" : "+v"(v));
#else
  (void)v;
#endif
}

// Rows to columns of a square tile, in rounds of exchanges.
template <class V>
inline void turn(V (&x)[8]) {
  V a[8], b[8];
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
template <class V>
inline void turn(V (&x)[4]) {
  const V a = __builtin_shufflevector(x[0], x[1], 0, 4, 2, 6), b = __builtin_shufflevector(x[0], x[1], 1, 5, 3, 7);
  const V c = __builtin_shufflevector(x[2], x[3], 0, 4, 2, 6), d = __builtin_shufflevector(x[2], x[3], 1, 5, 3, 7);
  x[0] = __builtin_shufflevector(a, c, 0, 1, 4, 5), x[1] = __builtin_shufflevector(b, d, 0, 1, 4, 5);
  x[2] = __builtin_shufflevector(a, c, 2, 3, 6, 7), x[3] = __builtin_shufflevector(b, d, 2, 3, 6, 7);
}
template <class V>
inline void turn(V (&x)[2]) {
  const V a = __builtin_shufflevector(x[0], x[1], 0, 2);
  x[1] = __builtin_shufflevector(x[0], x[1], 1, 3);
  x[0] = a;
}

// to[l * stride + k] = lane l of x[k], for eight k: the tile turned over square by square, each within registers.
inline void store_by_lane(const V8* x, double* to, std::int64_t stride) {
#pragma GCC unroll 4
  for (int k = 0; k < kLanes; k += kNative)
#pragma GCC unroll 4
    for (int part = 0; part < kParts; ++part) {
      Native square[kNative];
#pragma GCC unroll 8
      for (int i = 0; i < kNative; ++i) square[i] = x[k + i].v[part];
      turn(square);
#pragma GCC unroll 8
      for (int i = 0; i < kNative; ++i) store(to + (part * kNative + i) * stride + k, square[i]);
    }
}

// Lane k of the result is the sum over the lanes of x[k], made in pairs: half the exchanges of turning the tile over
// first.
template <class V>
inline V sum_each(const V (&x)[8]) {
  V y[4], z[2];
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
template <class V>
inline V sum_each(const V (&x)[4]) {
  const V a = __builtin_shufflevector(x[0], x[1], 0, 4, 2, 6) + __builtin_shufflevector(x[0], x[1], 1, 5, 3, 7);
  const V b = __builtin_shufflevector(x[2], x[3], 0, 4, 2, 6) + __builtin_shufflevector(x[2], x[3], 1, 5, 3, 7);
  return __builtin_shufflevector(a, b, 0, 1, 4, 5) + __builtin_shufflevector(a, b, 2, 3, 6, 7);
}
template <class V>
inline V sum_each(const V (&x)[2]) {
  return __builtin_shufflevector(x[0], x[1], 0, 2) + __builtin_shufflevector(x[0], x[1], 1, 3);
}
// to[k] = the sum over the lanes of x[k], k < D; what stands behind, to the next multiple of kNative, is written too.
template <int D>
inline void store_sums(const Native* x, double* to) {
#pragma GCC unroll 5
  for (int k = 0; k < D; k += kNative) {
    Native t[kNative];
#pragma GCC unroll 8
    for (int i = 0; i < kNative; ++i) t[i] = k + i < D ? x[k + i] : Native{};
    store(to + k, sum_each(t));
  }
}

// to += from, D <= 9 values: whole vectors first.
template <int D>
inline void add(double* to, const double* from) {
  auto piece = [&]<class V>(V, int at) {
    V x = load_as<V>(to + at);
    x += load_as<V>(from + at);
    store(to + at, x);
  };
  if constexpr (D >= 8) piece(V8{}, 0);
  if constexpr (D % 8 >= 4) piece(V4{}, D / 8 * 8);
  if constexpr (D % 4 >= 2) piece(V2{}, D / 4 * 4);
  if constexpr (D % 2 == 1) to[D - 1] += from[D - 1];
}

}  // namespace ORIEL_PACK_ABI
}  // namespace oriel::lanes
