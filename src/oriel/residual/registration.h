// Registration of two point clouds with known correspondences, as in ICP: a point p_b of a cloud taken at T_world_b
// lies at p_a of the cloud at T_world_a, or on a plane or line through p_a. A map that does not move is an `a` that is
// fixed.
//   q = T_world_a⁻¹ T_world_b p_b = R_ab p_b + R_aᵀ (t_b - t_a),  e = q - p_a   [m], in the frame of a
//   J_a = [hat(q), -I],  J_b = [-R_ab hat(p_b), R_ab]           of e (3 × 6 each)
// since T_a Exp(δ) takes q to Exp(-δ) q ≈ q - φ × q - ρ.
//   to a point: r = e. The noise is that of e: with Covariance, C_a + R_ab C_b R_abᵀ at a first guess (A. Segal, D.
//               Haehnel, S. Thrun, "Generalized-ICP", RSS 2009, eq. 2).
//   to a plane: r = nᵀ e, n its unit normal (Y. Chen, G. Medioni, 1991).
//   to a line:  r = B(u)ᵀ e (2 × 1), u its direction and B(u) the basis across it (manifold/unit_vector.h).
#pragma once
#include "oriel/manifold/se3.h"
#include "oriel/manifold/unit_vector.h"
#include "oriel/residual/linearize_rows.h"
#include "oriel/residual/residual.h"

namespace oriel {

namespace detail {

// A e by the rows of A (constant), and its Jacobians.
template <class S, int D>
void evaluate_registration(const Mat<S, D, 3>& A, const Vec<S, 3>& p_a, const Vec<S, 3>& p_b, const Pose3<S>& a,
                           const Pose3<S>& b, Vec<S, D>& r, Mat<S, D, 6>* J_a, Mat<S, D, 6>* J_b) {
  const Rot3<S> a_inverse = a.R.inverse();
  const Mat<S, 3, 3> R_ab = (a_inverse * b.R).matrix();
  const Vec<S, 3> q = R_ab * p_b + a_inverse * (b.t - a.t);
  r = A * (q - p_a);
  if (J_a == nullptr) return;
  const Mat<S, D, 3> AR = A * R_ab;
  J_a->set_block(0, 0, times_hat(A, q));
  J_a->set_block(0, 3, -A);
  J_b->set_block(0, 0, -times_hat(AR, p_b));
  J_b->set_block(0, 3, AR);
}

}  // namespace detail

template <class S>
struct PointToPoint {
  static constexpr std::string_view kName = "point_to_point/1";
  static constexpr int kDim = 3;
  using Variables = Types<Pose3d, Pose3d>;  // T_world_a, T_world_b
  template <class T>
  using rebind = PointToPoint<T>;

  Vec<S, 3> p_a, p_b;  // the same point in both frames [m]

  Valid<S> evaluate(const Pose3<S>& a, const Pose3<S>& b, Vec<S, 3>& r, Mat<S, 3, 6>* J_a, Mat<S, 3, 6>* J_b) const {
    detail::evaluate_registration(Mat<S, 3, 3>::identity(), p_a, p_b, a, b, r, J_a, J_b);
    return always_valid<S>();
  }
};
using PointToPointd = PointToPoint<double>;

template <class S>
struct PointToPlane {
  static constexpr std::string_view kName = "point_to_plane/1";
  static constexpr int kDim = 1;
  using Variables = Types<Pose3d, Pose3d>;  // T_world_a, T_world_b
  template <class T>
  using rebind = PointToPlane<T>;

  Vec<S, 3> p_a;          // a point of the plane [m], in a
  UnitVector3<S> normal;  // of the plane, in a
  Vec<S, 3> p_b;          // [m], in b

  Valid<S> evaluate(const Pose3<S>& a, const Pose3<S>& b, Vec<S, 1>& r, Mat<S, 1, 6>* J_a, Mat<S, 1, 6>* J_b) const {
    detail::evaluate_registration(normal.v.transposed(), p_a, p_b, a, b, r, J_a, J_b);
    return always_valid<S>();
  }
};
using PointToPlaned = PointToPlane<double>;

template <class S>
struct PointToLine {
  static constexpr std::string_view kName = "point_to_line/1";
  static constexpr int kDim = 2;
  using Variables = Types<Pose3d, Pose3d>;  // T_world_a, T_world_b
  template <class T>
  using rebind = PointToLine<T>;

  Vec<S, 3> p_a;             // a point of the line [m], in a
  UnitVector3<S> direction;  // of the line, in a
  Vec<S, 3> p_b;             // [m], in b

  Valid<S> evaluate(const Pose3<S>& a, const Pose3<S>& b, Vec<S, 2>& r, Mat<S, 2, 6>* J_a, Mat<S, 2, 6>* J_b) const {
    detail::evaluate_registration(direction.basis().transposed(), p_a, p_b, a, b, r, J_a, J_b);
    return always_valid<S>();
  }
};
using PointToLined = PointToLine<double>;

// Compiled once, in the library.
extern template void linearize_rows<PointToPointd, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<PointToPointd, FullNoise<3>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<PointToPlaned, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<PointToLined, IsotropicNoise>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
