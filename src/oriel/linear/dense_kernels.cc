#include "oriel/linear/dense_kernels.h"

#include <algorithm>
#include <cmath>

#include "oriel/linear/dense_tile.h"

namespace oriel::dense {
namespace {

// Columns that are factored left-looking before the rest of a wide panel is updated: 64 columns of a front with some
// hundred rows stay in the L2 cache.
constexpr int kPanelColumns = 64;
// Columns of A that one pass over a row tile takes: 24 × 160 doubles are 30 KB, within a 48 KB L1 cache.
constexpr int kChunk = 160;

// Where the rows and columns of a matrix C live: element (r, c) is data[(r - row0) + (c - column0)·ld].
struct Target {
  double* data;
  std::int64_t ld;
  int row0, column0;
};

// Rows [r, r + V·kLanes) of C -= A Bᵀ (or = -A Bᵀ) in columns [begin, end). Column tiles lie on the grid of kCols;
// with `lower`, vectors that lie wholly above the diagonal are left out.
template <bool kOverwrite>
void row_tile(const Target& c, const double* a, std::int64_t lda, const double* b, std::int64_t ldb, int r, int vectors,
              int begin, int end, int k, bool lower) {
  const int last = lower ? std::min(end, r + vectors * kLanes) : end;
  for (int j = begin; j < last;) {
    const int grid = j / kCols * kCols;
    const int next = std::min(grid + kCols, end);
    const int skip = lower ? std::max(0, (grid - r) / kLanes) : 0;
    const int row = r + skip * kLanes;
    tile_of<kOverwrite>(vectors - skip, next - j)(c.data + (row - c.row0) + (j - c.column0) * c.ld, c.ld, a + row, lda,
                                                  b + j, ldb, k);
    j = next;
  }
}

template <bool kOverwrite>
void row_tile_in_chunks(const Target& c, const double* a, std::int64_t lda, const double* b, std::int64_t ldb, int r,
                        int vectors, int begin, int end, int k, bool lower) {
  int k0 = std::min(k, kChunk);
  row_tile<kOverwrite>(c, a, lda, b, ldb, r, vectors, begin, end, k0, lower);
  for (; k0 < k; k0 += kChunk)
    row_tile<false>(c, a + k0 * lda, lda, b + k0 * ldb, ldb, r, vectors, begin, end, std::min(kChunk, k - k0), lower);
}

// Tiles of rows are counted from the last row upwards: the same rows are the same task in every call for a front, and a
// pool that gives a task to the same worker finds them in that worker's cache. The largest, where only the lower half
// is wanted, come first.
template <class F>
void for_each_row_tile(int row_begin, int row_end, TaskPool* pool, F tile) {
  const int tiles = (row_end - row_begin + kTileRows - 1) / kTileRows;
  parallel_for(pool, std::max(tiles, 0), [&](int task, int) {
    const int end = row_end - task * kTileRows;
    tile(std::max(row_begin, end - kTileRows), end);
  });
}

// All row tiles of [row_begin, row_end), multiples of kLanes apart; each is a task of its own with the same arithmetic
// on any thread.
template <bool kOverwrite>
void all_row_tiles(const Target& c, const double* a, std::int64_t lda, const double* b, std::int64_t ldb, int row_begin,
                   int row_end, int begin, int end, int k, bool lower, TaskPool* pool) {
  for_each_row_tile(row_begin, row_end, pool, [&](int r, int last) {
    row_tile_in_chunks<kOverwrite>(c, a, lda, b, ldb, r, (last - r + kLanes - 1) / kLanes, begin, end, k, lower);
  });
}

// The factored square at the diagonal of up to kCols columns, for the rows below it.
struct Triangle {
  double l[kCols][kCols];
  double inverse[kCols];
};

// Rows [r, r + V·kLanes) of columns [j, j + W): subtract what columns [k0, j) contribute, then X := X L⁻ᵀ, all within
// registers.
template <int V, int W>
void solve_rows(double* f, std::int64_t ld, int r, int j, int k0, const Triangle& t) {
  Vec x[V][W] = {};
  accumulate<V, W>(x, f + r + k0 * ld, ld, f + j + k0 * ld, ld, j - k0);
#pragma GCC unroll 8
  for (int w = 0; w < W; ++w) {
#pragma GCC unroll 8
    for (int v = 0; v < V; ++v) x[v][w] = load(f + r + v * kLanes + (j + w) * ld) - x[v][w];
  }
#pragma GCC unroll 8
  for (int c = 0; c < W; ++c) {
#pragma GCC unroll 8
    for (int v = 0; v < V; ++v) {
      x[v][c] *= t.inverse[c];
      store(f + r + v * kLanes + (j + c) * ld, x[v][c]);
    }
#pragma GCC unroll 8
    for (int e = c + 1; e < W; ++e) {
#pragma GCC unroll 8
      for (int v = 0; v < V; ++v) x[v][e] -= x[v][c] * t.l[e][c];
    }
  }
}

// The first kCols rows of columns [j, j + W): Cholesky of the square, with the rows below it that share the vectors.
template <int W>
void factor_square(double* f, std::int64_t ld, int j, int k0, const double* threshold, Triangle& t) {
  constexpr int kV = kCols / kLanes;
  Vec x[kV][W] = {};
  accumulate<kV, W>(x, f + j + k0 * ld, ld, f + j + k0 * ld, ld, j - k0);
#pragma GCC unroll 8
  for (int w = 0; w < W; ++w) {
#pragma GCC unroll 8
    for (int v = 0; v < kV; ++v) x[v][w] = load(f + j + v * kLanes + (j + w) * ld) - x[v][w];
  }
#pragma GCC unroll 8
  for (int c = 0; c < W; ++c) {
    const double pivot = x[c / kLanes][c][c % kLanes];
    t.inverse[c] = pivot > threshold[c] ? 1.0 / std::sqrt(pivot) : 0.0;
#pragma GCC unroll 8
    for (int v = 0; v < kV; ++v) {
      x[v][c] *= t.inverse[c];
      store(f + j + v * kLanes + (j + c) * ld, x[v][c]);
    }
#pragma GCC unroll 8
    for (int e = c + 1; e < W; ++e) {
      t.l[e][c] = x[e / kLanes][c][e % kLanes];
#pragma GCC unroll 8
      for (int v = 0; v < kV; ++v) x[v][e] -= x[v][c] * t.l[e][c];
    }
  }
}

// Rows [r, end) of W columns from j on.
template <int W>
void solve_below(double* f, std::int64_t ld, int r, int end, int j, int k0, const Triangle& t) {
  for (; end - r > 2 * kLanes; r += 3 * kLanes) solve_rows<3, W>(f, ld, r, j, k0, t);
  if (end - r > kLanes)
    solve_rows<2, W>(f, ld, r, j, k0, t);
  else if (end - r > 0)
    solve_rows<1, W>(f, ld, r, j, k0, t);
}

// What there is to do with W columns.
struct ColumnKernels {
  void (*square)(double*, std::int64_t, int, int, const double*, Triangle&);
  void (*below)(double*, std::int64_t, int, int, int, int, const Triangle&);
};
template <int W>
constexpr ColumnKernels kKernelsOf = {factor_square<W>, solve_below<W>};

const ColumnKernels& kernels_of(int w) {
  static constexpr ColumnKernels kBy4[] = {kKernelsOf<1>, kKernelsOf<2>, kKernelsOf<3>, kKernelsOf<4>};
  if constexpr (kCols == 8) {
    static constexpr ColumnKernels kBy8[] = {kKernelsOf<5>, kKernelsOf<6>, kKernelsOf<7>, kKernelsOf<8>};
    if (w > 4) return kBy8[w - 5];
  }
  return kBy4[w - 1];
}

// Columns [k0, k1) of a panel, at most kPanelColumns of them.
class Strip {
 public:
  Strip(double* panel, std::int64_t ld, int k0, int k1) : panel_(panel), ld_(ld), k0_(k0), k1_(k1) {}

  // The rows at the diagonal: those of the columns, and what shares their vectors. Returns the first row below.
  int factor_diagonal(const double* threshold, double* inverse) {
    const int end = (k1_ + kCols - 1) / kCols * kCols;
    for (int j = k0_, g = 0; j < k1_; j += kCols, ++g) {
      const int w = std::min(kCols, k1_ - j);
      const ColumnKernels& kernels = kernels_of(w);
      kernels.square(panel_, ld_, j, k0_, threshold + j, triangles_[g]);
      std::copy_n(triangles_[g].inverse, w, inverse + j);
      kernels.below(panel_, ld_, j + kCols, end, j, k0_, triangles_[g]);
    }
    return end;
  }
  void solve_rows_below(int first, int end) const {
    for (int j = k0_, g = 0; j < k1_; j += kCols, ++g)
      kernels_of(std::min(kCols, k1_ - j)).below(panel_, ld_, first, end, j, k0_, triangles_[g]);
  }

 private:
  double* panel_;
  std::int64_t ld_;
  int k0_, k1_;
  Triangle triangles_[kPanelColumns / kCols];
};

}  // namespace

void factor_panel(double* panel, std::int64_t ld, int n, int p, const double* threshold, double* inverse_diagonal,
                  TaskPool* pool) {
  for (int k0 = 0; k0 < p; k0 += kPanelColumns) {
    const int k1 = std::min(k0 + kPanelColumns, p);
    Strip strip(panel, ld, k0, k1);
    const int below = strip.factor_diagonal(threshold, inverse_diagonal);
    for_each_row_tile(below, round_up_8(n), pool, [&](int r, int end) { strip.solve_rows_below(r, std::min(end, n)); });
    if (k1 == p) break;
    const double* a = panel + k0 * ld;
    all_row_tiles<false>({panel, ld, 0, 0}, a, ld, a, ld, k1, round_up_8(n), k1, p, k1 - k0, true, pool);
  }
}

void form_update(const double* panel, std::int64_t ld, int n, int p, double* update, std::int64_t update_ld,
                 TaskPool* pool) {
  const int row0 = round_down_8(p);
  all_row_tiles<true>({update, update_ld, row0, p}, panel, ld, panel, ld, row0, round_up_8(n), p, n, p, true, pool);
}

void syrk_lower_minus(double* c, std::int64_t ldc, int n, const double* a, std::int64_t lda, int k, TaskPool* pool) {
  all_row_tiles<false>({c, ldc, 0, 0}, a, lda, a, lda, 0, round_up_8(n), 0, n, k, true, pool);
}

void gemm_minus(double* c, std::int64_t ldc, int m, int n, const double* a, std::int64_t lda, const double* b,
                std::int64_t ldb, int k, TaskPool* pool) {
  all_row_tiles<false>({c, ldc, 0, 0}, a, lda, b, ldb, 0, round_up_8(m), 0, n, k, false, pool);
}

namespace {

// Rows of [j + w, n) that lie within the kCols rows from j: the corner that is handled by scalars, so that all vectors
// start on the grid.
int corner_end(int j, int n) { return std::min(j + kCols, n); }

template <int W>
void lower_columns(const double* l, std::int64_t ld, int n, int j, const double* inverse, double* v) {
  Vec y[W];
  const int corner = corner_end(j, n);
  for (int c = 0; c < W; ++c) {
    const double* column = l + (j + c) * ld;
    const double s = v[j + c] * inverse[j + c];
    v[j + c] = s;
    y[c] = s - Vec{};
    for (int r = j + c + 1; r < corner; ++r) v[r] -= column[r] * s;
  }
  for (int r = j + kCols; r < n; r += kLanes) {
    Vec x = load(v + r);
    const double* row = l + r + j * ld;
#pragma GCC unroll 8
    for (int c = 0; c < W; ++c) x -= load(row + c * ld) * y[c];
    store(v + r, x);
  }
}

template <int W>
void upper_columns(const double* l, std::int64_t ld, int n, int j, const double* inverse, double* v) {
  Vec acc[W] = {};
  for (int r = j + kCols; r < n; r += kLanes) {
    const Vec x = load(v + r);
    const double* row = l + r + j * ld;
#pragma GCC unroll 8
    for (int c = 0; c < W; ++c) acc[c] += load(row + c * ld) * x;
  }
  const int corner = corner_end(j, n);
  for (int c = W - 1; c >= 0; --c) {
    const double* column = l + (j + c) * ld;
    double s = v[j + c] - sum(acc[c]);
    for (int r = j + c + 1; r < corner; ++r) s -= column[r] * v[r];
    v[j + c] = s * inverse[j + c];
  }
}

template <template <int> class F>
auto by_width(int w) {
  switch (w) {
    case 1:
      return F<1>::call;
    case 2:
      return F<2>::call;
    case 3:
      return F<3>::call;
    case 4:
      return F<4>::call;
    case 5:
      return F<5>::call;
    case 6:
      return F<6>::call;
    case 7:
      return F<7>::call;
    default:
      return F<8>::call;
  }
}
template <int W>
struct Lower {
  static constexpr auto call = lower_columns<W>;
};
template <int W>
struct Upper {
  static constexpr auto call = upper_columns<W>;
};

}  // namespace

namespace {

// From this size on [numbers] a panel is solved in two parts, the rows of its pivots and those below.
constexpr std::int64_t kLargePanel = 20000;
constexpr int kSolveRows = 192, kSolveColumns = 16;  // a task's share of what is below

// Row of the first vector that holds no pivot's row.
int first_below(int n, int p) {
  const bool large = static_cast<std::int64_t>(n) * p >= kLargePanel;
  return large ? std::min(n, (p + kCols - 1) / kCols * kCols) : n;
}

// v -= L y for n rows and W columns.
template <int W>
void subtract_rows(const double* l, std::int64_t ld, int n, const double* y, double* v) {
  for (int r = 0; r < n; r += kLanes) {
    Vec x = load(v + r);
#pragma GCC unroll 8
    for (int c = 0; c < W; ++c) x -= load(l + r + c * ld) * y[c];
    store(v + r, x);
  }
}

// v1 -= Lᵀ v for W columns, v1 from column 0 on, and rows [0, n).
template <int W>
void subtract_columns(const double* l, std::int64_t ld, int n, const double* v, double* v1) {
  Vec acc[W] = {};
  for (int r = 0; r < n; r += kLanes) {
    const Vec x = load(v + r);
#pragma GCC unroll 8
    for (int c = 0; c < W; ++c) acc[c] += load(l + r + c * ld) * x;
  }
  for (int c = 0; c < W; ++c) v1[c] -= sum(acc[c]);
}

}  // namespace

void solve_panel_lower(const double* panel, std::int64_t ld, int n, int p, const double* inverse_diagonal, double* v,
                       TaskPool* pool) {
  const int below = first_below(n, p);
  for (int j = 0; j < p; j += kCols) by_width<Lower>(std::min(kCols, p - j))(panel, ld, below, j, inverse_diagonal, v);
  parallel_for(pool, (n - below + kSolveRows - 1) / kSolveRows, [&](int task, int) {
    const int r = below + task * kSolveRows, rows = std::min(kSolveRows, n - r);
    int j = 0;
    for (; p - j >= 8; j += 8) subtract_rows<8>(panel + r + j * ld, ld, rows, v + j, v + r);
    for (; j < p; ++j) subtract_rows<1>(panel + r + j * ld, ld, rows, v + j, v + r);
  });
}

void solve_panel_upper(const double* panel, std::int64_t ld, int n, int p, const double* inverse_diagonal, double* v,
                       TaskPool* pool) {
  const int below = first_below(n, p);
  parallel_for(pool, below < n ? (p + kSolveColumns - 1) / kSolveColumns : 0, [&](int task, int) {
    int j = task * kSolveColumns;
    const int end = std::min(j + kSolveColumns, p);
    for (; end - j >= 8; j += 8) subtract_columns<8>(panel + below + j * ld, ld, n - below, v + below, v + j);
    for (; j < end; ++j) subtract_columns<1>(panel + below + j * ld, ld, n - below, v + below, v + j);
  });
  for (int j = (p - 1) / kCols * kCols; j >= 0; j -= kCols)
    by_width<Upper>(std::min(kCols, p - j))(panel, ld, below, j, inverse_diagonal, v);
}

void add(double* y, const double* x, int n) {
  int i = 0;
  for (; i + kLanes <= n; i += kLanes) store(y + i, load(y + i) + load(x + i));
  for (; i < n; ++i) y[i] += x[i];
}

void copy(double* y, const double* x, int n) {
  int i = 0;
  for (; i + kLanes <= n; i += kLanes) store(y + i, load(x + i));
  for (; i < n; ++i) y[i] = x[i];
}

}  // namespace oriel::dense
