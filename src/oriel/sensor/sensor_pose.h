// Where a sensor sits on the body and how it is turned: a constant of the graph that all its measurements share.
#pragma once
#include "oriel/manifold/se3.h"

namespace oriel {

template <class S>
struct SensorPose {
  static constexpr std::string_view kName = "sensor_pose/1";
  static constexpr int kDim = 0;
  template <class T>
  using rebind = SensorPose<T>;

  Pose3<S> T_body_sensor{};
};
using SensorPosed = SensorPose<double>;

static_assert(Constant<SensorPosed> && Rebindable<SensorPosed>);

}  // namespace oriel
