#include "oriel/run/two_frame_task.h"

#include <algorithm>
#include <cmath>

#include "oriel/run/two_frame_problem.h"
#include "oriel/window/relocate.h"
#include "oriel/window/stereo_point.h"

namespace oriel {
namespace {

using run_detail::TwoFrameProblem;

template <int N>
bool finite(const Vec<double, N>& v) {
  for (int i = 0; i < N; ++i)
    if (!std::isfinite(v[i])) return false;
  return true;
}

// T_a_b from which the median of the errors in pixels is small, whatever the guess was.
Pose3d robust_start(const TwoFrameInput& in, const TwoFrameTask::Context& context) {
  std::vector<PointSighting> sightings;
  for (const PointMatch& m : in.matches)  // one NaN would spoil the sums over all
    if (finite(m.p_a) && finite(m.pixel0) && finite(m.pixel1))
      sightings.push_back({m.p_a, m.pixel0, m.pixel1, m.has_right != 0});
  Pose3d T = in.T_a_b;
  PoseWorkspace work;
  (void)find_pose(sightings, context.rig, context.options.least_observations, T, work);
  return T;
}

bool enough(int inliers, std::size_t matches, int least) {
  return inliers >= least && 3 * static_cast<std::size_t>(inliers) >= matches;
}

void finish(TwoFrameOutput& out, const TwoFrameInput& in, const TwoFrameProblem& problem, int least) {
  out.figures.inliers = problem.inliers();
  out.figures.initial_cost = problem.summary().initial_cost;
  out.figures.final_cost = problem.summary().final_cost;
  if (!enough(out.figures.inliers, in.matches.size(), least)) {
    out.status = FrameStatus::no_agreement;
    out.reason = std::to_string(out.figures.inliers) + " of " + std::to_string(in.matches.size()) + " matches agree";
    return;
  }
  const auto covariance = problem.covariance();
  if (!covariance) {
    out.status = FrameStatus::failed;
    out.reason = "no covariance: " + covariance.error().message;
    return;
  }
  out.status = FrameStatus::solved;
  out.reason = problem.summary().reason_text();
  out.covariance = *covariance;
  out.T_a_b = problem.T_a_b();
  out.T_world_b = problem.T_world_b();
  for (std::size_t k = 0; k < in.matches.size(); ++k)
    if (problem.is_inlier(k)) out.inlier_observations.push_back(in.matches[k].observation);
}

}  // namespace

std::string fault_of(const TwoFrameOptions& o) {
  if (static_cast<int>(o.residual) > 3 || static_cast<int>(o.coordinates) > 1 || static_cast<int>(o.source) > 1)
    return "expected a residual, coordinates and a source that there are";
  if (o.least_observations < 3) return "expected 3 or more observations for a pose";
  if (!(o.pixel_sigma > 0.0) || !(o.huber > 0.0) || !(o.gate > 0.0) || !(o.greatest_depth_share > 0.0))
    return "expected a pixel sigma, Huber scale, gate and depth share above 0";
  if (o.rounds < 1 || o.max_iterations < 1) return "expected a round and an iteration at least";
  return {};
}

Result<TwoFrameTask::Context> TwoFrameTask::init_context(const Config& config) {
  const std::string fault = fault_of(config.options);
  if (!fault.empty()) return Error{ErrorCode::bad_input, fault};
  for (const auto& mount : config.rig.cameras)
    if (!(std::fabs(mount.camera.fx) > 0.0) || !(std::fabs(mount.camera.fy) > 0.0))
      return Error{ErrorCode::bad_input, "expected two cameras with focal lengths"};
  return Context{config.options, config.rig};
}

TwoFrameInput TwoFrameTask::collect(const VisualMap& map, std::uint32_t a, std::uint32_t b, const Pose3d& T_a_b,
                                    const TwoFrameOptions& options, const std::vector<std::uint32_t>& point_of) const {
  const MapObservations& o = map.observations;
  const StereoRigd& rig = map.rigs[map.frames.rig[b]];
  TwoFrameInput in;
  in.frame_a = a;
  in.frame_b = b;
  in.observations = map.frames.count[b];
  in.T_world_a = map.frames.T_world_body[a];
  in.T_a_b = T_a_b;
  const Pose3d T_a_world = in.T_world_a.inverse();
  for (std::uint32_t k = 0; k < map.frames.count[b]; ++k) {
    const std::uint32_t row = map.frames.first[b] + k, point = point_of[k];
    if (point == kNoRow) continue;
    PointMatch m;
    m.observation = row;
    m.has_right = o.has_right[row];
    m.has_point = o.has_point(row) ? 1 : 0;
    if (options.residual == MatchResidual::points && m.has_point == 0) continue;
    if (options.residual == MatchResidual::disparity && m.has_right == 0) continue;
    const std::uint32_t f = map.points.frame[point];
    const Pose3d T_a_f = f == kNoRow ? T_a_world : f == a ? Pose3d{} : T_a_world * map.frames.T_world_body[f];
    const Mat3d R = T_a_f.R.matrix();
    m.p_a = T_a_f * map.points.p[point];
    m.covariance_a = R * map.points.covariance[point] * R.transposed();
    m.pixel0 = o.pixel0[row];
    m.pixel1 = o.pixel1[row];
    m.covariance0 = o.covariance0[row];
    m.covariance1 = o.covariance1[row];
    m.p_b = in_body(rig, o.p_camera[row]);
    m.covariance_b = in_body(rig, o.covariance[row]);
    in.matches.push_back(m);
  }
  return in;
}

TwoFrameOutput TwoFrameTask::optimize(Context& context, const Input& in) {
  const TwoFrameOptions& options = context.options;
  TwoFrameOutput out;
  out.frame_a = in.frame_a;
  out.frame_b = in.frame_b;
  out.T_a_b = in.T_a_b;
  out.T_world_b = in.T_world_a * in.T_a_b;
  out.figures.matches = static_cast<int>(in.matches.size());
  if (out.figures.matches < options.least_observations) {
    out.reason = out.figures.matches == 0 ? "no matches"
                                          : std::to_string(out.figures.matches) + " matches, fewer than " +
                                                std::to_string(options.least_observations);
    return out;
  }
  TwoFrameProblem problem(context, in, options.robust_start ? robust_start(in, context) : in.T_a_b);
  for (int round = 0; round < options.rounds; ++round) {
    if (problem.weigh() < options.least_observations) break;
    out.figures.iterations += problem.solve();
    if (problem.summary().failed()) {
      out.status = FrameStatus::failed;
      out.reason = problem.summary().reason_text();
      return out;
    }
  }
  problem.judge();
  finish(out, in, problem, options.least_observations);
  return out;
}

void TwoFrameTask::write(const Output& out, Map& to) {
  VisualMap& map = to.visual;
  to.last = out;
  if (out.frame_b >= map.frames.size()) return;
  map.frames.status[out.frame_b] = out.status;
  if (out.status != FrameStatus::solved) return;
  map.frames.T_world_body[out.frame_b] = out.T_world_b;
  map.frames.covariance[out.frame_b] = out.covariance;
  map.frames.previous[out.frame_b] = out.frame_a;
  for (const std::uint32_t row : out.inlier_observations)
    if (row < map.observations.size()) map.observations.inlier[row] = 1;
}

}  // namespace oriel
