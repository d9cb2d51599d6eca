#include "oriel/io/chain_odometry.h"

#include <cstdlib>

namespace oriel {
namespace {

Pose3d pose_of(const PoseGraphFile::SpatialPose& p) { return {Rot3d{p.qx, p.qy, p.qz, p.qw}, p.t}; }
Pose2d pose_of(const Vec3d& p) { return {Rot2d::exp(p[2]), {{p[0], p[1]}}}; }

// Edges of each pose, those to its neighbours in the file first: they are odometry where the file has any.
template <class Edge>
class Links {
 public:
  Links(std::size_t poses, const std::vector<Edge>& edges) : begin_(poses + 1, 0) {
    for (const Edge& e : edges) ++begin_[e.from + 1], ++begin_[e.to + 1];
    for (std::size_t i = 0; i < poses; ++i) begin_[i + 1] += begin_[i];
    edges_.resize(2 * edges.size());
    std::vector<std::size_t> at(begin_.begin(), begin_.end() - 1);
    for (const bool consecutive : {true, false})
      for (std::size_t k = 0; k < edges.size(); ++k)
        if ((std::abs(edges[k].from - edges[k].to) == 1) == consecutive)
          edges_[at[edges[k].from]++] = k, edges_[at[edges[k].to]++] = k;
  }
  template <class F>
  void for_each(std::size_t pose, F&& f) const {
    for (std::size_t i = begin_[pose]; i < begin_[pose + 1]; ++i) f(edges_[i]);
  }

 private:
  std::vector<std::size_t> begin_, edges_;
};

template <class Pose, class Edge>
std::vector<Pose> chain(std::size_t count, const std::vector<Edge>& edges, const std::vector<Pose>& roots) {
  std::vector<Pose> poses(count);
  std::vector<char> known(count, 0);
  const Links<Edge> links(count, edges);
  std::vector<std::size_t> ahead, loops;  // consecutive edges are followed to their end before any other is taken
  for (std::size_t root = 0; root < count; ++root) {
    if (known[root]) continue;
    if (!roots.empty()) poses[root] = roots[root];
    known[root] = 1;
    ahead.assign(1, root);
    loops.assign(1, root);
    std::size_t next_loop = 0;
    while (!ahead.empty() || next_loop < loops.size()) {
      const bool consecutive = !ahead.empty();
      const std::size_t at = consecutive ? ahead.back() : loops[next_loop++];
      if (consecutive) ahead.pop_back();
      links.for_each(at, [&](std::size_t k) {
        const Edge& e = edges[k];
        if (consecutive && std::abs(e.from - e.to) != 1) return;
        const bool forward = static_cast<std::size_t>(e.from) == at;
        const std::size_t other = static_cast<std::size_t>(forward ? e.to : e.from);
        if (known[other]) return;
        const Pose step = pose_of(e.measurement);
        poses[other] = poses[at] * (forward ? step : step.inverse());
        known[other] = 1;
        ahead.push_back(other);
        loops.push_back(other);
      });
    }
  }
  return poses;
}

}  // namespace

std::vector<Pose2d> chain_odometry2(const PoseGraphFile& file) {
  std::vector<Pose2d> roots;
  for (const Vec3d& p : file.planar_poses) roots.push_back(pose_of(p));
  return chain(file.ids.size(), file.planar_edges, roots);
}

std::vector<Pose3d> chain_odometry3(const PoseGraphFile& file) {
  std::vector<Pose3d> roots;
  for (const auto& p : file.spatial_poses) roots.push_back(pose_of(p));
  return chain(file.ids.size(), file.spatial_edges, roots);
}

}  // namespace oriel
