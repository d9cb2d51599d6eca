// GNSS: the position of an antenna in the world. The world is a local frame with axes east, north, up; its origin is a
// point that the user chose when turning latitude, longitude and height into it.
//   r = p_world_body + R_world_body l - z [m] (3 × 1),  l: the antenna in the body's frame.
// By the retraction on the right, R Exp(φ) l = R l - R hat(l) φ and p + R ρ, so that J_pose = [-R hat(l), R].
#pragma once
#include "oriel/manifold/se3.h"
#include "oriel/residual/linearize_rows.h"
#include "oriel/residual/noise.h"
#include "oriel/residual/residual.h"
#include "oriel/sensor/lever_arm.h"

namespace oriel {

template <class S>
struct GnssPosition {
  static constexpr std::string_view kName = "gnss_position/1";
  static constexpr int kDim = 3;
  using Variables = Types<Pose3d, LeverArmd>;  // T_world_body, the antenna
  template <class T>
  using rebind = GnssPosition<T>;

  Vec<S, 3> p_world_antenna;  // measured [m]

  Valid<S> evaluate(const Pose3<S>& x, const LeverArm<S>& antenna, Vec<S, 3>& r, Mat<S, 3, 6>* J_x) const {
    r = x * antenna.p_body_sensor - p_world_antenna;
    if (J_x != nullptr) {
      const Mat<S, 3, 3> R = x.R.matrix();
      J_x->set_block(0, 0, -times_hat(R, antenna.p_body_sensor));
      J_x->set_block(0, 3, R);
    }
    return always_valid<S>();
  }
};
using GnssPositiond = GnssPosition<double>;

// Compiled once, in the library.
extern template void linearize_rows<GnssPositiond, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<GnssPositiond, DiagonalNoise<3>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<GnssPositiond, FullNoise<3>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
