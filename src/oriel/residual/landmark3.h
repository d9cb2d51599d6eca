// A sensor on a body sees a landmark at a place of its own frame (g2o's EDGE_SE3_TRACKXYZ, whose PARAMS_SE3OFFSET is
// T_body_sensor):
//   u = R_aᵀ (l - t_a),  r = R_sᵀ (u - t_s) - z [m] (3 × 1).
// The pose moves on its right, so that ∂u/∂a = [hat(u), -I] and ∂u/∂l = R_aᵀ.
#pragma once
#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/linearize_rows.h"
#include "oriel/residual/residual.h"
#include "oriel/sensor/sensor_pose.h"

namespace oriel {

template <class S>
struct Sighting3 {
  static constexpr std::string_view kName = "sighting3/1";
  static constexpr int kDim = 3;
  using Variables = Types<Pose3d, Point3d, SensorPosed>;  // T_world_body, the landmark, T_body_sensor
  template <class T>
  using rebind = Sighting3<T>;

  Vec<S, 3> measured;  // of the landmark, in the sensor's frame [m]

  Valid<S> evaluate(const Pose3<S>& a, const Point3<S>& l, const SensorPose<S>& sensor, Vec<S, 3>& r, Mat<S, 3, 6>* J_a,
                    Mat<S, 3, 3>* J_l) const {
    const Vec<S, 3> u = a.R.inverse() * (l.p - a.t);
    const Pose3<S>& s = sensor.T_body_sensor;
    r = s.R.inverse() * (u - s.t) - measured;
    if (J_a == nullptr) return always_valid<S>();
    const Mat<S, 3, 3> R_sb = s.R.inverse().matrix();
    J_a->set_block(0, 0, times_hat(R_sb, u));
    J_a->set_block(0, 3, -R_sb);
    *J_l = R_sb * a.R.inverse().matrix();
    return always_valid<S>();
  }
};
using Sighting3d = Sighting3<double>;

// Compiled once, in the library.
extern template void linearize_rows<Sighting3d, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Sighting3d, DiagonalNoise<3>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Sighting3d, FullNoise<3>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
