// Sim(3): similarities x ↦ s R x + t with s > 0, that take coordinates of b to a: poses whose unit of length is their
// own, as of monocular maps. Retraction on the right, T ⊞ d = T·Exp(d). The tangent is d = [φ; ρ; λ]: rotation [rad],
// translation (in units of the frame on the right), logarithm of the scale.
//
// As matrices [s R, t; 0, 1] the algebra is [M, ρ; 0, 0] with M = hat(φ) + λ I, hence Exp(d) = (Exp(φ), W ρ, exp λ)
// with
//   W = ∫₀¹ exp(u M) du = a I + b Φ + c Φ²,  Φ = hat(φ), θ = ‖φ‖
//   a = ∫ exp(λu) du,  b = ∫ exp(λu) sin(θu)/θ du,  c = ∫ exp(λu) (1 - cos θu)/θ² du.
// E. Eade, "Lie Groups for 2D and 3D Transformations", section 6.2, has V = exp(-λ) W (eq. 149), since his similarities
// scale last, x ↦ s (R x + t).
#pragma once
#include "oriel/manifold/se3.h"

namespace oriel {

// a, b, c above with their derivatives by λ and by t = θ². In closed form
//   b = (1 + e^λ (λ A - cos θ))/q,  c = (a + e^λ (λ B - A))/q,  q = λ² + θ²,  A = sin θ/θ, B = (1 - cos θ)/θ²,
// which cancels where q is small; there cos and sin are expanded in θ, and what is left are the moments
//   m_n = ∫ uⁿ exp(λu) du,  m_(n-1) = (e^λ - λ m_n)/n,
// a recursion that divides every error by n/λ on its way down.
template <class S>
struct Sim3Coefficients {
  S a, b, c, a_lambda, b_lambda, c_lambda, b_t, c_t;

  Sim3Coefficients(const S& lambda, const S& t) {
    using std::exp;
    const S q = lambda * lambda + t, e = exp(lambda);
    const auto near = q < S(so3_detail::kSeries), flat = lambda * lambda < S(so3_detail::kSeries);
    expand(select(flat, lambda, S(0.0)), select(flat, e, S(1.0)), select(near, t, S(0.0)));
    const S safe = select(flat, S(1.0), lambda);
    a = select(flat, a, (e - S(1.0)) / safe);
    a_lambda = select(flat, a_lambda, (e - a) / safe);
    close(near, lambda, t, e, select(near, S(1.0), q));
  }

 private:
  static constexpr int kMoments = 20;  // θ^18/20! is far below rounding

  void expand(const S& lambda, const S& e, const S& t) {
    S m[kMoments];
    m[kMoments - 1] = e / S(kMoments);
    for (int n = kMoments - 1; n > 0; --n) m[n - 1] = (e - lambda * m[n]) / S(n);
    a = m[0], a_lambda = m[1];
    b = b_lambda = b_t = c = c_lambda = c_t = S(0.0);
    double f = 1.0;  // of θ^2k: ±1/(2k + 1)! for b; /(2k + 2) for c
    S power(1.0), before(0.0);
    for (int k = 0; 2 * k + 3 < kMoments; ++k) {
      const double g = f / (2 * k + 2);
      b = b + m[2 * k + 1] * (power * S(f)), b_lambda = b_lambda + m[2 * k + 2] * (power * S(f));
      c = c + m[2 * k + 2] * (power * S(g)), c_lambda = c_lambda + m[2 * k + 3] * (power * S(g));
      b_t = b_t + m[2 * k + 1] * (before * S(k * f)), c_t = c_t + m[2 * k + 2] * (before * S(k * g));
      before = power, power = power * t;
      f = -g / (2 * k + 3);
    }
  }
  template <class Where>
  void close(const Where& near, const S& lambda, const S& t, const S& e, const S& q) {
    using so3_detail::alternating;
    const ExpCoefficients<S> x(t);
    const auto small = t < S(so3_detail::kSeries);
    const S d = select(small, alternating<4>(t), (S(0.5) - x.B) / select(small, S(1.0), t));
    const S cosine = S(1.0) - t * x.B, slope_A = (x.C - x.B) * S(0.5), slope_B = d - x.C * S(0.5);  // by t
    const S B = (S(1.0) + e * (lambda * x.A - cosine)) / q, C = (a + e * (lambda * x.B - x.A)) / q;
    const S two_lambda = lambda + lambda;
    b_lambda = select(near, b_lambda, (e * (lambda * x.A - cosine + x.A) - two_lambda * B) / q);
    c_lambda = select(near, c_lambda, (a_lambda + e * (lambda * x.B - x.A + x.B) - two_lambda * C) / q);
    b_t = select(near, b_t, (e * (lambda * slope_A + x.A * S(0.5)) - B) / q);
    c_t = select(near, c_t, (e * (lambda * slope_B - slope_A) - C) / q);
    b = select(near, b, B), c = select(near, c, C);
  }
};

template <class S>
struct Sim3 {
  static constexpr std::string_view kName = "sim3/1";
  static constexpr int kDim = 7;
  static constexpr std::array<std::string_view, 7> kTangentNames = {
      "rotation x [rad]",  "rotation y [rad]",  "rotation z [rad]",  "translation x [m]",
      "translation y [m]", "translation z [m]", "logarithm of scale"};
  // Scales stay in here, whatever the steps.
  static constexpr double kLeastScale = 1e-100, kLargestScale = 1e100;
  template <class T>
  using rebind = Sim3<T>;

  Rot3<S> R{};
  Vec<S, 3> t = Vec<S, 3>::zero();
  S s = S(1.0);  // scale > 0

  const Rot3<S>& rotation() const { return R; }
  const Vec<S, 3>& translation() const { return t; }
  const S& scale() const { return s; }

  static Sim3 exp(const Vec<S, 7>& d) {
    using std::exp;
    const Vec<S, 3> phi = d.template segment<3>(0), rho = d.template segment<3>(3), w = cross(phi, rho);
    const Sim3Coefficients<S> k(d[6], phi.squared_norm());
    return {Rot3<S>::exp(phi), rho * k.a + w * k.b + cross(phi, w) * k.c, exp(d[6])};
  }
  Vec<S, 7> log() const {
    using std::log;
    const Vec<S, 3> phi = R.log();
    const S lambda = log(s);
    const Vec<S, 3> rho = inverse_w(phi, Sim3Coefficients<S>(lambda, phi.squared_norm())) * t;
    return {{phi[0], phi[1], phi[2], rho[0], rho[1], rho[2], lambda}};
  }
  // W⁻¹ = I/a - b/n Φ + (b² - c (a - c θ²))/(a n) Φ²,  n = (a - c θ²)² + b² θ²: W has the eigenvalues a and
  // a - c θ² ± i b θ, and so its inverse has the same form. Nothing cancels at θ = 0.
  static Mat<S, 3, 3> inverse_w(const Vec<S, 3>& phi, const Sim3Coefficients<S>& k) {
    const S t2 = phi.squared_norm(), across = k.a - k.c * t2, n = across * across + k.b * k.b * t2;
    const Mat<S, 3, 3> W = hat(phi);
    return Mat<S, 3, 3>::identity() * (S(1.0) / k.a) - W * (k.b / n) +
           (W * W) * ((k.b * k.b - k.c * across) / (k.a * n));
  }

  Sim3 inverse() const {
    const Rot3<S> Ri = R.inverse();
    const S si = S(1.0) / s;
    return {Ri, -(Ri * t) * si, si};
  }
  friend Sim3 operator*(const Sim3& x, const Sim3& y) { return {x.R * y.R, (x.R * y.t) * x.s + x.t, x.s * y.s}; }
  Vec<S, 3> operator*(const Vec<S, 3>& p) const { return (R * p) * s + t; }

  Sim3 plus(const Vec<S, 7>& d) const {
    const Sim3 x = *this * exp(d);
    const S low = select(x.s < S(kLeastScale), S(kLeastScale), x.s);
    return {x.R.normalized(), x.t, select(low > S(kLargestScale), S(kLargestScale), low)};
  }
  Vec<S, 7> minus(const Sim3& x) const { return (x.inverse() * *this).log(); }
  // As a pose's; a scale has no axes.
  Mat<S, 7, 7> world_axes() const {
    const Mat<S, 3, 3> M = R.matrix();
    Mat<S, 7, 7> B = Mat<S, 7, 7>::zero();
    B.set_block(0, 0, M);
    B.set_block(3, 3, M);
    B(6, 6) = S(1.0);
    return B;
  }
};
using Sim3d = Sim3<double>;

// Ad(T) with T Exp(d) T⁻¹ = Exp(Ad(T) d): conjugation of [Φ + λ I, ρ; 0, 0] takes ρ to s R ρ + t × R φ - λ t.
template <class S>
Mat<S, 7, 7> adjoint(const Sim3<S>& T) {
  const Mat<S, 3, 3> R = T.R.matrix();
  Mat<S, 7, 7> A = Mat<S, 7, 7>::zero();
  A.set_block(0, 0, R);
  A.set_block(3, 0, hat(T.t) * R);
  A.set_block(3, 3, R * T.s);
  A.set_block(3, 6, -T.t);
  A(6, 6) = S(1.0);
  return A;
}

// Jl⁻¹(d): Log(Exp(δ) Exp(d)) ≈ d + Jl⁻¹(d) δ. Where Exp moves by d's change, its translation p = W ρ moves by the
// left increment Jl δ as p ↦ p + (Jl δ)_φ × p + (Jl δ)_ρ + (Jl δ)_λ p. So, with J = Jl of SO(3),
//   Jl = [J, 0, 0; Q, W, v; 0, 0, 1],  Q = ∂(W ρ)/∂φ + hat(p) J,  v = ∂(W ρ)/∂λ - p,
// and the inverse follows block by block.
template <class S>
Mat<S, 7, 7> inverse_left_jacobian_sim3(const Vec<S, 7>& d) {
  const Vec<S, 3> phi = d.template segment<3>(0), rho = d.template segment<3>(3);
  const Sim3Coefficients<S> k(d[6], phi.squared_norm());
  const Vec<S, 3> w = cross(phi, rho), ww = cross(phi, w), p = rho * k.a + w * k.b + ww * k.c;
  const Mat<S, 3, 3> J = right_jacobian_so3(-phi), Ji = inverse_right_jacobian_so3(-phi),
                     Wi = Sim3<S>::inverse_w(phi, k);
  // ∂(Φ ρ)/∂φ = -hat(ρ), ∂(Φ² ρ)/∂φ = -(hat(Φ ρ) + Φ hat(ρ)), ∂θ²/∂φ = 2 φᵀ.
  const Mat<S, 3, 3> P = hat(rho);
  const Vec<S, 3> by_t = (w * k.b_t + ww * k.c_t) * S(2.0);
  const Mat<S, 3, 3> Q = by_t * phi.transposed() - P * k.b - (hat(w) + hat(phi) * P) * k.c + hat(p) * J;
  const Vec<S, 3> v = rho * k.a_lambda + w * k.b_lambda + ww * k.c_lambda - p;
  Mat<S, 7, 7> inverse = Mat<S, 7, 7>::zero();
  inverse.set_block(0, 0, Ji);
  inverse.set_block(3, 0, -(Wi * Q * Ji));
  inverse.set_block(3, 3, Wi);
  inverse.set_block(3, 6, -(Wi * v));
  inverse(6, 6) = S(1.0);
  return inverse;
}

// Log(Exp(d) Exp(δ)) ≈ d + Jr⁻¹(d) δ, with Jr(d) = Jl(-d) as in every group.
template <class S>
Mat<S, 7, 7> analytic_minus_jacobian(const Sim3<S>&, const Sim3<S>&, const Vec<S, 7>& e) {
  return inverse_left_jacobian_sim3(-e);
}

}  // namespace oriel
