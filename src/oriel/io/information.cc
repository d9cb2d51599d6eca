#include "oriel/io/information.h"

#include <algorithm>
#include <cmath>

namespace oriel {
namespace {

constexpr int kMost = 6;

struct Square {
  double a[kMost][kMost];
  int n;
  Square(const double* upper, int size) : n(size) {
    for (int i = 0; i < n; ++i)
      for (int j = i; j < n; ++j) a[i][j] = a[j][i] = *upper++;
  }
  void store(double* upper) const {
    for (int i = 0; i < n; ++i)
      for (int j = i; j < n; ++j) *upper++ = a[i][j];
  }
};

bool bring_to_unit_diagonal(Square& m) {
  double s[kMost];
  for (int i = 0; i < m.n; ++i) {
    if (m.a[i][i] < 0) return false;
    s[i] = m.a[i][i] > 0 ? 1 / std::sqrt(m.a[i][i]) : 0;
  }
  for (int i = 0; i < m.n; ++i)
    for (int j = 0; j < m.n; ++j) {
      if (m.a[i][j] != 0 && (s[i] == 0 || s[j] == 0)) return false;
      m.a[i][j] *= s[i] * s[j];
    }
  return true;
}

// What nearly every edge has. Written without a branch that depends on the entries.
bool diagonal_and_positive(const double* upper, int n) {
  bool fits = true;
  for (int i = 0; i < n; ++i) {
    fits &= *upper++ >= 0;
    for (int j = i + 1; j < n; ++j) fits &= *upper++ == 0;
  }
  return fits;
}

// LDLᵀ with the largest remaining diagonal entry as pivot (Golub & Van Loan, Matrix Computations, 4.2.8), on the matrix
// scaled to a unit diagonal, so that metres and radians count alike. What remains when the pivots are used up must be
// zero to rounding.
bool pivots_are_positive(Square m) {
  constexpr double kRounding = 1e-9;
  if (!bring_to_unit_diagonal(m)) return false;
  bool used[kMost] = {};
  for (int k = 0; k < m.n; ++k) {
    int p = -1;
    for (int i = 0; i < m.n; ++i)
      if (!used[i] && (p < 0 || m.a[i][i] > m.a[p][p])) p = i;
    if (!(m.a[p][p] > kRounding)) break;
    used[p] = true;
    const double inverse = 1 / m.a[p][p];
    for (int j = 0; j < m.n; ++j) {
      if (used[j]) continue;
      for (int i = 0; i < m.n; ++i)
        if (!used[i]) m.a[i][j] -= m.a[i][p] * inverse * m.a[p][j];
    }
  }
  for (int i = 0; i < m.n; ++i)
    for (int j = 0; j < m.n; ++j)
      if (!used[i] && !used[j] && !(std::abs(m.a[i][j]) <= kRounding)) return false;
  return true;
}

// One rotation of the cyclic Jacobi method (Golub & Van Loan, 8.5.2): a[p][q] becomes zero.
void rotate(Square& m, double v[kMost][kMost], int p, int q) {
  if (m.a[p][q] == 0) return;
  const double tau = (m.a[q][q] - m.a[p][p]) / (2 * m.a[p][q]);
  const double t = std::isinf(tau) ? 0 : (tau >= 0 ? 1 : -1) / (std::abs(tau) + std::hypot(1.0, tau));
  const double c = 1 / std::sqrt(1 + t * t), s = t * c;
  for (int k = 0; k < m.n; ++k) {
    const double x = m.a[k][p], y = m.a[k][q];
    m.a[k][p] = c * x - s * y, m.a[k][q] = s * x + c * y;
  }
  for (int k = 0; k < m.n; ++k) {
    const double x = m.a[p][k], y = m.a[q][k];
    m.a[p][k] = c * x - s * y, m.a[q][k] = s * x + c * y;
  }
  for (int k = 0; k < m.n; ++k) {
    const double x = v[k][p], y = v[k][q];
    v[k][p] = c * x - s * y, v[k][q] = s * x + c * y;
  }
}

}  // namespace

bool positive_semidefinite(const double* upper, int n) {
  return diagonal_and_positive(upper, n) || pivots_are_positive(Square(upper, n));
}

void project_to_semidefinite(double* upper, int n) {
  Square m(upper, n);
  double largest = 0;  // entries are brought to at most 1: their squares must not overflow
  for (int k = 0; k < n * (n + 1) / 2; ++k) largest = std::max(largest, std::abs(upper[k]));
  if (largest == 0) return;
  double v[kMost][kMost] = {};
  for (int i = 0; i < n; ++i) {
    v[i][i] = 1;
    for (int j = 0; j < n; ++j) m.a[i][j] /= largest;
  }
  constexpr int kSweeps = 30;  // convergence is quadratic; six do for matrices of this size
  for (int sweep = 0; sweep < kSweeps; ++sweep)
    for (int p = 0; p < n; ++p)
      for (int q = p + 1; q < n; ++q) rotate(m, v, p, q);
  double top = 0, lambda[kMost];
  for (int k = 0; k < n; ++k) top = std::max(top, m.a[k][k]);
  for (int k = 0; k < n; ++k) lambda[k] = std::max(m.a[k][k], 1e-13 * top);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      m.a[i][j] = 0;
      for (int k = 0; k < n; ++k) m.a[i][j] += largest * v[i][k] * lambda[k] * v[j][k];
    }
  m.store(upper);
}

void square_root_information(double* upper, int n) {
  const Square w(upper, n);
  for (int i = 0; i < n; ++i)
    for (int j = i; j < n; ++j) {
      double sum = 0;
      for (int k = 0; k <= i; ++k) sum += w.a[k][i] * w.a[k][j];  // row k of W begins at column k ≤ i ≤ j
      *upper++ = sum;
    }
}

// Cholesky Σ = L Lᵀ, then Σ⁻¹ = L⁻ᵀ L⁻¹.
bool invert_covariance(double* upper, int n) {
  const Square sigma(upper, n);
  double L[kMost][kMost] = {}, inverse[kMost][kMost] = {};
  for (int j = 0; j < n; ++j)
    for (int i = j; i < n; ++i) {
      double sum = sigma.a[i][j];
      for (int k = 0; k < j; ++k) sum -= L[i][k] * L[j][k];
      if (i == j && !(sum > 0)) return false;
      L[i][j] = i == j ? std::sqrt(sum) : sum / L[j][j];
    }
  for (int j = 0; j < n; ++j)
    for (int i = j; i < n; ++i) {
      double sum = i == j ? 1 : 0;
      for (int k = j; k < i; ++k) sum -= L[i][k] * inverse[k][j];
      inverse[i][j] = sum / L[i][i];
    }
  for (int i = 0; i < n; ++i)
    for (int j = i; j < n; ++j) {
      double sum = 0;
      for (int k = j; k < n; ++k) sum += inverse[k][i] * inverse[k][j];
      *upper++ = sum;
    }
  return true;
}

void scale_information(double* upper, int n, const double* d) {
  for (int i = 0; i < n; ++i)
    for (int j = i; j < n; ++j) *upper++ *= d[i] * d[j];
}

}  // namespace oriel
