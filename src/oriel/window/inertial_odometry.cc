#include "oriel/window/inertial_odometry.h"

#include <algorithm>
#include <cmath>

#include "oriel/window/relocate.h"

namespace oriel {
namespace {

const Sighting* sighting_at(const Track& track, Time time) {
  for (const Sighting& s : track.sightings)
    if (s.time == time) return &s;
  return nullptr;
}

constexpr int kLeastKnown = 8;  // points that a pose is refined from

double angle_between(const Vec3d& a, const Vec3d& b) { return std::atan2(cross(a, b).norm(), a.dot(b)); }

}  // namespace

UpdateReport InertialOdometry::update(const StereoFrame& frame) {
  if (!initialised_) return initialise(frame);
  return window_.defers() ? track_ahead(frame) : track(frame);
}

bool InertialOdometry::is_stale(const StereoFrame& frame, UpdateReport& report) const {
  report.time = frame.time;
  report.status = UpdateReport::Status::failed;
  report.reason = "the frame is not later than the one before";
  return frame.time <= timeline_.latest()->time;
}

UpdateReport InertialOdometry::track(const StereoFrame& frame) {
  UpdateReport report;
  if (is_stale(frame, report)) return report;
  if (!add_frame(frame, nullptr, report)) return miss(frame, report);
  missed_ = 0;
  if (const char* why = conclude(solve_at_once(options_.max_iterations), report)) return begin_anew(frame, why);
  if (report.status == UpdateReport::Status::tracking) keep(causal_, frame.time, report.values.T_world_body);
  return report;
}

// What a solve has found of the newest state: whether it is believed, is a keyframe, and who leaves then. Null, or why
// the window must begin anew.
const char* InertialOdometry::conclude(const Summary& summary, UpdateReport& report) {
  if (!gate_solved(summary, report)) {
    if (++failed_solves_ < options_.most_failed_solves) return nullptr;
    return "so many solves have failed, one after the other";
  }
  failed_solves_ = 0;
  if (const char* what = beyond_belief()) return what;
  InertialState& newest = *timeline_.change(timeline_.latest()->time);
  newest.keyframe = report.keyframe = is_keyframe(newest);
  fill(report);
  T_world_believed_ = report.values.T_world_body;
  if (newest.keyframe) slide();
  return nullptr;
}

// The IMU's samples do not reach from the last keyframe to this frame, and the cameras see too little that is known. A
// gap does not go away, and after some frames the window starts anew.
UpdateReport InertialOdometry::miss(const StereoFrame& frame, UpdateReport report) {
  drop(DropReason::no_motion);
  report.reason = "no IMU samples reach this frame, and too little that is known is in view";
  if (++missed_ < options_.most_missed_frames) return report;
  return begin_anew(frame, "no IMU samples, and too little that is known in view, for so many frames");
}

// What no vehicle does and no sensor has: null, or what it is.
const char* InertialOdometry::beyond_belief() const {
  const InertialValues v = values(*timeline_.latest());
  if (!(v.velocity.v.norm() <= options_.greatest_speed)) return "the estimated speed is beyond belief";
  if (!(v.bias.gyro.norm() <= options_.greatest_gyro_bias)) return "the estimated gyroscope bias is beyond belief";
  if (!(v.bias.accel.norm() <= options_.greatest_accel_bias))
    return "the estimated accelerometer bias is beyond belief";
  return nullptr;
}

InertialValues InertialOdometry::values(const InertialState& state) const {
  const Graph& g = window_.graph();
  return {g.value(state.pose), g.value(state.velocity), g.value(state.bias)};
}

void InertialOdometry::fill(UpdateReport& report) const {
  report.status = UpdateReport::Status::tracking;
  report.reason = "";
  report.values = values(*timeline_.latest());
  const Graph& g = window_.graph();
  report.landmarks = static_cast<int>(g.count<InverseDepthd>() + g.count<Point3d>());
  report.factors = static_cast<int>(window_.graph().factor_count());
}

const InertialState* InertialOdometry::last_keyframe() const {
  for (std::size_t k = timeline_.size(); k-- > 0;)
    if (timeline_[k].keyframe) return &timeline_[k];
  return nullptr;
}

// R_j = R_i ΔR, v_j = v_i + g Δt + R_i Δv, p_j = p_i + v_i Δt + g Δt²/2 + R_i Δp (Forster et al., TRO 2017, eq. 33),
// for a preintegration at the state's own biases.
InertialValues InertialOdometry::predict(const InertialState& from, const PreintegratedImud& motion) const {
  const InertialValues i = values(from);
  const Vec3d g = {{0.0, 0.0, -options_.inertial.gravity}};
  InertialValues j = i;
  j.T_world_body.R = (i.T_world_body.R * motion.dR).normalized();
  j.T_world_body.t =
      i.T_world_body.t + i.velocity.v * motion.dt + g * (0.5 * motion.dt * motion.dt) + i.T_world_body.R * motion.dp;
  j.velocity.v = i.velocity.v + g * motion.dt + i.T_world_body.R * motion.dv;
  return j;
}

// The motion since a state by the IMU, at the biases of the newest.
std::optional<BridgedPreintegration> InertialOdometry::motion_since(const InertialState& from, Time to) const {
  const Vec3d up = {{0.0, 0.0, options_.inertial.gravity}};
  const Vec3d rest = window_.graph().value(from.pose).R.inverse() * up;
  const auto motion =
      preintegrate_across(imu_.samples(), from.time, to, values(*timeline_.latest()).bias, noise_, rest);
  return motion ? std::optional(*motion) : std::nullopt;
}

bool InertialOdometry::add_frame(const StereoFrame& frame, const InertialValues* given, UpdateReport& report) {
  const InertialState latest = *timeline_.latest(), keyframe = *last_keyframe();
  const auto from_keyframe = motion_since(keyframe, frame.time);
  const auto from_latest = latest.keyframe ? from_keyframe : motion_since(latest, frame.time);
  if (!from_keyframe || !from_latest) return false;
  InertialValues predicted = given != nullptr ? *given : predict(latest, from_latest->integral.motion);
  drop(DropReason::no_ray, map_.observe(frame, {}, seen_));
  report.without_imu = from_latest->missing;
  const bool placed = given != nullptr || refine_prediction(predicted, from_keyframe->missing.ns == 0);
  if (from_keyframe->missing.ns > 0 && !placed) {  // neither the IMU nor the cameras say where it is
    map_.forget(frame.time);
    return false;
  }
  std::optional<InertialState> at_rest;
  if (!stereo_ && given == nullptr && from_keyframe->missing.ns == 0) at_rest = at_rest_since(frame.time, predicted);
  GraphEdit& edit = window_.edit();
  if (!latest.keyframe) give_way(edit);
  const InertialState state{frame.time, edit.add(predicted.T_world_body), edit.add(predicted.velocity),
                            edit.add(predicted.bias), false};
  timeline_.insert(state);
  edit.add(ImuResiduald{from_keyframe->integral.motion, {{0.0, 0.0, -options_.inertial.gravity}}},
           imu_noise(from_keyframe->integral), options_.inertial.loss, keyframe.pose, keyframe.velocity, keyframe.bias,
           state.pose, state.velocity, state.bias);
  if (at_rest) hold(edit, *at_rest, state);
  for (const std::uint32_t place : seen_) map_.track(place).sightings.back().pose = state.pose;
  add_sightings(edit, at_rest.has_value());
  return window_.commit().ok();
}

// Against the points that are known. True where enough of them agree with the pose; the sightings of those that are far
// from it are wrong matches and do not enter the solve. Where they agree with no pose, the IMU is right if it says how
// the body moved, and what is far from its prediction does not enter either.
bool InertialOdometry::refine_prediction(InertialValues& predicted, bool imu_covers) {
  known_.clear();
  known_places_.clear();
  for (const std::uint32_t place : seen_) {
    const Track& t = map_.track(place);
    const std::optional<Vec3d> p = builder_.position(window_.graph(), t);
    const Sighting& s = t.sightings.back();
    if (!p) continue;
    known_.push_back({*p, s.pixel0, s.pixel1, s.has_right});
    known_places_.push_back(place);
  }
  if (known_.size() < static_cast<std::size_t>(kLeastKnown)) return false;
  Pose3d& T = predicted.T_world_body;
  const Pose3d by_imu = T;
  const bool agreed = median_error(known_, rig_, T, pose_work_.errors) < options_.visual.refine_above ||
                      agrees(find_pose(known_, rig_, kLeastKnown, T, pose_work_), kLeastKnown);
  if (!agreed && !imu_covers) return false;
  if (!agreed) T = by_imu;
  const double gate = agreed ? options_.visual.match_gate : options_.visual.start_gate;
  for (std::size_t k = 0; k < known_.size(); ++k) {
    if (error_at(known_[k], rig_, T) <= gate) continue;
    map_.track(known_places_[k]).sightings.pop_back();
    std::erase(seen_, known_places_[k]);
    drop(DropReason::outlier);
  }
  return agreed;
}

// The newest state was no keyframe: it leaves with what it saw, and the IMU links across it.
void InertialOdometry::give_way(GraphEdit& edit) {
  const InertialState state = *timeline_.latest();
  for (std::uint32_t k = 0; k < map_.extent(); ++k) {
    Track& t = map_.track(k);
    if (t.live && t.has_landmark && sighting_at(t, state.time) != nullptr && t.sightings.size() < 3)
      builder_.remove(edit, t);
  }
  map_.forget(state.time);
  edit.remove(state.pose);
  edit.remove(state.velocity);
  edit.remove(state.bias);
  timeline_.remove(state.time);
}

void InertialOdometry::add_sightings(GraphEdit& edit, bool at_rest) {
  for (const std::uint32_t place : seen_) {
    Track& t = map_.track(place);
    if (t.has_landmark)
      builder_.extend(edit, t);
    else
      builder_.start(edit, t, at_rest);
  }
}

SolveOptions InertialOdometry::solve_options(int iterations) const {
  SolveOptions solve;
  solve.max_iterations = iterations;
  solve.function_tolerance = options_.function_tolerance;
  solve.first_estimates = options_.first_estimates;
  solve.trace = false;
  return solve;
}

bool InertialOdometry::gate_solved(const Summary& summary, UpdateReport& report) {
  report.iterations = summary.iterations;
  report.reason = summary.reason == Reason::refused ? "the solve was refused: its worker is lost, or its engine cannot"
                                                    : "the solve failed: a cost or a system that is not finite";
  if (summary.failed()) return false;
  report.reason = "an edit was refused";
  return gate() >= 0;
}

// Takes out sightings beyond the gate, and landmarks that they leave without support. How many; -1 where the edit is
// refused.
int InertialOdometry::gate() {
  GraphEdit& edit = window_.edit();
  const Graph& graph = window_.graph();
  const double gate = options_.visual.gate;
  int removed = 0;
  for (std::uint32_t k = 0; k < map_.extent(); ++k) {
    Track& t = map_.track(k);
    if (!t.live || !t.has_landmark) continue;
    const double rho = builder_.inverse_depth(graph, t);
    const bool deep =
        rho > 0.0 && rho * options_.visual.least_depth <= 1.0 && rho * 10.0 * options_.visual.greatest_depth >= 1.0;
    std::size_t kept = 1;
    for (std::size_t i = 0; deep && i < t.sightings.size(); ++i) {
      Sighting& s = t.sightings[i];
      const Vec2d e = builder_.errors(graph, t, s);
      if (i > 0 && !(e[0] <= gate)) {
        edit.remove(s.factor);
        s.in_graph = false;
        ++removed;
      } else if (!(e[1] <= gate)) {
        builder_.forget_right(edit, t, s);
        ++removed;
      }
      if (i > 0 && s.in_graph) t.sightings[kept++] = s;
    }
    if (deep) t.sightings.resize(kept);
    if (deep && kept > 1) continue;
    drop(deep ? DropReason::unsupported : DropReason::bad_depth);
    builder_.remove(edit, t);
    map_.close(k);
  }
  drop(DropReason::outlier, removed);
  return window_.commit() ? removed : -1;
}

bool InertialOdometry::is_keyframe(const InertialState& state) const {
  const InertialState* last = last_keyframe();
  if (last == nullptr || state.time - last->time >= options_.keyframes.interval) return true;
  const Pose3d a = window_.graph().value(last->pose), b = window_.graph().value(state.pose);
  const auto& mount = rig_.cameras[0];
  scratch_.clear();
  for (const std::uint32_t place : seen_) {
    const Track& t = map_.track(place);
    const Sighting* s = t.live ? sighting_at(t, last->time) : nullptr;
    if (s == nullptr || t.sightings.back().time != state.time) continue;
    const Vec2d &u = s->bearing, &v = t.sightings.back().bearing;
    scratch_.push_back(angle_between(a.R * (mount.R_body_camera * Vec3d{{u[0], u[1], 1.0}}),
                                     b.R * (mount.R_body_camera * Vec3d{{v[0], v[1], 1.0}})));
  }
  if (static_cast<double>(scratch_.size()) < options_.keyframes.least_shared * static_cast<double>(seen_.size()))
    return true;
  const auto middle = scratch_.begin() + static_cast<std::ptrdiff_t>(scratch_.size() / 2);
  std::nth_element(scratch_.begin(), middle, scratch_.end());
  return middle != scratch_.end() && *middle >= options_.keyframes.parallax;
}

void InertialOdometry::slide() {
  while (static_cast<int>(timeline_.size()) > options_.keyframes.max_keyframes) {
    const InertialState oldest = *timeline_.oldest();
    keep(left_, oldest.time, window_.graph().value(oldest.pose));
    leaving_.assign({oldest.pose, oldest.velocity, oldest.bias});
    MarginalizeOptions options;
    options.first_estimates = options_.first_estimates;
    if (const auto report = window_.slide(leaving_, options)) {
      drop(DropReason::marginal_outlier, report->dropped_outliers);
      drop(DropReason::marginal_invalid, report->dropped_invalid);
    } else {
      GraphEdit& edit = window_.edit();  // without what it knew, rather than a window that grows
      for (std::uint32_t k = 0; k < map_.extent(); ++k)
        if (Track& t = map_.track(k); t.live && t.has_landmark && t.sightings.front().time == oldest.time)
          builder_.remove(edit, t);
      for (const VariableKey id : leaving_) edit.remove(id);
      if (!window_.commit()) return;
    }
    ++marginalized_;
    close_tracks(oldest.time);
    timeline_.remove(oldest.time);
  }
  imu_.forget_before(timeline_.latest()->time - options_.rest.span);
}

// What is anchored at the oldest state was used up with it.
void InertialOdometry::close_tracks(Time oldest) {
  for (std::uint32_t k = 0; k < map_.extent(); ++k) {
    const Track& t = map_.track(k);
    if (t.live && t.has_landmark && t.sightings.front().time == oldest) map_.close(k);
  }
  map_.forget(oldest);
}

Trajectory InertialOdometry::final() const {
  Trajectory all = left_;
  for (const InertialState& s : timeline_) all.add(s.time, window_.graph().value(s.pose));
  return all;
}

}  // namespace oriel
