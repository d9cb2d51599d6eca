#include "oriel/window/echelon.h"

#include <algorithm>
#include <cmath>

#include "oriel/linear/dot.h"

namespace oriel {

int reduce_to_echelon(const StackedColumns& a, int from, int to, int end, int used, char* empty) {
  if (used == a.rows) std::fill(empty + from, empty + to, 1);
  for (int c = from; c < to && used < a.rows; ++c) {
    double* const v = a.column(c);
    const int left = a.rows - used;
    const double whole = std::sqrt(dot(v, v, a.rows)), norm = std::sqrt(dot(v + used, v + used, left));
    if (!(norm > kNegligibleColumn * whole)) {
      empty[c] = 1;
      std::fill(v + used, v + a.rows, 0.0);
      continue;
    }
    const double beta = v[used] > 0.0 ? -norm : norm, v0 = v[used] - beta, scale = 1.0 / (beta * v0);
    v[used] = v0;
    for (int j = c + 1; j < end; ++j) {
      double* const x = a.column(j) + used;
      const double s = scale * dot(v + used, x, left);
      if (s == 0.0) continue;
      for (int i = 0; i < left; ++i) x[i] += s * v[used + i];
    }
    v[used] = beta;
    std::fill(v + used + 1, v + a.rows, 0.0);
    if (++used == a.rows) std::fill(empty + c + 1, empty + to, 1);
  }
  return used;
}

void forget_rounding(double* x, int n, double whole) {
  for (int i = 0; i < n; ++i)
    if (!(std::fabs(x[i]) > kNegligibleColumn * whole)) x[i] = 0.0;
}

void forget_rounding(const StackedColumns& a, int from, int to, int first, int last) {
  for (int c = from; c < to; ++c) {
    double* const v = a.column(c);
    forget_rounding(v + first, last - first, std::sqrt(dot(v, v, a.rows)));
  }
}

void eliminate_rows(double* a, int n, int m, int columns, const double* whole) {
  const std::ptrdiff_t stride = n + m;
  for (int j = 0; j < n; ++j) {
    double* const v = a + j * stride;
    double* const low = v + n;
    const double squares = dot(low, low, m);
    if (!(std::sqrt(squares) > kNegligibleColumn * whole[j])) {
      std::fill_n(low, m, 0.0);
      continue;
    }
    const double norm = std::sqrt(v[j] * v[j] + squares), beta = v[j] > 0.0 ? -norm : norm;
    const double v0 = v[j] - beta, scale = 1.0 / (beta * v0);
    for (int c = j + 1; c < columns; ++c) {
      double* const x = a + c * stride;
      const double s = scale * (v0 * x[j] + dot(low, x + n, m));
      x[j] += s * v0;
      for (int i = 0; i < m; ++i) x[n + i] += s * low[i];
    }
    v[j] = beta;
    std::fill_n(low, m, 0.0);
  }
}

void solve_upper_minus(const double* R, int stride, int n, double* x) {
  for (int j = n - 1; j >= 0; --j) {
    const double* const column = R + static_cast<std::ptrdiff_t>(j) * stride;
    x[j] = column[j] != 0.0 ? -x[j] / column[j] : 0.0;
    for (int i = 0; i < j; ++i) x[i] += column[i] * x[j];
  }
}

}  // namespace oriel
