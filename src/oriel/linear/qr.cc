#include "oriel/linear/qr.h"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <numeric>

#include "oriel/linear/dense_kernels.h"
#include "oriel/linear/dense_tile.h"

namespace oriel {
namespace {

using dense::kLanes;
using dense::load;
using dense::store;
using dense::Vec;

constexpr int kBlock = 8;  // reflections that are applied together

double dot(const double* x, const double* y, int n) {
  Vec s = {};
  for (int i = 0; i < n; i += kLanes) s += load(x + i) * load(y + i);
  return dense::sum(s);
}

void subtract(double* y, const double* x, double factor, int n) {
  for (int i = 0; i < n; i += kLanes) store(y + i, load(y + i) - load(x + i) * (factor - Vec{}));
}

// One block of up to eight reflections H_i = I - τ_i v_i v_iᵀ, product I - V T Vᵀ. Rows count from the block's first.
struct Reflections {
  double* v;  // rows × 8, unit lower trapezoidal, zeros above; padded as all matrices here
  int rows;   // padded
  int count;
  double t[kBlock][kBlock];  // T, upper triangular

  const double* column(int i) const { return v + static_cast<std::int64_t>(i) * rows; }
  double* column(int i) { return v + static_cast<std::int64_t>(i) * rows; }
};

// The reflection that maps x (n values from row `at` on) to β e: v into `v`, returns τ; x := β e.
double reflect(double* x, int at, int rows, double* v) {
  std::copy_n(x, rows, v);
  std::fill_n(v, at, 0.0);
  const double alpha = v[at];
  const double scale = std::accumulate(v, v + rows, 0.0, [](double s, double e) { return std::max(s, std::abs(e)); });
  v[at] = 1.0;
  std::fill(x + at + 1, x + rows, 0.0);
  if (scale == 0.0) return 0.0;
  double squares = (alpha / scale) * (alpha / scale);
  for (int i = at + 1; i < rows; ++i) squares += (v[i] / scale) * (v[i] / scale);
  const double beta = -std::copysign(scale * std::sqrt(squares), alpha);
  for (int i = at + 1; i < rows; ++i) v[i] /= alpha - beta;
  x[at] = beta;
  return (beta - alpha) / beta;
}

// T column by column: T(0:i, i) = -τ_i T(0:i, 0:i) Vᵀ v_i.
void extend_triangle(Reflections& q, int i, double tau) {
  double w[kBlock];
  for (int k = 0; k < i; ++k) w[k] = dot(q.column(k), q.column(i), q.rows);
  for (int k = 0; k < i; ++k) {
    double s = 0.0;
    for (int l = k; l < i; ++l) s += q.t[k][l] * w[l];
    q.t[k][i] = -tau * s;
  }
  q.t[i][i] = tau;
}

// w = Tᵀ Vᵀ c of one column.
void coefficients(const Reflections& q, const double* c, double* w) {
  Vec acc[kBlock] = {};
  for (int r = 0; r < q.rows; r += kLanes) {
    const Vec x = load(c + r);
#pragma GCC unroll 8
    for (int i = 0; i < kBlock; ++i) acc[i] += load(q.v + r + static_cast<std::int64_t>(i) * q.rows) * x;
  }
  for (int i = q.count - 1; i >= 0; --i) {
    double s = 0.0;
    for (int l = 0; l <= i; ++l) s += q.t[l][i] * dense::sum(acc[l]);
    w[i] = s;
  }
}

// C := (I - V T Vᵀ)ᵀ C for n columns; w: n × 8.
void apply(const Reflections& q, double* c, std::int64_t ldc, int n, double* w) {
  for (int j = 0; j < n; ++j) {
    double column[kBlock];
    coefficients(q, c + j * ldc, column);
    for (int i = 0; i < q.count; ++i) w[j + static_cast<std::int64_t>(i) * n] = column[i];
  }
  dense::gemm_minus(c, ldc, q.rows, n, q.v, q.rows, w, n, q.count);
}

void factor_block(Reflections& q, double* a, std::int64_t lda) {
  for (int i = 0; i < q.count; ++i) {
    const double tau = reflect(a + i * lda, i, q.rows, q.column(i));
    for (int j = i + 1; j < q.count; ++j)
      subtract(a + j * lda, q.column(i), tau * dot(q.column(i), a + j * lda, q.rows), q.rows);
    extend_triangle(q, i, tau);
  }
}

bool all_finite(const double* x, std::int64_t ld, int m, int n) {
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < m; ++i)
      if (!std::isfinite(x[i + j * ld])) return false;
  return true;
}

}  // namespace

std::int64_t qr_workspace_size(int m, int n) {
  return static_cast<std::int64_t>(kBlock) * (dense::round_up_8(m) + dense::round_up_8(n) + 8);
}

bool householder_qr(double* a, std::int64_t lda, int m, int n, double* b, double* workspace) {
  const int padded = dense::round_up_8(m);
  double* const w = workspace + static_cast<std::int64_t>(kBlock) * padded;
  for (int j = 0; j < std::min(m, n); j += kBlock) {
    Reflections q{workspace, padded - j, std::min({kBlock, m - j, n - j}), {}};
    std::fill_n(q.v, static_cast<std::int64_t>(kBlock) * q.rows, 0.0);
    double* const corner = a + j + j * lda;
    factor_block(q, corner, lda);
    apply(q, corner + q.count * lda, lda, n - j - q.count, w);
    if (b != nullptr) apply(q, b + j, padded, 1, w);
  }
  return all_finite(a, lda, std::min(m, n), n) && (b == nullptr || all_finite(b, padded, m, 1));
}

std::int64_t square_root_workspace_size(int n) { return 3 * static_cast<std::int64_t>(n); }

SquareRoot square_root_of_information(double* h, std::int64_t ldh, int n, double* g, double relative_pivot, double* r,
                                      std::int64_t ldr, double* d, double* workspace) {
  double* const diagonal = workspace;
  double* const threshold = workspace + n;
  double* const inverse = workspace + 2 * static_cast<std::int64_t>(n);
  SquareRoot result;
  for (int j = 0; j < n; ++j) {
    diagonal[j] = h[j + j * ldh];
    threshold[j] = std::max(relative_pivot * diagonal[j], DBL_MIN);
  }
  dense::factor_panel(h, ldh, n, n, threshold, inverse);
  dense::solve_panel_lower(h, ldh, n, n, inverse, g);
  for (int j = 0; j < n; ++j) {
    const double root = h[j + j * ldh];
    if (!std::isfinite(root) || !std::isfinite(diagonal[j]) || !std::isfinite(g[j])) result.finite = false;
    if (inverse[j] == 0.0) continue;
    result.smallest_ratio = std::min(result.smallest_ratio, root * root / diagonal[j]);
    for (int c = 0; c < n; ++c) r[result.rank + c * ldr] = c < j ? 0.0 : h[c + j * ldh];
    d[result.rank++] = g[j];
  }
  return result;
}

}  // namespace oriel
