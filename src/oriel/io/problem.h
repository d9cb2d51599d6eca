// From a file of a batch problem to a graph, and back: what `oriel solve`, the benchmarks and the tests share.
#pragma once
#include <string>
#include <vector>

#include "oriel/graph/graph.h"
#include "oriel/io/bal.h"
#include "oriel/io/g2o.h"
#include "oriel/manifold/bal_camera.h"
#include "oriel/manifold/se2.h"
#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"

namespace oriel {

enum class RotationError { quaternion, log };  // of 3D edges: g2o's own (its information refers to it), or Log
enum class PoseStart { file, odometry };       // where poses begin: VERTEX lines, or edges chained from the first pose

struct PoseGraphOptions {
  RotationError rotation_error = RotationError::quaternion;
  PoseStart start = PoseStart::file;  // a file without VERTEX lines starts from its edges all the same
  Loss loss;                          // of every edge
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
Result<BundleAdjustment> add_bundle_adjustment(Graph& graph, const BalFile& file, const Loss& loss);

// Values of the graph into the file's structure, for writing.
void copy_values(const Graph& graph, const PoseGraph2& ids, PoseGraphFile& file);
void copy_values(const Graph& graph, const PoseGraph3& ids, PoseGraphFile& file);
void copy_values(const Graph& graph, const BundleAdjustment& ids, BalFile& file);

}  // namespace oriel
