#include "apps/pose_graph_start.h"

#include <cmath>
#include <vector>

#include "oriel/io/chain_odometry.h"
#include "oriel/io/landmarks.h"
#include "oriel/residual/loss.h"
#include "oriel/residual/pose_graph.h"

namespace oriel::apps {
namespace {

Pose3d pose_of(const PoseGraphFile::SpatialPose& p) { return {Rot3d{p.qx, p.qy, p.qz, p.qw}, p.t}; }
Pose2d pose_of(const Vec3d& p) { return {Rot2d::exp(p[2]), {{p[0], p[1]}}}; }

template <class Out, class In>
std::vector<Out> poses_of(const std::vector<In>& file_poses) {
  std::vector<Out> poses;
  poses.reserve(file_poses.size());
  for (const In& p : file_poses) poses.push_back(pose_of(p));
  return poses;
}

// rᵀ Ω r: the information as written, not its root, since nothing is linearized here.
template <int N>
double squared_norm(const Vec<double, N>& r, const Mat<double, N, N>& information) {
  double sum = 0.0;
  for (int j = 0; j < N; ++j)
    for (int i = 0; i < N; ++i) sum += r[i] * information(i, j) * r[j];
  return sum;
}

template <class Residual, class Pose, class Edge>
double cost_of(const std::vector<Edge>& edges, const std::vector<Pose>& poses, const Loss& loss) {
  double sum = 0.0;
  for (const Edge& e : edges) {
    Vec<double, Residual::kDim> r;
    Residual{pose_of(e.measurement)}.evaluate(poses[e.from], poses[e.to], r, nullptr, nullptr);
    sum += evaluate_loss(loss.kind, loss.scale, squared_norm(r, information_matrix(e))).rho;
  }
  return 0.5 * sum;
}

}  // namespace

double start_cost(const PoseGraphFile& file, const PoseGraphOptions& options, PoseStart start) {
  const bool chained = start == PoseStart::odometry || !file.has_vertices;
  if (!file.is_3d) {
    const auto poses = chained ? chain_odometry2(file) : poses_of<Pose2d>(file.planar_poses);
    return cost_of<PoseGraphEdge2d>(file.planar_edges, poses, options.loss) +
           landmark_cost2(file, poses, start_landmarks2(file, !chained, poses), options.loss);
  }
  const auto poses = chained ? chain_odometry3(file) : poses_of<Pose3d>(file.spatial_poses);
  return landmark_cost3(file, poses, start_landmarks3(file, !chained, poses), options.loss) +
         (options.rotation_error == RotationError::quaternion
              ? cost_of<PoseGraphEdge3d>(file.spatial_edges, poses, options.loss)
              : cost_of<PoseGraphEdgeLog3d>(file.spatial_edges, poses, options.loss));
}

PoseStart choose_start(const PoseGraphFile& file, const PoseGraphOptions& options, StartChoice choice) {
  if (!file.has_vertices || choice == StartChoice::odometry) return PoseStart::odometry;
  if (choice == StartChoice::file) return PoseStart::file;
  const double from_file = start_cost(file, options, PoseStart::file);
  const double chained = start_cost(file, options, PoseStart::odometry);
  // Rounding decides where both are one start: the file's, then.
  return chained < from_file * (1.0 - 1e-9) || (std::isfinite(chained) && !std::isfinite(from_file))
             ? PoseStart::odometry
             : PoseStart::file;
}

}  // namespace oriel::apps
