// SO(2) and SE(2). The rotation is a unit complex number, so that only Exp and Log need a transcendental function.
// SE(2): T ⊞ d = T·Exp(d), d = [φ; ρ]: angle [rad] first, then translation [m] in the frame on the right.
// Formulas: [ML] = arXiv:1812.01537, Appendices A and C.
#pragma once
#include "oriel/base/pack.h"
#include "oriel/manifold/so3.h"

namespace oriel {

template <class S>
struct Rot2 {
  static constexpr std::string_view kName = "rot2/1";
  static constexpr int kDim = 1;
  static constexpr std::array<std::string_view, 1> kTangentNames = {"rotation [rad]"};
  template <class T>
  using rebind = Rot2<T>;

  S c = S(1.0), s = S(0.0);  // cos and sin of the angle

  static Rot2 exp(const S& angle) {
    using std::cos, std::sin;
    return {cos(angle), sin(angle)};
  }
  // In (-π, π].
  S log() const {
    using std::atan2;
    return atan2(s, c);
  }
  Rot2 inverse() const { return {c, -s}; }
  friend Rot2 operator*(const Rot2& a, const Rot2& b) { return {a.c * b.c - a.s * b.s, a.s * b.c + a.c * b.s}; }
  Vec<S, 2> operator*(const Vec<S, 2>& p) const { return {{c * p[0] - s * p[1], s * p[0] + c * p[1]}}; }
  Rot2 normalized() const {
    using std::sqrt;
    const S k = S(1.0) / sqrt(c * c + s * s);
    return {c * k, s * k};
  }
  Rot2 plus(const Vec<S, 1>& d) const { return (*this * exp(d[0])).normalized(); }
  Vec<S, 1> minus(const Rot2& x) const { return {{(x.inverse() * *this).log()}}; }
};
using Rot2d = Rot2<double>;

template <class S>
struct Pose2 {
  static constexpr std::string_view kName = "pose2/1";
  static constexpr int kDim = 3;
  static constexpr std::array<std::string_view, 3> kTangentNames = {"rotation [rad]", "translation x [m]",
                                                                    "translation y [m]"};
  template <class T>
  using rebind = Pose2<T>;

  Rot2<S> R{};
  Vec<S, 2> t = Vec<S, 2>::zero();  // [m]

  const Rot2<S>& rotation() const { return R; }
  const Vec<S, 2>& translation() const { return t; }

  // Exp, [ML] eq. 156-158: t = V ρ, V = [a, -b; b, a] with a = sin φ/φ, b = (1 - cos φ)/φ.
  static Pose2 exp(const Vec<S, 3>& d) {
    const ExpCoefficients<S> c(d[0] * d[0]);
    const S a = c.A, b = c.B * d[0];
    return {Rot2<S>::exp(d[0]), {{a * d[1] - b * d[2], b * d[1] + a * d[2]}}};
  }
  // Log, [ML] eq. 159-160; V⁻¹ = [a, b; -b, a] / (a² + b²).
  Vec<S, 3> log() const {
    const S phi = R.log();
    const ExpCoefficients<S> c(phi * phi);
    const S a = c.A, b = c.B * phi, k = S(1.0) / (a * a + b * b);
    return {{phi, (a * t[0] + b * t[1]) * k, (a * t[1] - b * t[0]) * k}};
  }
  Pose2 inverse() const {
    const Rot2<S> Ri = R.inverse();
    return {Ri, -(Ri * t)};
  }
  friend Pose2 operator*(const Pose2& a, const Pose2& b) { return {a.R * b.R, a.R * b.t + a.t}; }
  Vec<S, 2> operator*(const Vec<S, 2>& p) const { return R * p + t; }
  Pose2 plus(const Vec<S, 3>& d) const {
    const Pose2 x = *this * exp(d);
    return {x.R.normalized(), x.t};
  }
  Vec<S, 3> minus(const Pose2& x) const { return (x.inverse() * *this).log(); }
  // The translation turned into the axes of the world.
  Mat<S, 3, 3> world_axes() const {
    const S o(0.0);
    return {{S(1.0), o, o, o, R.c, R.s, o, -R.s, R.c}};
  }
};
using Pose2d = Pose2<double>;

// Ad(T) with T Exp(d) T⁻¹ = Exp(Ad(T) d). [ML] eq. 165.
template <class S>
Mat<S, 3, 3> adjoint(const Pose2<S>& T) {
  const S o(0.0);
  return {{S(1.0), T.t[1], -T.t[0], o, T.R.c, T.R.s, o, -T.R.s, T.R.c}};
}

// Jr⁻¹(d): Log(Exp(d) Exp(δ)) ≈ d + Jr⁻¹(d) δ; the inverse of [ML] eq. 163, with Jr = [1, 0; q, V(-φ)].
template <class S>
Mat<S, 3, 3> inverse_right_jacobian_se2(const Vec<S, 3>& d) {
  const ExpCoefficients<S> c(d[0] * d[0]);
  const S a = c.A, b = c.B * d[0], k = S(1.0) / (a * a + b * b), e = c.C * d[0], o(0.0);
  const S x = e * d[1] - c.B * d[2], y = c.B * d[1] + e * d[2];
  return {{S(1.0), (b * y - a * x) * k, -(b * x + a * y) * k, o, a * k, b * k, o, -b * k, a * k}};
}

}  // namespace oriel
