#include "oriel/residual/linear_prior.h"

#include <algorithm>
#include <cmath>

namespace oriel {
namespace {

// Reflects rows [k, m) so that column c of them becomes (β, 0, ..., 0), in all of A (m × n) and in d.
// Golub & Van Loan, Matrix Computations, algorithm 5.1.1.
// False, and nothing done, if what is left of the column is rounding error (≤ `negligible`).
bool reflect(double* A, int m, int n, int k, int c, double negligible, double* d) {
  double* v = A + static_cast<std::size_t>(c) * m;
  double tail = 0.0;
  for (int i = k; i < m; ++i) tail += v[i] * v[i];
  const double norm = std::sqrt(tail);
  if (!(norm > negligible)) return false;
  const double beta = v[k] > 0.0 ? -norm : norm, v0 = v[k] - beta, scale = -1.0 / (beta * v0);
  v[k] = v0;
  auto apply = [&](double* x) {
    double s = 0.0;
    for (int i = k; i < m; ++i) s += v[i] * x[i];
    s *= scale;
    for (int i = k; i < m; ++i) x[i] -= s * v[i];
  };
  for (int j = 0; j < n; ++j)
    if (j != c) apply(A + static_cast<std::size_t>(j) * m);
  apply(d);
  v[k] = beta;
  std::fill(v + k + 1, v + m, 0.0);
  return true;
}

constexpr double kNegligible = 1e-13;  // of a column, against all of it: rounding error

// The norm of a column, which reflections keep.
double norm_of(const std::vector<double>& R, int rows, int column) {
  double norm = 0.0;
  for (int i = 0; i < rows; ++i) norm = std::hypot(norm, R[static_cast<std::size_t>(column) * rows + i]);
  return norm;
}

}  // namespace

int marginalize_columns(int rows, int cols, const std::vector<char>& leaves, std::vector<double>& R,
                        std::vector<double>& d) {
  int used = 0;
  for (int j = 0; j < cols && used < rows; ++j) {
    if (!leaves[j]) continue;
    if (reflect(R.data(), rows, cols, used, j, kNegligible * norm_of(R, rows, j), d.data())) ++used;
  }
  // Rounding error would tie the rest to a variable of which nothing is known any more, and leave with it.
  for (int j = 0; j < cols; ++j) {
    double* const column = R.data() + static_cast<std::ptrdiff_t>(j) * rows;
    const double least = kNegligible * norm_of(R, rows, j);
    for (int i = used; i < rows && !leaves[j]; ++i)
      if (!(std::fabs(column[i]) > least)) column[i] = 0.0;
  }
  auto end = R.begin();  // of what is kept, which moves down in place
  for (int j = 0; j < cols; ++j)
    if (!leaves[j])
      end = std::copy(R.begin() + j * static_cast<std::ptrdiff_t>(rows) + used,
                      R.begin() + (j + 1) * static_cast<std::ptrdiff_t>(rows), end);
  d.erase(d.begin(), d.begin() + used);
  R.erase(end, R.end());
  return rows - used;
}

}  // namespace oriel
