// A body that keeps its velocity but for white noise on its acceleration, and its attitude but for white noise on its
// angular velocity. r = [rotation; position; velocity] (9 × 1) in [rad, m, m/s]:
//   r_R = Log(R_iᵀ R_j)
//   r_p = p_j - p_i - v_i Δt
//   r_v = v_j - v_i
// in world but for r_R. For densities q_a [m²/s³] and q_w [rad²/s] its covariance is (Bar-Shalom, Li, Kirubarajan,
// Estimation with Applications to Tracking and Navigation, 2001, section 6.2.2, continuous white noise acceleration)
//   Q = [q_w Δt I, 0, 0; 0, q_a Δt³/3 I, q_a Δt²/2 I; 0, q_a Δt²/2 I, q_a Δt I].
// Position and velocity are linear and Markov: two halves with a state between them say exactly what the whole says.
#pragma once
#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/linearize_rows.h"
#include "oriel/residual/noise.h"
#include "oriel/residual/residual.h"

namespace oriel {

template <class S>
struct ConstantVelocity {
  static constexpr std::string_view kName = "constant_velocity/1";
  static constexpr int kDim = 9;
  using Variables = Types<Pose3d, Velocity3d, Pose3d, Velocity3d>;  // state i, then state j
  template <class T>
  using rebind = ConstantVelocity<T>;

  S dt;  // Δt [s]

  Valid<S> evaluate(const Pose3<S>& x_i, const Velocity3<S>& v_i, const Pose3<S>& x_j, const Velocity3<S>& v_j,
                    Vec<S, 9>& r, Mat<S, 9, 6>* J_xi, Mat<S, 9, 3>* J_vi, Mat<S, 9, 6>* J_xj,
                    Mat<S, 9, 3>* J_vj) const {
    const Rot3<S> R_ij = x_i.R.inverse() * x_j.R;
    const Vec<S, 3> r_R = R_ij.log();
    r.set_segment(0, r_R);
    r.set_segment(3, x_j.t - x_i.t - v_i.v * dt);
    r.set_segment(6, v_j.v - v_i.v);
    if (J_xi != nullptr) {
      using Mat3 = Mat<S, 3, 3>;
      const Mat3 Jr_inverse = inverse_right_jacobian_so3(r_R);
      *J_xi = *J_xj = Mat<S, 9, 6>::zero();
      *J_vi = *J_vj = Mat<S, 9, 3>::zero();
      J_xi->set_block(0, 0, -(Jr_inverse * R_ij.matrix().transposed()));
      J_xi->set_block(3, 3, -x_i.R.matrix());  // p moves by R ρ
      J_xj->set_block(0, 0, Jr_inverse);
      J_xj->set_block(3, 3, x_j.R.matrix());
      J_vi->set_block(3, 0, Mat3::identity() * -dt);
      J_vi->set_block(6, 0, -Mat3::identity());
      J_vj->set_block(6, 0, Mat3::identity());
    }
    return always_valid<S>();
  }
};
using ConstantVelocityd = ConstantVelocity<double>;

// Densities are standard deviations: acceleration √q_a [m/s²/√Hz], rotation √q_w [rad/s/√Hz]; dt > 0 [s].
inline FullNoise<9> constant_velocity_noise(double dt, double acceleration, double rotation) {
  const double a = acceleration * acceleration, w = rotation * rotation;
  Mat<double, 9, 9> Q = Mat<double, 9, 9>::zero();
  for (int i = 0; i < 3; ++i) {
    Q(i, i) = w * dt;
    Q(3 + i, 3 + i) = a * dt * dt * dt / 3.0;
    Q(3 + i, 6 + i) = Q(6 + i, 3 + i) = a * dt * dt / 2.0;
    Q(6 + i, 6 + i) = a * dt;
  }
  return Covariance(Q);
}

// Compiled once, in the library.
extern template void linearize_rows<ConstantVelocityd, FullNoise<9>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
