// The preintegrated IMU factor between two states (Forster et al., TRO 2017, arXiv:1512.02363 = [F], eq. 45 and
// Appendix C), with the walk of the biases in the same residual. r = [rotation; velocity; position; gyroscope bias;
// accelerometer bias] (15 × 1) in [rad, m/s, m, rad/s, m/s²], in the frame of body i:
//   r_R = Log(ΔR̃ᵀ R_iᵀ R_j)                                ΔR̃ = ΔR Exp(dR_dg δg)
//   r_v = R_iᵀ (v_j - v_i - g Δt) - (Δv + dv_dg δg + dv_da δa)
//   r_p = R_iᵀ (p_j - p_i - v_i Δt - g Δt²/2) - (Δp + dp_dg δg + dp_da δa)
//   r_b = b_j - b_i
// where [δg; δa] = b_i minus the biases that the samples were integrated with.
#pragma once
#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/linearize_rows.h"
#include "oriel/residual/noise.h"
#include "oriel/residual/residual.h"
#include "oriel/sensor/preintegration.h"

namespace oriel {

template <class S>
struct ImuResidual {
  static constexpr std::string_view kName = "imu/1";
  static constexpr int kDim = 15;
  using Variables = Types<Pose3d, Velocity3d, ImuBiasd, Pose3d, Velocity3d, ImuBiasd>;  // state i, then state j
  template <class T>
  using rebind = ImuResidual<T>;

  PreintegratedImu<S> motion;
  Vec<S, 3> gravity = kStandardGravity.template cast<S>();  // in world [m/s²]

  Valid<S> evaluate(const Pose3<S>& x_i, const Velocity3<S>& v_i, const ImuBias<S>& b_i, const Pose3<S>& x_j,
                    const Velocity3<S>& v_j, const ImuBias<S>& b_j, Vec<S, 15>& r, Mat<S, 15, 6>* J_xi,
                    Mat<S, 15, 3>* J_vi, Mat<S, 15, 6>* J_bi, Mat<S, 15, 6>* J_xj, Mat<S, 15, 3>* J_vj,
                    Mat<S, 15, 6>* J_bj) const {
    const S& dt = motion.dt;
    const Vec<S, 3> dg = b_i.gyro - motion.bias.gyro, da = b_i.accel - motion.bias.accel, turn = motion.dR_dg * dg;
    const Rot3<S> world_i = x_i.R.inverse(), R_ij = world_i * x_j.R;
    const Rot3<S> E = (motion.dR * Rot3<S>::exp(turn)).inverse() * R_ij;
    const Vec<S, 3> r_R = E.log();
    const Vec<S, 3> v = world_i * (v_j.v - v_i.v - gravity * dt);
    const Vec<S, 3> p = world_i * (x_j.t - x_i.t - v_i.v * dt - gravity * (S(0.5) * dt * dt));
    r.set_segment(0, r_R);
    r.set_segment(3, v - motion.dv - motion.dv_dg * dg - motion.dv_da * da);
    r.set_segment(6, p - motion.dp - motion.dp_dg * dg - motion.dp_da * da);
    r.set_segment(9, b_j.gyro - b_i.gyro);
    r.set_segment(12, b_j.accel - b_i.accel);
    if (J_xi != nullptr) {
      const Mat<S, 3, 3> Jr_inverse = inverse_right_jacobian_so3(r_R);
      state_jacobians(Jr_inverse, R_ij, v, p, world_i.matrix(), *J_xi, *J_vi, *J_xj, *J_vj);
      // ΔR̃ moves by Exp(Jr(turn) dR_dg δ) on its right, which reaches E on its left.
      bias_jacobians(Jr_inverse * E.inverse().matrix() * right_jacobian_so3(turn) * motion.dR_dg, *J_bi, *J_bj);
    }
    return always_valid<S>();
  }

 private:
  void state_jacobians(const Mat<S, 3, 3>& Jr_inverse, const Rot3<S>& R_ij, const Vec<S, 3>& v, const Vec<S, 3>& p,
                       const Mat<S, 3, 3>& R_i_world, Mat<S, 15, 6>& J_xi, Mat<S, 15, 3>& J_vi, Mat<S, 15, 6>& J_xj,
                       Mat<S, 15, 3>& J_vj) const {
    const Mat<S, 3, 3> R = R_ij.matrix();
    J_xi = Mat<S, 15, 6>::zero();
    J_xi.set_block(0, 0, -(Jr_inverse * R.transposed()));
    J_xi.set_block(3, 0, hat(v));
    J_xi.set_block(6, 0, hat(p));
    J_xi.set_block(6, 3, -Mat<S, 3, 3>::identity());
    J_vi = Mat<S, 15, 3>::zero();
    J_vi.set_block(3, 0, -R_i_world);
    J_vi.set_block(6, 0, R_i_world * -motion.dt);
    J_xj = Mat<S, 15, 6>::zero();
    J_xj.set_block(0, 0, Jr_inverse);
    J_xj.set_block(6, 3, R);
    J_vj = Mat<S, 15, 3>::zero();
    J_vj.set_block(3, 0, R_i_world);
  }

  void bias_jacobians(const Mat<S, 3, 3>& rotation_by_gyro, Mat<S, 15, 6>& J_bi, Mat<S, 15, 6>& J_bj) const {
    J_bi = Mat<S, 15, 6>::zero();
    J_bi.set_block(0, 0, -rotation_by_gyro);
    J_bi.set_block(3, 0, -motion.dv_dg);
    J_bi.set_block(3, 3, -motion.dv_da);
    J_bi.set_block(6, 0, -motion.dp_dg);
    J_bi.set_block(6, 3, -motion.dp_da);
    J_bj = Mat<S, 15, 6>::zero();
    for (int i = 0; i < 6; ++i) {
      J_bi(9 + i, i) = S(-1.0);
      J_bj(9 + i, i) = S(1.0);
    }
  }
};
using ImuResiduald = ImuResidual<double>;

// The noise of an ImuResidual: the residual's order is that of the covariance.
inline FullNoise<15> imu_noise(const Preintegration& preintegration) { return Covariance(preintegration.covariance); }

// Compiled once, in the library.
extern template void linearize_rows<ImuResiduald, FullNoise<15>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
