// Trajectory: poses by time, as an estimator said them.
#pragma once
#include <vector>

#include "oriel/base/time.h"
#include "oriel/manifold/se3.h"

namespace oriel {

struct StampedPose {
  Time time;
  Pose3d T_world_body;
};

// In the order in which they were said. One that is said of the newest time again replaces the one before.
class Trajectory {
 public:
  void reserve(std::size_t poses) { poses_.reserve(poses); }
  void add(Time time, const Pose3d& T_world_body) {
    if (!poses_.empty() && poses_.back().time == time)
      poses_.back().T_world_body = T_world_body;
    else
      poses_.push_back({time, T_world_body});
  }
  const std::vector<StampedPose>& poses() const { return poses_; }

 private:
  std::vector<StampedPose> poses_;
};

}  // namespace oriel
