// The distance from an antenna on the body to a place in the world: one that is estimated (a Point3d), or a beacon that
// was surveyed (a constant).
//   d = p_world_body + R_world_body l - b,   r = ‖d‖ - z [m] (1 × 1),   u = d / ‖d‖
// J_pose = uᵀ [-R hat(l), R],  J_point = -uᵀ. At the place itself u does not exist, and the factor is not valid.
#pragma once
#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/linearize_rows.h"
#include "oriel/residual/noise.h"
#include "oriel/residual/residual.h"
#include "oriel/sensor/lever_arm.h"

namespace oriel {

inline constexpr double kLeastRange = 1e-6;  // [m]

namespace detail {

template <class S>
Valid<S> evaluate_range(const S& range, const Pose3<S>& x, const Vec<S, 3>& place, const Vec<S, 3>& lever, Vec<S, 1>& r,
                        Mat<S, 1, 6>* J_x, Mat<S, 1, 3>* J_place) {
  using std::sqrt;
  const Vec<S, 3> d = x * lever - place;
  const S squared = d.squared_norm();
  const auto valid = squared > S(kLeastRange * kLeastRange);
  const S distance = sqrt(select(valid, squared, S(1.0)));
  r[0] = distance - range;
  if (J_x != nullptr) {
    const Mat<S, 1, 3> u = d.transposed() / distance, uR = u * x.R.matrix();
    J_x->set_block(0, 0, -times_hat(uR, lever));
    J_x->set_block(0, 3, uR);
    if (J_place != nullptr) *J_place = -u;
  }
  return valid;
}

}  // namespace detail

template <class S>
struct RangeToPoint {
  static constexpr std::string_view kName = "range_to_point/1";
  static constexpr int kDim = 1;
  using Variables = Types<Pose3d, Point3d, LeverArmd>;  // T_world_body, the place, the antenna
  template <class T>
  using rebind = RangeToPoint<T>;

  S range;  // measured [m]

  Valid<S> evaluate(const Pose3<S>& x, const Point3<S>& place, const LeverArm<S>& antenna, Vec<S, 1>& r,
                    Mat<S, 1, 6>* J_x, Mat<S, 1, 3>* J_place) const {
    return detail::evaluate_range(range, x, place.p, antenna.p_body_sensor, r, J_x, J_place);
  }
};
using RangeToPointd = RangeToPoint<double>;

template <class S>
struct RangeToBeacon {
  static constexpr std::string_view kName = "range_to_beacon/1";
  static constexpr int kDim = 1;
  using Variables = Types<Pose3d, Beacond, LeverArmd>;  // T_world_body, the place, the antenna
  template <class T>
  using rebind = RangeToBeacon<T>;

  S range;  // measured [m]

  Valid<S> evaluate(const Pose3<S>& x, const Beacon<S>& beacon, const LeverArm<S>& antenna, Vec<S, 1>& r,
                    Mat<S, 1, 6>* J_x) const {
    return detail::evaluate_range<S>(range, x, beacon.p_world_beacon, antenna.p_body_sensor, r, J_x, nullptr);
  }
};
using RangeToBeacond = RangeToBeacon<double>;

// Compiled once, in the library.
extern template void linearize_rows<RangeToPointd, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<RangeToBeacond, IsotropicNoise>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
