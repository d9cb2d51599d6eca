#include "oriel/io/problem.h"

#include "oriel/io/landmarks.h"
#include "oriel/residual/bal.h"
#include "oriel/residual/pose_graph.h"

namespace oriel {
namespace {

Result<void> apply(Graph& graph, GraphEdit& edit, const std::string& file) {
  auto ok = graph.apply(edit);
  if (ok) return {};
  Error e = ok.error();
  e.file = file;
  return e;
}

// FIX lines, else the first pose.
template <class Ids>
void hold(GraphEdit& edit, const PoseGraphFile& file, const Ids& ids) {
  for (const std::int32_t i : file.fixed) edit.fix(ids[i]);
  if (file.fixed.empty() && file.fixed_landmarks.empty() && !ids.empty()) edit.fix(ids[0]);
}

}  // namespace

Result<PoseGraph2> add_pose_graph2(Graph& graph, const PoseGraphFile& file, const PoseGraphOptions& options) {
  const Result<std::vector<Pose2d>> start = start_poses2(file, options.start);
  if (!start) return start.error();
  return add_pose_graph2(graph, file, options, *start);
}

Result<PoseGraph3> add_pose_graph3(Graph& graph, const PoseGraphFile& file, const PoseGraphOptions& options) {
  const Result<std::vector<Pose3d>> start = start_poses3(file, options.start);
  if (!start) return start.error();
  return add_pose_graph3(graph, file, options, *start);
}

Result<PoseGraph2> add_pose_graph2(Graph& graph, const PoseGraphFile& file, const PoseGraphOptions& options,
                                   const std::vector<Pose2d>& start) {
  GraphEdit edit = graph.edit();
  PoseGraph2 ids;
  const bool from_file = file.has_vertices && options.start == PoseStart::file;
  ids.poses.reserve(file.ids.size());
  for (const Pose2d& pose : start) ids.poses.push_back(edit.add(pose));
  for (const auto& e : file.planar_edges)
    edit.add(PoseGraphEdge2d{pose_of(e.measurement)}, Information(information_matrix(e)),
             options.loss_of(file.ids[e.from], file.ids[e.to]), ids.poses[e.from], ids.poses[e.to]);
  hold(edit, file, ids.poses);
  ids.landmarks =
      add_landmarks2(edit, file, ids.poses, start_landmarks2(file, from_file, start), options.loss_of_sightings());
  if (auto ok = apply(graph, edit, file.file_name); !ok) return ok.error();
  return ids;
}

Result<PoseGraph3> add_pose_graph3(Graph& graph, const PoseGraphFile& file, const PoseGraphOptions& options,
                                   const std::vector<Pose3d>& start) {
  GraphEdit edit = graph.edit();
  PoseGraph3 ids;
  const bool from_file = file.has_vertices && options.start == PoseStart::file;
  ids.poses.reserve(file.ids.size());
  for (const Pose3d& pose : start) ids.poses.push_back(edit.add(pose));
  for (const auto& e : file.spatial_edges) {
    const auto noise = Information(information_matrix(e));
    const Pose3d measured = pose_of(e.measurement);
    const Loss& loss = options.loss_of(file.ids[e.from], file.ids[e.to]);
    if (options.rotation_error == RotationError::quaternion)
      edit.add(PoseGraphEdge3d{measured}, noise, loss, ids.poses[e.from], ids.poses[e.to]);
    else
      edit.add(PoseGraphEdgeLog3d{measured}, noise, loss, ids.poses[e.from], ids.poses[e.to]);
  }
  hold(edit, file, ids.poses);
  ids.landmarks =
      add_landmarks3(edit, file, ids.poses, start_landmarks3(file, from_file, start), options.loss_of_sightings());
  if (auto ok = apply(graph, edit, file.file_name); !ok) return ok.error();
  return ids;
}

Result<BundleAdjustment> add_bundle_adjustment(Graph& graph, const BalFile& file, const Loss& loss) {
  GraphEdit edit = graph.edit();
  BundleAdjustment ids;
  for (const auto& c : file.cameras) {
    Vec<double, 9> v;
    for (int k = 0; k < 9; ++k) v[k] = c[k];
    ids.cameras.push_back(edit.add(BalCamerad::from_file(v)));
  }
  for (const Vec3d& p : file.points) ids.points.push_back(edit.add(Point3d{p}));
  for (const auto& o : file.observations)
    edit.add(BalReprojectiond{{{o.u, o.v}}}, Sigma(1.0), loss, ids.cameras[o.camera], ids.points[o.point]);
  if (auto ok = apply(graph, edit, file.file_name); !ok) return ok.error();
  return ids;
}

void copy_values(const Graph& graph, const PoseGraph2& ids, PoseGraphFile& file) {
  file.planar_poses.resize(ids.poses.size());
  for (std::size_t i = 0; i < ids.poses.size(); ++i) {
    const Pose2d& p = graph.value(ids.poses[i]);
    file.planar_poses[i] = {{p.t[0], p.t[1], p.R.log()}};
  }
  file.planar_landmarks.resize(ids.landmarks.size());
  for (std::size_t l = 0; l < ids.landmarks.size(); ++l) file.planar_landmarks[l] = graph.value(ids.landmarks[l]).p;
  file.has_vertices = true;
}

void copy_values(const Graph& graph, const PoseGraph3& ids, PoseGraphFile& file) {
  file.spatial_poses.resize(ids.poses.size());
  for (std::size_t i = 0; i < ids.poses.size(); ++i) {
    const Pose3d& p = graph.value(ids.poses[i]);
    file.spatial_poses[i] = {p.t, p.R.qx, p.R.qy, p.R.qz, p.R.qw};
  }
  file.spatial_landmarks.resize(ids.landmarks.size());
  for (std::size_t l = 0; l < ids.landmarks.size(); ++l) file.spatial_landmarks[l] = graph.value(ids.landmarks[l]).p;
  file.has_vertices = true;
}

void copy_values(const Graph& graph, const BundleAdjustment& ids, BalFile& file) {
  for (std::size_t i = 0; i < ids.cameras.size(); ++i) {
    const Vec<double, 9> c = graph.value(ids.cameras[i]).to_file();
    for (int k = 0; k < 9; ++k) file.cameras[i][k] = c[k];
  }
  for (std::size_t i = 0; i < ids.points.size(); ++i) file.points[i] = graph.value(ids.points[i]).p;
}

}  // namespace oriel
