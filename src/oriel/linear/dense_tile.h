// The register tile under all dense kernels. Included by .cc files of this room only: what it expands to depends on
// the instruction set of the build.
#pragma once
#include <cstdint>

#include "oriel/linear/lanes.h"

namespace oriel::dense {
namespace {

#if defined(__AVX512F__)
constexpr int kLanes = 8, kCols = 8;  // 32 registers: 3 × 8 accumulators, 3 of A, 1 of B
#elif defined(__AVX__)
constexpr int kLanes = 4, kCols = 4;  // 16 registers: 3 × 4 accumulators, 3 of A, 1 of B
#else
constexpr int kLanes = 2, kCols = 4;
#endif
constexpr int kMaxVectors = 3;
constexpr int kTileRows = kMaxVectors * kLanes;

using Vec = double __attribute__((vector_size(8 * kLanes)));
using UnalignedVec = double __attribute__((vector_size(8 * kLanes), aligned(8), may_alias));

inline Vec load(const double* x) { return *reinterpret_cast<const UnalignedVec*>(x); }
inline void store(double* x, Vec v) { *reinterpret_cast<UnalignedVec*>(x) = v; }
inline double sum(Vec v) {
  double s = v[0];
  for (int i = 1; i < kLanes; ++i) s += v[i];
  return s;
}

// acc[v][w] += Σ_l a(rows of vector v, l)·b(w, l), l < k.
template <int V, int W>
[[gnu::always_inline]] inline void accumulate(Vec (&acc)[V][W], const double* a, std::int64_t lda, const double* b,
                                              std::int64_t ldb, int k) {
  for (int l = 0; l < k; ++l, a += lda, b += ldb) {
    Vec rows[V];
#pragma GCC unroll 8
    for (int v = 0; v < V; ++v) rows[v] = load(a + v * kLanes), lanes::keep(rows[v]);
#pragma GCC unroll 8
    for (int w = 0; w < W; ++w) {
      const Vec column = b[w] - Vec{};
#pragma GCC unroll 8
      for (int v = 0; v < V; ++v) acc[v][w] += rows[v] * column;
    }
  }
}

// c := -A Bᵀ or c -= A Bᵀ for V vectors of rows × W columns.
template <int V, int W, bool kOverwrite>
void tile_minus(double* c, std::int64_t ldc, const double* a, std::int64_t lda, const double* b, std::int64_t ldb,
                int k) {
  Vec acc[V][W] = {};
  accumulate<V, W>(acc, a, lda, b, ldb, k);
#pragma GCC unroll 8
  for (int w = 0; w < W; ++w) {
#pragma GCC unroll 8
    for (int v = 0; v < V; ++v) {
      double* to = c + v * kLanes + w * ldc;
      store(to, kOverwrite ? -acc[v][w] : load(to) - acc[v][w]);
    }
  }
}

using TileFunction = void (*)(double*, std::int64_t, const double*, std::int64_t, const double*, std::int64_t, int);

template <bool kOverwrite, int V>
TileFunction tile_of_width(int w) {
  static_assert(kCols == 4 || kCols == 8);
  switch (w) {
    case 1:
      return tile_minus<V, 1, kOverwrite>;
    case 2:
      return tile_minus<V, 2, kOverwrite>;
    case 3:
      return tile_minus<V, 3, kOverwrite>;
    case 4:
      return tile_minus<V, 4, kOverwrite>;
    default:
      break;
  }
  if constexpr (kCols == 8) {
    switch (w) {
      case 5:
        return tile_minus<V, 5, kOverwrite>;
      case 6:
        return tile_minus<V, 6, kOverwrite>;
      case 7:
        return tile_minus<V, 7, kOverwrite>;
      default:
        return tile_minus<V, 8, kOverwrite>;
    }
  }
  return tile_minus<V, 4, kOverwrite>;
}

template <bool kOverwrite>
TileFunction tile_of(int v, int w) {
  if (v == 3) return tile_of_width<kOverwrite, 3>(w);
  return v == 2 ? tile_of_width<kOverwrite, 2>(w) : tile_of_width<kOverwrite, 1>(w);
}

}  // namespace
}  // namespace oriel::dense
