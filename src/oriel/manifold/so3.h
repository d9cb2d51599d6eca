// SO(3): rotations as Hamilton unit quaternions; retraction on the right, R ⊞ φ = R·Exp(φ), φ in [rad].
// Formulas: Solà, Deray, Atchuthan, "A micro Lie theory for state estimation in robotics", arXiv:1812.01537 (cited as
// [ML] with its equation numbers), Appendix B.
#pragma once
#include "oriel/base/pack.h"
#include "oriel/manifold/manifold.h"

namespace oriel {

// hat(a) b = a × b.
template <class S>
Mat<S, 3, 3> hat(const Vec<S, 3>& a) {
  const S o(0.0);
  return {{o, a[2], -a[1], -a[2], o, a[0], a[1], -a[0], o}};
}

// M·hat(a) without the products by hat's zeros: row i is M_i × a.
template <class S, int R>
Mat<S, R, 3> times_hat(const Mat<S, R, 3>& M, const Vec<S, 3>& a) {
  Mat<S, R, 3> out;
#pragma GCC unroll 16
  for (int i = 0; i < R; ++i) {
    out(i, 0) = M(i, 1) * a[2] - M(i, 2) * a[1];
    out(i, 1) = M(i, 2) * a[0] - M(i, 0) * a[2];
    out(i, 2) = M(i, 0) * a[1] - M(i, 1) * a[0];
  }
  return out;
}

// Aᵀ·B without forming Aᵀ.
template <class S, int K, int R, int C>
Mat<S, R, C> transposed_times(const Mat<S, K, R>& A, const Mat<S, K, C>& B) {
  Mat<S, R, C> out;
#pragma GCC unroll 16
  for (int j = 0; j < C; ++j)
#pragma GCC unroll 16
    for (int i = 0; i < R; ++i) {
      S s = A(0, i) * B(0, j);
#pragma GCC unroll 16
      for (int k = 1; k < K; ++k) s = s + A(k, i) * B(k, j);
      out(i, j) = s;
    }
  return out;
}

namespace so3_detail {
// Series below this squared angle keep every coefficient good to the last digits where the closed forms cancel.
inline constexpr double kSeries = 0.25;
// Σ (-1)^k t^k / (2k + n)!, k = 0..7: n = 0 cos, 1 sin(θ)/θ, 2 (1-cos θ)/θ², 3 (θ-sin θ)/θ³ ..., with t = θ².
constexpr std::array<double, 8> alternating_coefficients(int n) {
  std::array<double, 8> c{};
  double f = 1.0;
  for (int i = 2; i <= n; ++i) f /= i;
  for (int k = 0; k < 8; ++k) {
    c[k] = f;
    f = -f / ((2 * k + n + 1.0) * (2 * k + n + 2.0));
  }
  return c;
}
template <int N, class S>
S alternating(const S& t) {
  constexpr std::array<double, 8> c = alternating_coefficients(N);
  S s(c[7]);
  for (int k = 6; k >= 0; --k) s = s * t + S(c[k]);
  return s;
}
}  // namespace so3_detail

// Coefficients of the exponential and its derivative at θ² = t: A = sin θ/θ, B = (1-cos θ)/θ², C = (θ-sin θ)/θ³.
template <class S>
struct ExpCoefficients {
  S A, B, C;
  explicit ExpCoefficients(const S& t) {
    using so3_detail::alternating;
    using std::cos, std::sin, std::sqrt;
    const auto small = t < S(so3_detail::kSeries);
    const S safe = select(small, S(1.0), t);
    const S theta = sqrt(safe), s = sin(theta), half = sin(theta * S(0.5));
    A = select(small, alternating<1>(t), s / theta);
    B = select(small, alternating<2>(t), S(2.0) * half * half / safe);
    C = select(small, alternating<3>(t), (theta - s) / (safe * theta));
  }
};

template <class S>
struct Rot3 {
  static constexpr std::string_view kName = "rot3/1";
  static constexpr int kDim = 3;
  static constexpr std::array<std::string_view, 3> kTangentNames = {"rotation x [rad]", "rotation y [rad]",
                                                                    "rotation z [rad]"};
  template <class T>
  using rebind = Rot3<T>;

  S qx = S(0.0), qy = S(0.0), qz = S(0.0), qw = S(1.0);  // unit quaternion

  static Rot3 from_quaternion(const S& w, const S& x, const S& y, const S& z) { return Rot3{x, y, z, w}.normalized(); }
  Vec<S, 3> vec() const { return {{qx, qy, qz}}; }
  Rot3 normalized() const {
    using std::sqrt;
    const S k = S(1.0) / sqrt(qx * qx + qy * qy + qz * qz + qw * qw);
    return {qx * k, qy * k, qz * k, qw * k};
  }
  // The quaternion of the two that has w ≥ 0.
  Rot3 positive() const {
    const S k = select(qw < S(0.0), S(-1.0), S(1.0));
    return {qx * k, qy * k, qz * k, qw * k};
  }

  // Exp, [ML] eq. 132-134 over quaternions; φ [rad].
  static Rot3 exp(const Vec<S, 3>& phi) {
    using so3_detail::alternating;
    using std::cos, std::sin, std::sqrt;
    const S t = phi.squared_norm() * S(0.25);  // (θ/2)²
    const auto small = t < S(so3_detail::kSeries);
    const S half = sqrt(select(small, S(1.0), t));
    const S k = S(0.5) * select(small, alternating<1>(t), sin(half) / half);
    const S w = select(small, alternating<0>(t), cos(half));
    return {k * phi[0], k * phi[1], k * phi[2], w};
  }
  // Log, [ML] eq. 135; the angle lies in [0, π].
  Vec<S, 3> log() const {
    using std::atan2, std::sqrt;
    const Rot3 q = positive();
    const S n2 = q.vec().squared_norm();
    const auto small = n2 < S(1e-10);
    const S n = sqrt(select(small, S(1.0), n2));
    const S inv_w = S(1.0) / select(small, q.qw, S(1.0)), u = n2 * inv_w * inv_w;
    const S near = S(2.0) * inv_w * (S(1.0) - u * (S(1.0 / 3.0) - u * S(0.2)));
    return q.vec() * select(small, near, S(2.0) * atan2(n, q.qw) / n);
  }
  Rot3 inverse() const { return {-qx, -qy, -qz, qw}; }
  friend Rot3 operator*(const Rot3& a, const Rot3& b) {
    return {
        a.qw * b.qx + a.qx * b.qw + a.qy * b.qz - a.qz * b.qy, a.qw * b.qy - a.qx * b.qz + a.qy * b.qw + a.qz * b.qx,
        a.qw * b.qz + a.qx * b.qy - a.qy * b.qx + a.qz * b.qw, a.qw * b.qw - a.qx * b.qx - a.qy * b.qy - a.qz * b.qz};
  }
  Vec<S, 3> operator*(const Vec<S, 3>& p) const {
    const Vec<S, 3> u = cross(vec(), p) * S(2.0);
    return p + u * qw + cross(vec(), u);
  }
  Mat<S, 3, 3> matrix() const {
    const S x2 = qx + qx, y2 = qy + qy, z2 = qz + qz;
    const S xx = qx * x2, yy = qy * y2, zz = qz * z2, xy = qx * y2, xz = qx * z2, yz = qy * z2;
    const S wx = qw * x2, wy = qw * y2, wz = qw * z2, one(1.0);
    return {{one - yy - zz, xy + wz, xz - wy, xy - wz, one - xx - zz, yz + wx, xz + wy, yz - wx, one - xx - yy}};
  }
  // The rotation nearest to an orthonormal matrix (Shepperd's method: the largest of the four is divided by).
  static Rot3 from_matrix(const Mat<S, 3, 3>& R) requires std::same_as<S, double>;

  Rot3 plus(const Vec<S, 3>& phi) const { return (*this * exp(phi)).normalized(); }
  Vec<S, 3> minus(const Rot3& x) const { return (x.inverse() * *this).log(); }
  // R Exp(φ) = Exp(R φ) R, [ML] eq. 139.
  Mat<S, 3, 3> world_axes() const { return matrix(); }
};
using Rot3d = Rot3<double>;

template <class S>
Rot3<S> Rot3<S>::from_matrix(const Mat<S, 3, 3>& R) requires std::same_as<S, double> {
  const double t = R(0, 0) + R(1, 1) + R(2, 2);
  const double d[4] = {t, R(0, 0), R(1, 1), R(2, 2)};
  int big = 0;
  for (int i = 1; i < 4; ++i)
    if (d[i] > d[big]) big = i;
  if (big == 0) return Rot3{R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1), 1.0 + t}.normalized();
  const int i = big - 1, j = (i + 1) % 3, k = (i + 2) % 3;
  double q[3];
  q[i] = 1.0 + R(i, i) - R(j, j) - R(k, k);
  q[j] = R(j, i) + R(i, j);
  q[k] = R(k, i) + R(i, k);
  return Rot3{q[0], q[1], q[2], R(k, j) - R(j, k)}.normalized();
}

// Right Jacobian of Exp: Exp(φ + δ) ≈ Exp(φ) Exp(Jr(φ) δ). [ML] eq. 143.
template <class S>
Mat<S, 3, 3> right_jacobian_so3(const Vec<S, 3>& phi) {
  const ExpCoefficients<S> c(phi.squared_norm());
  const Mat<S, 3, 3> W = hat(phi);
  return Mat<S, 3, 3>::identity() - W * c.B + (W * W) * c.C;
}

// Its inverse: Log(Exp(φ) Exp(δ)) ≈ φ + Jr⁻¹(φ) δ. [ML] eq. 144, as I + W/2 + D W² with D = (1 - A/(2B))/θ².
template <class S>
Mat<S, 3, 3> inverse_right_jacobian_so3(const Vec<S, 3>& phi) {
  const S t = phi.squared_norm();
  const ExpCoefficients<S> c(t);
  // Below the threshold D = (B - A/2) / (θ² B) cancels; its Taylor series is 1/12 + t/720 + t²/30240 + t³/1209600 + ...
  const auto small = t < S(0.1);
  const S series =
      S(1.0 / 12) + t * (S(1.0 / 720) + t * (S(1.0 / 30240) + t * (S(1.0 / 1209600) + t * S(1.0 / 47900160))));
  const S safe = select(small, S(1.0), t);
  const S D = select(small, series, (S(1.0) - c.A / (S(2.0) * c.B)) / safe);
  const Mat<S, 3, 3> W = hat(phi);
  return Mat<S, 3, 3>::identity() + W * S(0.5) + (W * W) * D;
}

}  // namespace oriel
