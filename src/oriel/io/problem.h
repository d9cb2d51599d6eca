// From a file of a batch problem to a graph, and back: what `oriel solve`, the benchmarks and the tests share.
#pragma once
#include <string>
#include <vector>

#include "oriel/graph/graph.h"
#include "oriel/io/bal.h"
#include "oriel/io/g2o.h"
#include "oriel/io/pose_start.h"
#include "oriel/manifold/bal_camera.h"
#include "oriel/manifold/se2.h"
#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"

namespace oriel {

enum class RotationError { quaternion, log };  // of 3D edges: g2o's own (its information refers to it), or Log

struct PoseGraphOptions {
  RotationError rotation_error = RotationError::quaternion;
  PoseStart start = PoseStart::file;  // a file without VERTEX lines starts from its edges all the same
  Loss loss;
  // The loss is for loop closures alone: edges of poses whose ids in the file are not neighbours.
  bool loss_on_loops = false;

  const Loss& loss_of(std::int64_t from_id, std::int64_t to_id) const {
    static constexpr Loss kNone;
    return loss_on_loops && (from_id - to_id == 1 || to_id - from_id == 1) ? kNone : loss;
  }
  // Sightings of landmarks close no loop between poses.
  const Loss& loss_of_sightings() const {
    static constexpr Loss kNone;
    return loss_on_loops ? kNone : loss;
  }
};

// Ids by the file's own order, so that values find their way back.
struct PoseGraph2 {
  std::vector<VariableId<Pose2d>> poses;
  std::vector<VariableId<Point2d>> landmarks;
};
struct PoseGraph3 {
  std::vector<VariableId<Pose3d>> poses;
  std::vector<VariableId<Point3d>> landmarks;
};
struct BundleAdjustment {
  std::vector<VariableId<BalCamerad>> cameras;
  std::vector<VariableId<Point3d>> points;
};

// Adds a file's poses, landmarks and edges to the graph, in one edit. No FIX: the first pose is held (that is the
// gauge).
// An error names file and line of the item that the graph refused.
Result<PoseGraph2> add_pose_graph2(Graph& graph, const PoseGraphFile& file, const PoseGraphOptions& options);
Result<PoseGraph3> add_pose_graph3(Graph& graph, const PoseGraphFile& file, const PoseGraphOptions& options);
// The same from poses that were found already (start_poses2 and 3 of options.start).
Result<PoseGraph2> add_pose_graph2(Graph& graph, const PoseGraphFile& file, const PoseGraphOptions& options,
                                   const std::vector<Pose2d>& start);
Result<PoseGraph3> add_pose_graph3(Graph& graph, const PoseGraphFile& file, const PoseGraphOptions& options,
                                   const std::vector<Pose3d>& start);
Result<BundleAdjustment> add_bundle_adjustment(Graph& graph, const BalFile& file, const Loss& loss);

// Values of the graph into the file's structure, for writing.
void copy_values(const Graph& graph, const PoseGraph2& ids, PoseGraphFile& file);
void copy_values(const Graph& graph, const PoseGraph3& ids, PoseGraphFile& file);
void copy_values(const Graph& graph, const BundleAdjustment& ids, BalFile& file);

}  // namespace oriel
