#include "apps/pose_graph_start.h"

#include <cmath>
#include <optional>
#include <utility>

#include "oriel/io/information.h"
#include "oriel/io/landmarks.h"
#include "oriel/residual/loss.h"
#include "oriel/residual/pose_graph.h"

namespace oriel::apps {
namespace {

template <class Residual, class Pose, class Edge>
double cost_of(const PoseGraphFile& file, const std::vector<Edge>& edges, const std::vector<Pose>& poses,
               const PoseGraphOptions& options) {
  double sum = 0.0;
  for (const Edge& e : edges) {
    Vec<double, Residual::kDim> r;
    Residual{pose_of(e.measurement)}.evaluate(poses[e.from], poses[e.to], r, nullptr, nullptr);
    sum += evaluate_loss(options.loss_of(file.ids[e.from], file.ids[e.to]), squared_norm(r, information_matrix(e))).rho;
  }
  return 0.5 * sum;
}

}  // namespace

Result<PoseGraphStart> find_start(const PoseGraphFile& file, const PoseGraphOptions& options, PoseStart kind) {
  PoseGraphStart start{kind, 0.0, {}, {}};
  const bool from_file = kind == PoseStart::file && file.has_vertices;
  if (!file.is_3d) {
    auto poses = start_poses2(file, kind);
    if (!poses) return poses.error();
    start.planar = std::move(*poses);
    start.cost = cost_of<PoseGraphEdge2d>(file, file.planar_edges, start.planar, options) +
                 landmark_cost2(file, start.planar, start_landmarks2(file, from_file, start.planar),
                                options.loss_of_sightings());
    return start;
  }
  auto poses = start_poses3(file, kind);
  if (!poses) return poses.error();
  start.spatial = std::move(*poses);
  start.cost = landmark_cost3(file, start.spatial, start_landmarks3(file, from_file, start.spatial),
                              options.loss_of_sightings()) +
               (options.rotation_error == RotationError::quaternion
                    ? cost_of<PoseGraphEdge3d>(file, file.spatial_edges, start.spatial, options)
                    : cost_of<PoseGraphEdgeLog3d>(file, file.spatial_edges, start.spatial, options));
  return start;
}

Result<PoseGraphStart> choose_start(const PoseGraphFile& file, const PoseGraphOptions& options, StartChoice choice) {
  switch (choice) {
    case StartChoice::file:
      return find_start(file, options, file.has_vertices ? PoseStart::file : PoseStart::odometry);
    case StartChoice::odometry:
      return find_start(file, options, PoseStart::odometry);
    case StartChoice::spanning_tree:
      return find_start(file, options, PoseStart::spanning_tree);
    case StartChoice::chordal:
      return find_start(file, options, PoseStart::chordal);
    case StartChoice::automatic:
      break;
  }
  std::optional<PoseGraphStart> best;
  for (const PoseStart kind : {PoseStart::file, PoseStart::odometry, PoseStart::spanning_tree, PoseStart::chordal}) {
    if (kind == PoseStart::file && !file.has_vertices) continue;
    Result<PoseGraphStart> start = find_start(file, options, kind);
    // Rounding decides where two are one start: the first one, then.
    if (start && (!best || start->cost < best->cost * (1.0 - 1e-9) || !std::isfinite(best->cost)))
      best = std::move(*start);
  }
  return std::move(*best);  // odometry never fails
}

const char* name_of(PoseStart start) {
  constexpr const char* kNames[] = {"file", "odometry", "tree", "chordal"};
  return kNames[static_cast<int>(start)];
}

StartChoice start_choice(const std::string& word) {
  constexpr std::pair<StartChoice, PoseStart> kChoices[] = {{StartChoice::file, PoseStart::file},
                                                            {StartChoice::odometry, PoseStart::odometry},
                                                            {StartChoice::spanning_tree, PoseStart::spanning_tree},
                                                            {StartChoice::chordal, PoseStart::chordal}};
  for (const auto& [choice, start] : kChoices)
    if (word == name_of(start)) return choice;
  return StartChoice::automatic;
}

}  // namespace oriel::apps
