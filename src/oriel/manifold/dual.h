// Dual<N>: a value with its derivatives by N variables (forward mode; Griewank & Walther, Evaluating Derivatives, ch.
// 3). It gives the Jacobian of any residual that is written over its scalar; shipped residuals are analytic and are
// only checked against it.
#pragma once
#include <cmath>

namespace oriel {

template <int N>
struct Dual {
  double a;     // value
  double d[N];  // derivatives

  Dual() = default;
  constexpr Dual(double value) : a(value), d{} {}  // NOLINT(google-explicit-constructor): a constant in a formula
  static constexpr Dual variable(double value, int i) {
    Dual x(value);
    x.d[i] = 1.0;
    return x;
  }
  // f(x) with f'(x) = slope.
  constexpr Dual chain(double value, double slope) const {
    Dual y(value);
    for (int i = 0; i < N; ++i) y.d[i] = slope * d[i];
    return y;
  }

  friend constexpr Dual operator+(const Dual& x, const Dual& y) {
    Dual z(x.a + y.a);
    for (int i = 0; i < N; ++i) z.d[i] = x.d[i] + y.d[i];
    return z;
  }
  friend constexpr Dual operator-(const Dual& x, const Dual& y) {
    Dual z(x.a - y.a);
    for (int i = 0; i < N; ++i) z.d[i] = x.d[i] - y.d[i];
    return z;
  }
  friend constexpr Dual operator-(const Dual& x) { return x.chain(-x.a, -1.0); }
  friend constexpr Dual operator*(const Dual& x, const Dual& y) {
    Dual z(x.a * y.a);
    for (int i = 0; i < N; ++i) z.d[i] = x.d[i] * y.a + x.a * y.d[i];
    return z;
  }
  friend constexpr Dual operator/(const Dual& x, const Dual& y) {
    const double inverse = 1.0 / y.a, q = x.a * inverse;
    Dual z(q);
    for (int i = 0; i < N; ++i) z.d[i] = (x.d[i] - q * y.d[i]) * inverse;
    return z;
  }
  Dual& operator+=(const Dual& y) { return *this = *this + y; }
  Dual& operator-=(const Dual& y) { return *this = *this - y; }
  Dual& operator*=(const Dual& y) { return *this = *this * y; }
  Dual& operator/=(const Dual& y) { return *this = *this / y; }
  friend constexpr bool operator<(const Dual& x, const Dual& y) { return x.a < y.a; }
  friend constexpr bool operator>(const Dual& x, const Dual& y) { return x.a > y.a; }
  friend constexpr bool operator<=(const Dual& x, const Dual& y) { return x.a <= y.a; }
  friend constexpr bool operator>=(const Dual& x, const Dual& y) { return x.a >= y.a; }
  friend constexpr bool operator==(const Dual& x, const Dual& y) { return x.a == y.a; }
};

template <int N>
Dual<N> sqrt(const Dual<N>& x) {
  const double s = std::sqrt(x.a);
  return x.chain(s, 0.5 / s);
}
template <int N>
Dual<N> sin(const Dual<N>& x) {
  return x.chain(std::sin(x.a), std::cos(x.a));
}
template <int N>
Dual<N> cos(const Dual<N>& x) {
  return x.chain(std::cos(x.a), -std::sin(x.a));
}
template <int N>
Dual<N> tan(const Dual<N>& x) {
  const double t = std::tan(x.a);
  return x.chain(t, 1.0 + t * t);
}
template <int N>
Dual<N> exp(const Dual<N>& x) {
  const double e = std::exp(x.a);
  return x.chain(e, e);
}
template <int N>
Dual<N> log(const Dual<N>& x) {
  return x.chain(std::log(x.a), 1.0 / x.a);
}
template <int N>
Dual<N> abs(const Dual<N>& x) {
  return x.a < 0 ? -x : x;
}
template <int N>
Dual<N> pow(const Dual<N>& x, double p) {
  return x.chain(std::pow(x.a, p), p * std::pow(x.a, p - 1.0));
}
template <int N>
Dual<N> atan2(const Dual<N>& y, const Dual<N>& x) {
  const double n = x.a * x.a + y.a * y.a;
  Dual<N> z(std::atan2(y.a, x.a));
  for (int i = 0; i < N; ++i) z.d[i] = (x.a * y.d[i] - y.a * x.d[i]) / n;
  return z;
}

// The value under the derivatives: for tests of where a point lies, not for formulas.
inline double value_of(double x) { return x; }
template <int N>
double value_of(const Dual<N>& x) {
  return x.a;
}

}  // namespace oriel
