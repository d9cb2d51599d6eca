#include "oriel/window/imu_provider.h"

namespace oriel {
namespace {

void keep(State& state, VariableId<Pose3d> pose, VariableId<Velocity3d> velocity, VariableId<ImuBiasd> bias) {
  state.count = 3;
  state.variables[0] = pose;
  state.variables[1] = velocity;
  state.variables[2] = bias;
}

}  // namespace

FullNoise<6> level_pose_noise(const Pose3d& T_world_body, double position_sigma, double yaw_sigma, double tilt_sigma) {
  const Mat3d R = T_world_body.R.matrix();
  Mat3d W = Mat3d::zero();
  W(0, 0) = W(1, 1) = 1.0 / (tilt_sigma * tilt_sigma);
  W(2, 2) = 1.0 / (yaw_sigma * yaw_sigma);
  Mat6d information = Mat6d::zero();
  information.set_block(0, 0, R.transposed() * W * R);
  information.set_block(3, 3, Mat3d::identity() / (position_sigma * position_sigma));
  return Information(information);
}

ImuProvider::ImuProvider(const ImuNoise& noise, const ImuProviderOptions& options) : noise_(noise), options_(options) {
  samples_.reserve(options.expected_samples);
}

Result<void> ImuProvider::begin(GraphEdit& edit, State& state) {
  if (!start_) return Error{ErrorCode::not_found, "the first state of the IMU has not been said (start_at)"};
  keep(state, edit.add(start_->T_world_body), edit.add(start_->velocity), edit.add(start_->bias));
  edit.add(Prior{start_->T_world_body}, start_->pose_noise, pose(state));
  edit.add(Prior{start_->velocity}, start_->velocity_noise, velocity(state));
  edit.add(Prior{start_->bias}, start_->bias_noise, bias(state));
  return {};
}

void ImuProvider::ended(const Graph& graph, const State& last) {
  const ImuRestart& o = options_.restart;
  ImuStart next = start_.value_or(ImuStart{});
  next.T_world_body = graph.value(pose(last));
  next.velocity = graph.value(velocity(last));
  next.bias = graph.value(bias(last));
  next.pose_noise = level_pose_noise(next.T_world_body, o.position_sigma, o.yaw_sigma, o.tilt_sigma);
  next.velocity_noise = Sigma(o.velocity_sigma);
  start_ = next;
}

bool ImuProvider::covers(Time from, Time to) const {
  const auto used = samples_.between(from, to);
  const PreintegrationOptions& o = options_.samples;
  if (used.empty() || used.front().time - from > o.max_extrapolation || to - used.back().time > o.max_extrapolation)
    return false;
  for (std::size_t k = 1; k < used.size() && !options_.bridge_gaps; ++k)
    if (used[k].time > from && used[k - 1].time < to && used[k].time - used[k - 1].time > o.max_gap) return false;
  return true;
}

Result<Preintegration> ImuProvider::preintegrate_from(const GraphEdit& edit, const State& from, Time to) const {
  const ImuBiasd b = edit.value(bias(from));
  if (!options_.bridge_gaps) return preintegrate(samples_.samples(), from.time, to, b, noise_, options_.samples);
  const Vec3d rest = edit.value(pose(from)).R.inverse() * -options_.gravity;
  BridgeOptions bridge;
  bridge.covered = options_.samples;
  Result<BridgedPreintegration> across =
      preintegrate_across(samples_.samples(), from.time, to, b, noise_, rest, bridge);
  if (!across) return across.error();
  return across->integral;
}

// R_j = R_i ΔR, v_j = v_i + g Δt + R_i Δv, p_j = p_i + v_i Δt + g Δt²/2 + R_i Δp (Forster et al., TRO 2017, eq. 33).
Result<void> ImuProvider::predict(GraphEdit& edit, const State& from, State& state) {
  const Result<Preintegration> integral = preintegrate_from(edit, from, state.time);
  if (!integral) return integral.error();
  const PreintegratedImud& m = integral->motion;
  const Vec3d& g = options_.gravity;
  Pose3d x = edit.value(pose(from));
  Velocity3d v = edit.value(velocity(from));
  x.t += v.v * m.dt + g * (0.5 * m.dt * m.dt) + x.R * m.dp;
  v.v += g * m.dt + x.R * m.dv;
  x.R = (x.R * m.dR).normalized();
  keep(state, edit.add(x), edit.add(v), edit.add(edit.value(bias(from))));
  return {};
}

Result<FactorId> ImuProvider::link(GraphEdit& edit, const State& from, const State& to) {
  const Result<Preintegration> integral = preintegrate_from(edit, from, to.time);
  if (!integral) return integral.error();
  return edit.add(ImuResiduald{integral->motion, options_.gravity}, imu_noise(*integral), pose(from), velocity(from),
                  bias(from), pose(to), velocity(to), bias(to));
}

}  // namespace oriel
