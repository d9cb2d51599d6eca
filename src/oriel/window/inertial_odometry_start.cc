// The start of InertialOdometry: from buffered frames to the first window.
#include <cmath>

#include "oriel/residual/prior.h"
#include "oriel/window/imu_provider.h"
#include "oriel/window/inertial_odometry.h"
#include "oriel/window/rehearse.h"

namespace oriel {
namespace {

ImuNoise scaled(ImuNoise n, const InertialOptions& o) {
  n.gyro *= o.noise_factor;
  n.accel *= o.noise_factor;
  n.gyro_walk *= o.walk_factor;
  n.accel_walk *= o.walk_factor;
  return n;
}

OdometryOptions chosen(OdometryOptions options, bool stereo) {
  LandmarkModel& landmarks = options.visual.landmarks;
  if (landmarks == LandmarkModel::by_cameras) landmarks = stereo ? LandmarkModel::point : LandmarkModel::inverse_depth;
  return options;
}

constexpr std::size_t kTracks = 4096, kPoses = 8192, kSamples = 8192;  // room for, before memory is asked for again

// What puts `from` where `to` is by a shift and a turn about z: the turn that brings its axes nearest to those of `to`.
Pose3d level_motion(const Pose3d& from, const Pose3d& to) {
  const Mat3d R = (to.R * from.R.inverse()).matrix();
  const Rot3d turn = Rot3d::exp({{0.0, 0.0, std::atan2(R(1, 0) - R(0, 1), R(0, 0) + R(1, 1))}});
  return {turn, to.t - turn * from.t};
}

}  // namespace

InertialOdometry::InertialOdometry(const StereoRigd& rig, bool stereo, const ImuNoise& noise,
                                   const OdometryOptions& options)
    : options_(chosen(options, stereo)),
      noise_(scaled(noise, options.inertial)),
      rig_(rig),
      stereo_(stereo),
      map_(rig, stereo),
      builder_(options_.visual, rig),
      initialiser_(rig, stereo, noise_, options_) {
  const std::size_t states = static_cast<std::size_t>(options.keyframes.max_keyframes) + 2;
  timeline_.reserve(states);
  map_.reserve(kTracks, states);
  imu_.reserve(kSamples);
  causal_.reserve(kPoses);
  left_.reserve(kPoses);
  seen_.reserve(kTracks);
  known_.reserve(kTracks);
  known_places_.reserve(kTracks);
  scratch_.reserve(kTracks);
  pose_work_.errors.reserve(kTracks);
  pose_work_.pairs.reserve(kTracks);
  builder_.reserve(states);
  const int with_holes = static_cast<int>(states) * 4 / 3 + 2;  // a pool closes its holes when they are a fourth
  (void)rehearse(window_, rig, {with_holes, options.keyframes.expected_tracks, options_.visual.landmarks, !stereo});
}

UpdateReport InertialOdometry::initialise(const StereoFrame& frame) {
  UpdateReport report;
  report.time = frame.time;
  initialiser_.add(frame);
  const Initialisation start = initialiser_.attempt(imu_);
  if (start.kind == Initialisation::Kind::none) {
    report.reason = start.reason;
    drop(DropReason::uninitialised);
    return report;
  }
  initialised_ = true;
  if (!begin(start, report)) {
    restart();
    report.status = UpdateReport::Status::initialising;
    return report;
  }
  report.status = UpdateReport::Status::initialised;
  initialiser_.clear();
  return report;
}

void InertialOdometry::restart() {
  if (T_world_believed_) T_world_last_ = T_world_believed_;
  initialised_ = false;
  missed_ = failed_solves_ = 0;
  for (const InertialState& s : timeline_) keep(left_, s.time, window_.graph().value(s.pose));
  initialiser_.clear();
  timeline_.clear();
  map_.clear();
  (void)window_.clear();
}

// What was estimated so far is given up, for a reason that the report names; the frame may be the first of a new start.
UpdateReport InertialOdometry::begin_anew(const StereoFrame& frame, const char* why) {
  restart();
  UpdateReport report = initialise(frame);
  report.reset = why;
  return report;
}

UpdateReport InertialOdometry::start_at(const StereoFrame& frame, const InertialValues& v, const StartSigmas& sigmas) {
  if (window_.has_begun()) (void)settle();
  if (initialised_) restart();
  initialiser_.clear();
  UpdateReport report;
  report.time = frame.time;
  GraphEdit& edit = window_.edit();
  builder_.set_rig(edit.add(rig_));
  const InertialState state{frame.time, edit.add(v.T_world_body), edit.add(v.velocity), edit.add(v.bias), true};
  const double g = sigmas.gyro_bias, a = sigmas.accel_bias;
  edit.add(Prior{v.T_world_body}, Sigmas(sigmas.pose), state.pose);
  edit.add(Prior{v.velocity}, Sigma(sigmas.velocity), state.velocity);
  edit.add(Prior{v.bias}, Sigmas(Vec6d{{g, g, g, a, a, a}}), state.bias);
  drop(DropReason::no_ray, map_.observe(frame, state.pose, seen_));
  report.reason = "the first state was refused";
  if (!window_.commit()) return report;
  initialised_ = true;
  timeline_.insert(state);
  fill(report);
  report.status = UpdateReport::Status::initialised;
  report.keyframe = true;
  say(frame.time, v.T_world_body);
  return report;
}

bool InertialOdometry::begin(const Initialisation& start, UpdateReport& report) {
  const FirstState& first = start.states.front();
  const Pose3d T_world_origin = T_world_last_ ? level_motion(first.T_world_body, *T_world_last_) : Pose3d{};
  GraphEdit& edit = window_.edit();
  builder_.set_rig(edit.add(rig_));
  InertialValues v{T_world_origin * first.T_world_body, {T_world_origin.R * first.v_world}, start.bias};
  const InertialState state{first.time, edit.add(v.T_world_body), edit.add(v.velocity), edit.add(v.bias), true};
  timeline_.insert(state);
  add_first_priors(edit, state, v, start.kind);
  drop(DropReason::no_ray, map_.observe(initialiser_.frame(first.frame), state.pose, seen_));
  report.reason = "the first window was refused";
  if (!window_.commit()) return false;

  for (std::size_t k = 1; k < start.states.size(); ++k) {
    const FirstState& s = start.states[k];
    v = {T_world_origin * s.T_world_body, {T_world_origin.R * s.v_world}, start.bias};
    if (!add_frame(initialiser_.frame(s.frame), &v, report)) return false;
    timeline_.change(s.time)->keyframe = true;
  }
  if (start.states.size() > 1) {
    for (int round = 0; round < 3; ++round)
      if (!gate_solved(solve_at_once(50), report)) return false;
    fill(report);
    say(report.time, report.values.T_world_body);
  }
  for (std::size_t k = start.states.back().frame + 1; k < initialiser_.size(); ++k) {
    report = track(initialiser_.frame(k));
    if (report.status == UpdateReport::Status::failed) return false;
  }
  return true;
}

void InertialOdometry::add_first_priors(GraphEdit& edit, const InertialState& state, const InertialValues& v,
                                        Initialisation::Kind kind) {
  const InitialisationOptions& o = options_.initialisation;
  edit.add(Prior{v.T_world_body}, level_pose_noise(v.T_world_body, o.position_sigma, o.yaw_sigma, o.tilt_sigma),
           state.pose);
  if (kind == Initialisation::Kind::standstill)
    edit.add(Prior{Velocity3d{}}, Sigma(o.rest_velocity_sigma), state.velocity);
  const double g = options_.inertial.gyro_bias_sigma, a = options_.inertial.accel_bias_sigma;
  ImuBiasd mean = v.bias;
  mean.accel = Vec3d::zero();
  edit.add(Prior{mean}, Sigmas(Vec6d{{g, g, g, a, a, a}}), state.bias);
}

}  // namespace oriel
