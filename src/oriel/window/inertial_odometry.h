// Visual-inertial odometry over a sliding window: IMU and stereo (or mono) tracks in, poses out (docs/estimator.md).
//
// Each frame is a state (pose, velocity, biases) that the IMU links to the last keyframe. While a frame is the newest
// it sees all its tracks; when the next one comes, it stays if it is a keyframe and gives way if not. The oldest
// keyframe is marginalized when there are too many, with the landmarks that are anchored there.
//
// Beside its caller (`window().defer_to(...)`, run/window_solver.h): an update merges the solve that the one before
// began, predicts its own frame by the IMU and refines that by the points that are known, begins the frame's solve and
// returns. What is solved has the same bits as in a window that waits; what an update says of its own frame is a
// prediction. The solves of a start are waited for.
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

// What a solve that went on beside the caller has found of the frame that it was begun for.
struct SolvedFrame {
  Time time;
  const char* failure = "";  // why it is not believed, and the frame stays as it was predicted; empty where it is
  bool begins_anew = false;  // the window does, for that reason
  InertialValues values;     // where it is believed
  bool keyframe = false;
  int iterations = 0;
};

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
  // Beside the caller: `values` are of before the solve, which this update began, and whether the frame is a keyframe
  // is not known yet; `solved` is what the update has merged, of the frame before.
  bool predicted = false;
  std::optional<SolvedFrame> solved;
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
  // Waits for the solve that the last update began, and merges it as the next one would: the report that an update
  // that waits would have made of that frame. Where nothing was begun: failed, with that as its reason.
  UpdateReport settle();

  // Each state at the moment of its own update: as it was solved, or, beside the caller, predicted.
  const Trajectory& causal() const { return causal_; }
  Trajectory final() const;                   // each state as it was when it left the window, or is now
  int left() const { return marginalized_; }  // states that were marginalized so far
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
    T_world_believed_ = T_world_body;
  }
  void keep(Trajectory& trajectory, Time time, const Pose3d& T_world_body) const {
    if (options_.keep_trajectory) trajectory.add(time, T_world_body);
  }
  UpdateReport track(const StereoFrame& frame);
  UpdateReport track_ahead(const StereoFrame& frame);
  bool is_stale(const StereoFrame& frame, UpdateReport& report) const;
  UpdateReport predict_frame(const StereoFrame& frame);
  SolvedFrame merge();
  const char* conclude(const Summary& summary, UpdateReport& report);
  UpdateReport miss(const StereoFrame& frame, UpdateReport report);
  std::optional<BridgedPreintegration> motion_since(const InertialState& from, Time to) const;
  bool add_frame(const StereoFrame& frame, const InertialValues* given, UpdateReport& report);
  bool link(GraphEdit& edit, const InertialState& from, const InertialState& to, const ImuBiasd& bias);
  InertialValues predict(const InertialState& from, const PreintegratedImud& motion) const;
  bool refine_prediction(InertialValues& predicted, bool imu_covers);
  void give_way(GraphEdit& edit);
  void add_sightings(GraphEdit& edit, bool at_rest);
  SolveOptions solve_options(int iterations) const;
  Summary solve_at_once(int iterations);
  bool gate_solved(const Summary& summary, UpdateReport& report);
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
  int missed_ = 0;                          // frames one after the other that no IMU samples reach
  int failed_solves_ = 0;                   // one after the other
  int marginalized_ = 0;                    // states
  std::optional<Pose3d> T_world_last_;      // of the window before a restart: the next one begins there
  std::optional<Pose3d> T_world_believed_;  // the newest of a solve
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
