// Noise of a measurement, kept as what whitens it: r_white = W r with WᵀW the information. Three shapes, each a type of
// its own, so that a table of factors holds only what its rows need.
#pragma once
#include <array>
#include <cmath>
#include <limits>
#include <string_view>

#include "oriel/base/matrix.h"

namespace oriel {

// W = w·I.
struct IsotropicNoise {
  static constexpr std::string_view kName = "isotropic";
  double w = 1.0;  // 1/σ

  bool valid() const { return std::isfinite(w) && w >= 0.0; }
  template <class S, int N, int C>
  static void whiten(const std::array<S, 1>& noise, Mat<S, N, C>& a) {
    a *= noise[0];
  }
};

// W = diag(w).
template <int N>
struct DiagonalNoise {
  static constexpr std::string_view kName = "diagonal";
  Vec<double, N> w;  // 1/σ of each component

  bool valid() const {
    for (int i = 0; i < N; ++i)
      if (!std::isfinite(w[i]) || w[i] < 0.0) return false;
    return true;
  }
  template <class S, int C>
  static void whiten(const std::array<S, N>& noise, Mat<S, N, C>& a) {
    for (int j = 0; j < C; ++j)
      for (int i = 0; i < N; ++i) a(i, j) = a(i, j) * noise[i];
  }
};

// W upper triangular: row i holds columns i..N-1, one row after the other.
template <int N>
struct FullNoise {
  static constexpr std::string_view kName = "full";
  static constexpr int kEntries = N * (N + 1) / 2;
  std::array<double, kEntries> w;

  bool valid() const {
    for (double x : w)
      if (!std::isfinite(x)) return false;
    return true;
  }
  template <class S, int C>
  static void whiten(const std::array<S, kEntries>& noise, Mat<S, N, C>& a) {
    int e = 0;
    for (int i = 0; i < N; ++i) {  // row i reads rows ≥ i only, so a may be overwritten on the way down
      S s[C];                      // all columns side by side: no sum waits for the one before
#pragma GCC unroll 9
      for (int j = 0; j < C; ++j) s[j] = noise[e] * a(i, j);
      for (int k = i + 1; k < N; ++k)
#pragma GCC unroll 9
        for (int j = 0; j < C; ++j) s[j] = s[j] + noise[e + k - i] * a(k, j);
#pragma GCC unroll 9
      for (int j = 0; j < C; ++j) a(i, j) = s[j];
      e += N - i;
    }
  }
};

namespace detail {
inline constexpr double kNotANoise =
    std::numeric_limits<double>::quiet_NaN();  // refused by apply, with the factor named

// Upper W with WᵀW = information, for positive semidefinite information; entries NaN where it is indefinite. Every
// pivot is judged by its own diagonal entry: units differ (1/m², 1/rad²), and a weak direction is not an empty one.
template <int N>
FullNoise<N> whitener_of(Mat<double, N, N> a) {
  constexpr double kRounding = 1e-12, kOffDiagonal = 1e-6;
  FullNoise<N> noise;
  double diagonal[N];
  for (int i = 0; i < N; ++i) diagonal[i] = a(i, i);
  int e = 0;
  bool ok = true;
  for (int i = 0; i < N; ++i) {
    const double pivot = a(i, i), tolerance = kRounding * diagonal[i];
    const bool empty = pivot <= tolerance;  // a direction without information: its row must vanish too
    const double root = empty ? 0.0 : std::sqrt(pivot);
    ok = ok && std::isfinite(pivot) && diagonal[i] >= 0.0 && pivot >= -tolerance;
    for (int k = i; k < N; ++k) {
      noise.w[e++] = empty ? 0.0 : a(i, k) / root;
      if (empty && k > i)
        ok = ok && std::fabs(a(i, k)) <= kOffDiagonal * std::sqrt(diagonal[i]) * std::sqrt(std::fmax(diagonal[k], 0.0));
    }
    if (empty) continue;
    for (int j = i + 1; j < N; ++j)
      for (int k = j; k < N; ++k) a(j, k) -= a(i, j) * a(i, k) / pivot;
  }
  if (!ok) noise.w.fill(kNotANoise);
  return noise;
}
}  // namespace detail

// What a user writes; apply refuses a factor whose noise is not valid (σ ≤ 0, NaN, indefinite) and names it.
inline IsotropicNoise Sigma(double sigma) { return {sigma > 0.0 ? 1.0 / sigma : detail::kNotANoise}; }
template <int N>
DiagonalNoise<N> Sigmas(const Vec<double, N>& sigma) {
  DiagonalNoise<N> n;
  for (int i = 0; i < N; ++i) n.w[i] = sigma[i] > 0.0 ? 1.0 / sigma[i] : detail::kNotANoise;
  return n;
}
// Information (inverse covariance), symmetric positive semidefinite; only its upper triangle is read.
template <int N>
FullNoise<N> Information(const Mat<double, N, N>& information) {
  return detail::whitener_of(information);
}
// W itself, upper triangular; what lies below the diagonal is not read.
template <int N>
FullNoise<N> SqrtInformation(const Mat<double, N, N>& w) {
  FullNoise<N> n;
  int e = 0;
  for (int i = 0; i < N; ++i)
    for (int j = i; j < N; ++j) n.w[e++] = w(i, j);
  return n;
}
// Covariance, symmetric positive definite; only its upper triangle is read. Factored from its last row up, Σ = U Uᵀ
// with U upper triangular, so that W = U⁻¹ is upper triangular at once and the information is never formed.
template <int N>
FullNoise<N> Covariance(const Mat<double, N, N>& covariance) {
  Mat<double, N, N> U = Mat<double, N, N>::zero(), W = Mat<double, N, N>::zero();
  for (int j = N - 1; j >= 0; --j) {
    double pivot = covariance(j, j);
    for (int k = j + 1; k < N; ++k) pivot -= U(j, k) * U(j, k);
    U(j, j) = std::sqrt(pivot);  // NaN or zero where it is not positive definite: then the noise is not valid
    for (int i = 0; i < j; ++i) {
      double s = covariance(i, j);
      for (int k = j + 1; k < N; ++k) s -= U(i, k) * U(j, k);
      U(i, j) = s / U(j, j);
    }
  }
  for (int j = 0; j < N; ++j)
    for (int i = j; i >= 0; --i) {
      double s = i == j ? 1.0 : 0.0;
      for (int k = i + 1; k <= j; ++k) s -= U(i, k) * W(k, j);
      W(i, j) = s / U(i, i);
    }
  return SqrtInformation(W);
}

}  // namespace oriel
