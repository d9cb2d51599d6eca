// SE(3): poses T_a_b that take coordinates of b to a; retraction on the right, T ⊞ d = T·Exp(d).
// The tangent is d = [φ; ρ]: rotation [rad] first, then translation [m], both in the frame on the right (the body).
// Formulas: [ML] = arXiv:1812.01537, Appendix D, with the two halves of its tangent exchanged.
#pragma once
#include "oriel/manifold/so3.h"

namespace oriel {

template <class S>
struct Pose3 {
  static constexpr std::string_view kName = "pose3/1";
  static constexpr int kDim = 6;
  static constexpr std::array<std::string_view, 6> kTangentNames = {"rotation x [rad]",  "rotation y [rad]",
                                                                    "rotation z [rad]",  "translation x [m]",
                                                                    "translation y [m]", "translation z [m]"};
  template <class T>
  using rebind = Pose3<T>;

  Rot3<S> R{};                      // rotation
  Vec<S, 3> t = Vec<S, 3>::zero();  // translation [m]

  const Rot3<S>& rotation() const { return R; }
  const Vec<S, 3>& translation() const { return t; }

  // Exp, [ML] eq. 172-174: R = Exp(φ), t = V(φ) ρ with V = I + B W + C W².
  static Pose3 exp(const Vec<S, 6>& d) {
    const Vec<S, 3> phi = d.template segment<3>(0), rho = d.template segment<3>(3);
    const ExpCoefficients<S> c(phi.squared_norm());
    const Vec<S, 3> w = cross(phi, rho);
    return {Rot3<S>::exp(phi), rho + w * c.B + cross(phi, w) * c.C};
  }
  // Log, [ML] eq. 175: φ = Log(R), ρ = V(φ)⁻¹ t; V(φ)⁻¹ = Jr⁻¹(-φ).
  Vec<S, 6> log() const {
    const Vec<S, 3> phi = R.log();
    const Vec<S, 3> rho = inverse_right_jacobian_so3(-phi) * t;
    return {{phi[0], phi[1], phi[2], rho[0], rho[1], rho[2]}};
  }
  Pose3 inverse() const {
    const Rot3<S> Ri = R.inverse();
    return {Ri, -(Ri * t)};
  }
  friend Pose3 operator*(const Pose3& a, const Pose3& b) { return {a.R * b.R, a.R * b.t + a.t}; }
  Vec<S, 3> operator*(const Vec<S, 3>& p) const { return R * p + t; }

  Pose3 plus(const Vec<S, 6>& d) const {
    const Pose3 x = *this * exp(d);
    return {x.R.normalized(), x.t};
  }
  Vec<S, 6> minus(const Pose3& x) const { return (x.inverse() * *this).log(); }
  // Turned into the axes of the world, about the body's own origin: the adjoint without its lever.
  Mat<S, 6, 6> world_axes() const {
    const Mat<S, 3, 3> M = R.matrix();
    Mat<S, 6, 6> B = Mat<S, 6, 6>::zero();
    B.set_block(0, 0, M);
    B.set_block(3, 3, M);
    return B;
  }
};
using Pose3d = Pose3<double>;

// Ad(T) with T Exp(d) T⁻¹ = Exp(Ad(T) d). [ML] eq. 177.
template <class S>
Mat<S, 6, 6> adjoint(const Pose3<S>& T) {
  const Mat<S, 3, 3> R = T.R.matrix();
  Mat<S, 6, 6> A = Mat<S, 6, 6>::zero();
  A.set_block(0, 0, R);
  A.set_block(3, 3, R);
  A.set_block(3, 0, hat(T.t) * R);
  return A;
}

// Q(φ, ρ) of the left Jacobian, [ML] eq. 180 (Barfoot 7.86b).
template <class S>
Mat<S, 3, 3> se3_q(const Vec<S, 3>& phi, const Vec<S, 3>& rho) {
  using so3_detail::alternating;
  const S t = phi.squared_norm();
  const ExpCoefficients<S> c(t);
  const auto small = t < S(so3_detail::kSeries);
  const S safe = select(small, S(1.0), t);
  // (θ² + 2 cos θ - 2)/(2 θ⁴) = (1/2 - B)/θ² and (2θ - 3 sin θ + θ cos θ)/(2 θ⁵) = ((1/2 - B)/θ² - 3 (1/6 - C)/θ²)/2.
  const S d4 = select(small, alternating<4>(t), (S(0.5) - c.B) / safe);
  const S d5 = select(small, alternating<5>(t), (S(1.0 / 6.0) - c.C) / safe);
  const Mat<S, 3, 3> W = hat(phi), P = hat(rho), WP = W * P, PW = P * W, WPW = WP * W;
  return P * S(0.5) + (WP + PW + WPW) * c.C + (W * WP + PW * W - WPW * S(3.0)) * d4 +
         (WPW * W + W * WPW) * ((d4 - S(3.0) * d5) * S(0.5));
}

// Jr⁻¹(d): Log(Exp(d) Exp(δ)) ≈ d + Jr⁻¹(d) δ. [ML] eq. 182 with Jr(d) = Jl(-d).
template <class S>
Mat<S, 6, 6> inverse_right_jacobian_se3(const Vec<S, 6>& d) {
  const Vec<S, 3> phi = d.template segment<3>(0), rho = d.template segment<3>(3);
  const Mat<S, 3, 3> Ji = inverse_right_jacobian_so3(phi);
  Mat<S, 6, 6> J = Mat<S, 6, 6>::zero();
  J.set_block(0, 0, Ji);
  J.set_block(3, 3, Ji);
  J.set_block(3, 0, -(Ji * se3_q(-phi, -rho) * Ji));
  return J;
}

}  // namespace oriel
