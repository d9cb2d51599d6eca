// Visual odometry of a stereo camera over a few frames, for the start: each frame against the points that earlier ones
// triangulated.
#pragma once
#include <utility>
#include <vector>

#include "oriel/sensor/feature_track.h"
#include "oriel/window/relocate.h"

namespace oriel {

struct TimedPose {
  Time time;
  Pose3d T_world_body;
};

class StereoOdometry {
 public:
  StereoOdometry(const StereoRigd& rig, int least_points) : rig_(rig), least_points_(least_points) {}

  // `turn` is the rotation since the last frame that was kept, R_last_body, as a gyroscope says. The first frame is the
  // origin. Returns how many points agree with the pose that was found, or 0 if they are less than a third; the first
  // frame has as many as it triangulated. Where they are fewer than `least_points` the frame is not kept, and the next
  // one's turn is still since the last frame that was.
  int add(const StereoFrame& frame, const Rot3d& turn);
  const std::vector<TimedPose>& poses() const { return poses_; }

 private:
  void triangulate_new(const StereoFrame& frame, const Pose3d& T_world_body);

  StereoRigd rig_;
  int least_points_;
  std::vector<TimedPose> poses_;
  std::vector<std::pair<std::int64_t, Vec3d>> points_;  // by track
  std::vector<PointSighting> sightings_;
  PoseWorkspace work_;
};

}  // namespace oriel
