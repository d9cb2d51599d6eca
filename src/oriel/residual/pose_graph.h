// The edges of pose graphs as g2o defines their errors, so that information matrices of its files mean what they say
// (Kümmerle et al., "g2o: A general framework for graph optimization", ICRA 2011; its types EdgeSE3 and EdgeSE2).
// Both measure T_a_b between the poses T_world_a and T_world_b. The rows keep the order of the file's information.
#pragma once
#include "oriel/manifold/se2.h"
#include "oriel/manifold/se3.h"
#include "oriel/residual/linearize_rows.h"
#include "oriel/residual/residual.h"

namespace oriel {

// E = Z⁻¹ A⁻¹ B, r = [translation of E [m]; vector part of its unit quaternion with w ≥ 0] (6 × 1): near zero the last
// three rows are half the rotation vector. With u = R_aᵀ(t_b - t_a) and q = [v, w] the quaternion of E,
//   ∂t_E/∂a = R_zᵀ [hat(u), -I],  ∂t_E/∂b = [0, R_zᵀ R_ab],
//   ∂v/∂φ_b = (w I + hat(v)) / 2,  ∂v/∂φ_a = -(w I + hat(v)) R_abᵀ / 2,
// because Exp(φ) moves q on its right by [φ/2, 1], and A⁻¹ is moved on its left.
template <class S>
struct PoseGraphEdge3 {
  static constexpr std::string_view kName = "pose_graph_edge3/1";
  static constexpr int kDim = 6;
  using Variables = Types<Pose3d, Pose3d>;
  template <class T>
  using rebind = PoseGraphEdge3<T>;

  Pose3<S> measured;  // T_a_b

  Valid<S> evaluate(const Pose3<S>& a, const Pose3<S>& b, Vec<S, 6>& r, Mat<S, 6, 6>* J_a, Mat<S, 6, 6>* J_b) const {
    const Vec<S, 3> u = a.R.inverse() * (b.t - a.t);
    const Rot3<S> q_ab = a.R.inverse() * b.R;
    const Rot3<S> q = (measured.R.inverse() * q_ab).positive();
    r.set_segment(0, measured.R.inverse() * (u - measured.t));
    r.set_segment(3, q.vec());
    if (J_a == nullptr) return always_valid<S>();

    const Mat<S, 3, 3> R_ba = q_ab.inverse().matrix(), R_za = measured.R.inverse().matrix();
    const S h(0.5), o(0.0);
    const S w = q.qw * h, x = q.qx * h, y = q.qy * h, z = q.qz * h;
    const Mat<S, 3, 3> half = {{w, z, -y, -z, w, x, y, -x, w}}, none = Mat<S, 3, 3>::constant(o);
    J_a->set_block(0, 0, times_hat(R_za, u));
    J_a->set_block(0, 3, -R_za);
    J_a->set_block(3, 0, -(half * R_ba));
    J_a->set_block(3, 3, none);
    J_b->set_block(0, 0, none);
    J_b->set_block(0, 3, R_za * R_ba.transposed());
    J_b->set_block(3, 0, half);
    J_b->set_block(3, 3, none);
    return always_valid<S>();
  }
};
using PoseGraphEdge3d = PoseGraphEdge3<double>;

// The same with the rotation vector of E, φ = Log(R_E) [rad], in its last three rows: the "log convention".
//   ∂φ/∂φ_b = Jr⁻¹(φ),  ∂φ/∂φ_a = -Jr⁻¹(φ) R_abᵀ  ([ML] eq. 144).
template <class S>
struct PoseGraphEdgeLog3 {
  static constexpr std::string_view kName = "pose_graph_edge_log3/1";
  static constexpr int kDim = 6;
  using Variables = Types<Pose3d, Pose3d>;
  template <class T>
  using rebind = PoseGraphEdgeLog3<T>;

  Pose3<S> measured;  // T_a_b

  Valid<S> evaluate(const Pose3<S>& a, const Pose3<S>& b, Vec<S, 6>& r, Mat<S, 6, 6>* J_a, Mat<S, 6, 6>* J_b) const {
    const auto valid = PoseGraphEdge3<S>{measured}.evaluate(a, b, r, J_a, J_b);  // the rows of the translation
    const Rot3<S> q_ab = a.R.inverse() * b.R;
    const Vec<S, 3> phi = (measured.R.inverse() * q_ab).log();
    r.set_segment(3, phi);
    if (J_a == nullptr) return valid;
    const Mat<S, 3, 3> J = inverse_right_jacobian_so3(phi);
    J_b->set_block(3, 0, J);
    J_a->set_block(3, 0, -(J * q_ab.inverse().matrix()));
    return valid;
  }
};
using PoseGraphEdgeLog3d = PoseGraphEdgeLog3<double>;

// r = [R_zᵀ (R_aᵀ (t_b - t_a) - t_z) [m]; θ_b - θ_a - θ_z wrapped to (-π, π] [rad]] (3 × 1), with
//   ∂/∂φ_a (R_aᵀ(t_b - t_a)) = [u_y, -u_x]ᵀ,  u = R_aᵀ (t_b - t_a).
template <class S>
struct PoseGraphEdge2 {
  static constexpr std::string_view kName = "pose_graph_edge2/1";
  static constexpr int kDim = 3;
  using Variables = Types<Pose2d, Pose2d>;
  template <class T>
  using rebind = PoseGraphEdge2<T>;

  Pose2<S> measured;  // T_a_b

  Valid<S> evaluate(const Pose2<S>& a, const Pose2<S>& b, Vec<S, 3>& r, Mat<S, 3, 3>* J_a, Mat<S, 3, 3>* J_b) const {
    const Vec<S, 2> u = a.R.inverse() * (b.t - a.t);
    const Rot2<S> R_ab = a.R.inverse() * b.R, R_za = measured.R.inverse(), R_zb = R_za * R_ab;
    const Vec<S, 2> e = R_za * (u - measured.t);
    r = {{e[0], e[1], R_zb.log()}};
    if (J_a == nullptr) return always_valid<S>();

    const S o(0.0), one(1.0);
    const Vec<S, 2> turn = R_za * Vec<S, 2>{{u[1], -u[0]}};
    // Columns: angle, translation x, translation y.
    *J_a = {{turn[0], turn[1], -one, -R_za.c, -R_za.s, o, R_za.s, -R_za.c, o}};
    *J_b = {{o, o, one, R_zb.c, R_zb.s, o, -R_zb.s, R_zb.c, o}};
    return always_valid<S>();
  }
};
using PoseGraphEdge2d = PoseGraphEdge2<double>;

// Compiled once, in the library.
extern template void linearize_rows<PoseGraphEdge2d, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<PoseGraphEdge2d, DiagonalNoise<3>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<PoseGraphEdge2d, FullNoise<3>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<PoseGraphEdge3d, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<PoseGraphEdge3d, DiagonalNoise<6>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<PoseGraphEdge3d, FullNoise<6>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<PoseGraphEdgeLog3d, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<PoseGraphEdgeLog3d, DiagonalNoise<6>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<PoseGraphEdgeLog3d, FullNoise<6>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
