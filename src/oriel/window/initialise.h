// The first states of an inertial window: from standstill, or in motion from what a stereo camera sees. Ground truth is
// not asked. While it is not possible, it says why.
#pragma once
#include <optional>
#include <span>
#include <vector>

#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"
#include "oriel/sensor/feature_track.h"
#include "oriel/sensor/preintegration.h"
#include "oriel/window/imu_buffer.h"
#include "oriel/window/odometry_options.h"
#include "oriel/window/stereo_odometry.h"

namespace oriel {

struct FirstState {
  std::size_t frame = 0;  // place in the frames
  Time time;
  Pose3d T_world_body;
  Vec3d v_world = Vec3d::zero();  // [m/s]
};

struct Initialisation {
  enum class Kind { none, standstill, moving };
  Kind kind = Kind::none;
  const char* reason = "";         // of none
  std::vector<FirstState> states;  // by time; the world's z points up
  ImuBiasd bias;
};

// Means over the time in which the IMU did not move.
struct Standstill {
  Duration length;
  Vec3d gyro, accel;  // [rad/s] [m/s²]
};
// How long the IMU was still from t0 on: block by block, while means stay where those of the first block are. None
// where that is shorter than options.still; samples beyond `until` are not looked at.
std::optional<Standstill> find_standstill(std::span<const ImuSample> samples, Time t0, Time until,
                                          const InitialisationOptions& options);

// What aligns a stereo trajectory with an IMU.
struct InertialAlignment {
  ImuBiasd bias;
  Vec3d gravity = Vec3d::zero();  // in the frame of the poses [m/s²]
  std::vector<Vec3d> velocities;  // of each pose, in that frame [m/s]
};
// Metric poses (a frame of their own) at times: the gyroscope's bias from rotations; then, linear least squares, the
// velocities, gravity and the accelerometer's bias (near 0 by its prior) from [F] eq. 33: for each pair,
//   p_j - p_i - v_i Δt - g Δt²/2 = R_i (Δp + dp_da a),  v_j - v_i - g Δt = R_i (Δv + dv_da a).
Result<InertialAlignment> align_inertial(std::span<const TimedPose> poses, const ImuBuffer& imu, const ImuNoise& noise,
                                         const InertialOptions& options);

// The rotation that takes `up` to +z by the shortest way.
Rot3d level(const Vec3d& up);

class Initialiser {
 public:
  Initialiser(const StereoRigd& rig, bool stereo, const ImuNoise& noise, const OdometryOptions& options)
      : rig_(rig), stereo_(stereo), noise_(noise), options_(options) {}

  void add(const StereoFrame& frame);
  Initialisation attempt(const ImuBuffer& imu);
  std::size_t size() const { return frames_.size(); }
  StereoFrame frame(std::size_t k) const { return {frames_[k].time, frames_[k].features}; }
  void clear() { frames_.clear(); }

 private:
  struct Placed {
    std::size_t frame;
    TimedPose pose;
  };
  std::vector<Placed> place_frames(const ImuBuffer& imu) const;
  Initialisation start_moving(const ImuBuffer& imu);
  Initialisation start_still(const Standstill& still) const;
  bool tracks_are_still(Time until) const;

  struct Kept {
    Time time;
    std::vector<FeatureObservation> features;
  };
  StereoRigd rig_;
  bool stereo_;
  ImuNoise noise_;
  OdometryOptions options_;
  std::vector<Kept> frames_;
};

}  // namespace oriel
