// Velocity in the body's frame, as wheel odometry or a Doppler log says it. A vehicle that does not slip has no
// velocity sideways and upwards: the same residual with a measurement of 0 there, and sigmas of its own for each axis.
//   r = R_world_bodyᵀ v_world_body - z [m/s] (3 × 1).
// (R Exp(φ))ᵀ v = Rᵀ v + hat(Rᵀ v) φ to first order, so that J_pose = [hat(Rᵀ v), 0] and J_velocity = Rᵀ.
#pragma once
#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/linearize_rows.h"
#include "oriel/residual/noise.h"
#include "oriel/residual/residual.h"

namespace oriel {

template <class S>
struct BodyVelocity {
  static constexpr std::string_view kName = "body_velocity/1";
  static constexpr int kDim = 3;
  using Variables = Types<Pose3d, Velocity3d>;  // T_world_body, v_world_body
  template <class T>
  using rebind = BodyVelocity<T>;

  Vec<S, 3> v_body;  // measured [m/s]

  Valid<S> evaluate(const Pose3<S>& x, const Velocity3<S>& velocity, Vec<S, 3>& r, Mat<S, 3, 6>* J_x,
                    Mat<S, 3, 3>* J_v) const {
    const Rot3<S> R_body_world = x.R.inverse();
    const Vec<S, 3> v = R_body_world * velocity.v;
    r = v - v_body;
    if (J_x != nullptr) {
      *J_x = Mat<S, 3, 6>::zero();
      J_x->set_block(0, 0, hat(v));
      *J_v = R_body_world.matrix();
    }
    return always_valid<S>();
  }
};
using BodyVelocityd = BodyVelocity<double>;

// Compiled once, in the library.
extern template void linearize_rows<BodyVelocityd, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<BodyVelocityd, DiagonalNoise<3>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<BodyVelocityd, FullNoise<3>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
