// Visual-inertial odometry over a sliding window: IMU and stereo (or mono) tracks in, poses out (docs/estimator.md).
//
// Each frame is a state (pose, velocity, biases) that the IMU links to the last keyframe. While a frame is the newest
// it sees all its tracks; when the next one comes, it stays if it is a keyframe and gives way if not. The oldest
// keyframe is marginalized when there are too many, with the landmarks that are anchored there.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "oriel/residual/imu_residual.h"
#include "oriel/window/imu_buffer.h"
#include "oriel/window/initialise.h"
#include "oriel/window/landmark_builder.h"
#include "oriel/window/relocate.h"
#include "oriel/window/timeline.h"
#include "oriel/window/track_map.h"
#include "oriel/window/trajectory.h"
#include "oriel/window/window_core.h"

namespace oriel {

struct InertialState {
  Time time;
  VariableId<Pose3d> pose;
  VariableId<Velocity3d> velocity;
  VariableId<ImuBiasd> bias;
  bool keyframe = false;
};

struct InertialValues {
  Pose3d T_world_body;
  Velocity3d velocity;
  ImuBiasd bias;
};

// Why a sighting, a landmark or a frame is not in the estimate.
enum class DropReason : std::uint8_t {
  no_ray,            // sighting: a pixel that the camera's model does not explain
  outlier,           // sighting: beyond the gate after a solve
  bad_depth,         // landmark: behind a camera, too near or too far after a solve
  unsupported,       // landmark: fewer than two sightings are left
  marginal_outlier,  // factor: beyond the gate when it was to be marginalized
  marginal_invalid,  // factor: not valid when it was to be marginalized
  uninitialised,     // frame: came before the start
  no_motion,         // frame: no IMU samples that reach it, and too little that is known in view
  count
};
inline constexpr std::array<const char*, static_cast<std::size_t>(DropReason::count)> kDropReasonNames = {
    "no_ray",           "outlier",          "bad_depth",     "unsupported",
    "marginal_outlier", "marginal_invalid", "uninitialised", "no_motion"};

struct UpdateReport {
  enum class Status { initialising, initialised, tracking, failed };
  Status status = Status::initialising;
  const char* reason = "";  // of initialising and failed
  const char* reset = "";   // why the window began anew in this update; empty where it did not
  Time time;
  InertialValues values;  // at that time; of initialised and tracking
  bool keyframe = false;
  int iterations = 0, landmarks = 0, factors = 0;
  Duration without_imu;  // since the state before: how long no samples say how it moved
};

// How well a first state is known, by what it was said to be: standard deviations, each scalar by itself.
struct StartSigmas {
  Vec6d pose;                                                // in the body's frame [rad] [m]
  double velocity = 0.0, gyro_bias = 0.0, accel_bias = 0.0;  // [m/s] [rad/s] [m/s²]
};

class InertialOdometry {
 public:
  InertialOdometry(const StereoRigd& rig, bool stereo, const ImuNoise& noise, const OdometryOptions& options);

  // Samples in the order of time; a frame is given after the samples up to its time.
  Result<void> add_imu(const ImuSample& sample) { return imu_.add(sample); }
  UpdateReport update(const StereoFrame& frame);
  // Starts (anew, if it had started) at a frame whose state somebody knows, instead of finding a start by itself.
  UpdateReport start_at(const StereoFrame& frame, const InertialValues& values, const StartSigmas& sigmas);

  const Trajectory& causal() const { return causal_; }  // each state at the moment of its own update
  Trajectory final() const;                             // each state as it was when it left the window, or is now
  int left() const { return marginalized_; }            // states that were marginalized so far
  const std::array<std::int64_t, kDropReasonNames.size()>& dropped() const { return dropped_; }
  WindowCore& window() { return window_; }
  const Timeline<InertialState>& timeline() const { return timeline_; }
  InertialValues values(const InertialState& state) const;

 private:
  UpdateReport initialise(const StereoFrame& frame);
  bool begin(const Initialisation& start, UpdateReport& report);
  void add_first_priors(GraphEdit& edit, const InertialState& state, const InertialValues& values,
                        Initialisation::Kind kind);
  void restart();
  UpdateReport begin_anew(const StereoFrame& frame, const char* why);
  const char* beyond_belief() const;
  void say(Time time, const Pose3d& T_world_body) {
    keep(causal_, time, T_world_body);
    T_world_said_ = T_world_body;
  }
  void keep(Trajectory& trajectory, Time time, const Pose3d& T_world_body) const {
    if (options_.keep_trajectory) trajectory.add(time, T_world_body);
  }
  UpdateReport track(const StereoFrame& frame);
  UpdateReport miss(const StereoFrame& frame, UpdateReport report);
  std::optional<BridgedPreintegration> motion_since(const InertialState& from, Time to) const;
  bool add_frame(const StereoFrame& frame, const InertialValues* given, UpdateReport& report);
  bool link(GraphEdit& edit, const InertialState& from, const InertialState& to, const ImuBiasd& bias);
  InertialValues predict(const InertialState& from, const PreintegratedImud& motion) const;
  bool refine_prediction(InertialValues& predicted, bool imu_covers);
  void give_way(GraphEdit& edit);
  void add_sightings(GraphEdit& edit, bool at_rest);
  bool solve_and_gate(int iterations, UpdateReport& report);
  int gate();
  bool is_keyframe(const InertialState& state) const;
  std::optional<InertialState> at_rest_since(Time time, const InertialValues& predicted) const;
  void hold(GraphEdit& edit, const InertialState& before, const InertialState& state) const;
  double median_motion_since(Time earlier) const;
  void slide();
  void close_tracks(Time oldest);
  void drop(DropReason reason, std::int64_t n = 1) { dropped_[static_cast<std::size_t>(reason)] += n; }
  void fill(UpdateReport& report) const;
  const InertialState* last_keyframe() const;

  OdometryOptions options_;
  ImuNoise noise_;
  StereoRigd rig_;
  bool stereo_;
  ImuBuffer imu_;
  WindowCore window_;
  Timeline<InertialState> timeline_;
  TrackMap map_;
  LandmarkBuilder builder_;
  Initialiser initialiser_;
  bool initialised_ = false;
  int missed_ = 0;                      // frames one after the other that no IMU samples reach
  int failed_solves_ = 0;               // one after the other
  int marginalized_ = 0;                // states
  std::optional<Pose3d> T_world_last_;  // of the window before a restart: the next one begins there
  std::optional<Pose3d> T_world_said_;  // the newest that was believed
  Trajectory causal_, left_;
  std::array<std::int64_t, kDropReasonNames.size()> dropped_{};

  std::vector<std::uint32_t> seen_;  // places of the newest frame's tracks
  std::vector<PointSighting> known_;
  std::vector<std::uint32_t> known_places_;
  PoseWorkspace pose_work_;
  std::vector<VariableKey> leaving_;
  mutable std::vector<double> scratch_;
};

}  // namespace oriel
