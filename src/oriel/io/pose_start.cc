#include "oriel/io/pose_start.h"

#include "oriel/io/chain_odometry.h"
#include "oriel/solve/chordal.h"

namespace oriel {
namespace {

template <class Pose, class FilePose>
std::vector<Pose> poses_of(const std::vector<FilePose>& file_poses) {
  std::vector<Pose> poses;
  poses.reserve(file_poses.size());
  for (const FilePose& p : file_poses) poses.push_back(pose_of(p));
  return poses;
}

RelativePose<Pose2d> relative(const PoseGraphFile::PlanarEdge& e) {
  const auto& w = e.information;  // 11 12 13 22 23 33
  return {e.from, e.to, pose_of(e.measurement), w[5], {{w[0], w[1], w[1], w[3]}}};
}
RelativePose<Pose3d> relative(const PoseGraphFile::SpatialEdge& e) {
  const Mat6d w = information_matrix(e);
  RelativePose<Pose3d> out{e.from, e.to, pose_of(e.measurement), (w(3, 3) + w(4, 4) + w(5, 5)) / 3.0, {}};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) out.translation_information(i, j) = w(i, j);
  return out;
}

template <class Pose, class Edge, class FilePose>
Result<std::vector<Pose>> chordal(const PoseGraphFile& file, const std::vector<Edge>& edges,
                                  const std::vector<FilePose>& values) {
  std::vector<RelativePose<Pose>> relatives;
  relatives.reserve(edges.size());
  for (const Edge& e : edges) relatives.push_back(relative(e));
  std::vector<KnownPose<Pose>> known;
  if (!values.empty())
    for (const std::int32_t i : file.fixed) known.push_back({i, pose_of(values[static_cast<std::size_t>(i)])});
  if (known.empty() && !values.empty()) known.push_back({0, pose_of(values[0])});  // it will be held
  auto poses = chordal_start(file.ids.size(), relatives, known);
  if (poses) return poses;
  Error error = poses.error();
  error.file = file.file_name;
  return error;
}

}  // namespace

Pose2d pose_of(const Vec3d& p) { return {Rot2d::exp(p[2]), {{p[0], p[1]}}}; }
Pose3d pose_of(const PoseGraphFile::SpatialPose& p) { return {Rot3d{p.qx, p.qy, p.qz, p.qw}, p.t}; }

Result<std::vector<Pose2d>> start_poses2(const PoseGraphFile& file, PoseStart start) {
  if (start == PoseStart::file && file.has_vertices) return poses_of<Pose2d>(file.planar_poses);
  if (start == PoseStart::chordal) return chordal<Pose2d>(file, file.planar_edges, file.planar_poses);
  return chain_odometry2(file, start == PoseStart::spanning_tree);
}

Result<std::vector<Pose3d>> start_poses3(const PoseGraphFile& file, PoseStart start) {
  if (start == PoseStart::file && file.has_vertices) return poses_of<Pose3d>(file.spatial_poses);
  if (start == PoseStart::chordal) return chordal<Pose3d>(file, file.spatial_edges, file.spatial_poses);
  return chain_odometry3(file, start == PoseStart::spanning_tree);
}

}  // namespace oriel
