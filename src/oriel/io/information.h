// Information matrices as files hold them: the upper triangle, row by row, of an n × n matrix, n from 1 to 6.
#pragma once
#include "oriel/base/matrix.h"

namespace oriel {

template <int N>
Mat<double, N, N> from_upper(const double* upper) {
  Mat<double, N, N> a;
  for (int i = 0; i < N; ++i)
    for (int j = i; j < N; ++j) a(i, j) = a(j, i) = *upper++;
  return a;
}

// rᵀ Ω r, with the information as written: where nothing is linearized its root is not needed.
template <int N>
double squared_norm(const Vec<double, N>& r, const Mat<double, N, N>& information) {
  double sum = 0.0;
  for (int j = 0; j < N; ++j)
    for (int i = 0; i < N; ++i) sum += r[i] * information(i, j) * r[j];
  return sum;
}

// To rounding, whatever the units of its rows.
bool positive_semidefinite(const double* upper, int n);

// The nearest positive semidefinite matrix in the Frobenius norm: its negative eigenvalues become zero (Higham,
// Computing a nearest symmetric positive semidefinite matrix, 1988, Theorem 2.1), or rather 1e-13 of the largest one,
// so that rounding makes none negative again.
void project_to_semidefinite(double* upper, int n);

// From the upper triangular root W, as the iSAM formats have it: WᵀW.
void square_root_information(double* upper, int n);

// From a covariance: its inverse. False, and nothing is changed, where it is not positive definite.
bool invert_covariance(double* upper, int n);

// D Ω D: what the information says of residuals that are 1/d as large. Files that state angles are brought to half
// angles (the vector part of a quaternion) by d = 2.
void scale_information(double* upper, int n, const double* d);

}  // namespace oriel
