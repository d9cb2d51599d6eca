// Whether two estimates are the same, bit for bit.
#pragma once
#include <cstring>

#include "oriel/window/inertial_odometry.h"

namespace oriel {

inline bool same_bits(const Pose3d& a, const Pose3d& b) { return std::memcmp(&a, &b, sizeof(Pose3d)) == 0; }
inline bool same_bits(const InertialValues& a, const InertialValues& b) {
  return same_bits(a.T_world_body, b.T_world_body) && a.velocity.v == b.velocity.v && a.bias.gyro == b.bias.gyro &&
         a.bias.accel == b.bias.accel;
}
inline bool same_bits(const Trajectory& a, const Trajectory& b) {
  if (a.poses().size() != b.poses().size()) return false;
  for (std::size_t i = 0; i < a.poses().size(); ++i)
    if (a.poses()[i].time != b.poses()[i].time || !same_bits(a.poses()[i].T_world_body, b.poses()[i].T_world_body))
      return false;
  return true;
}

}  // namespace oriel
