// Where the poses of a pose graph begin.
#pragma once
#include <vector>

#include "oriel/base/result.h"
#include "oriel/io/g2o.h"
#include "oriel/manifold/se2.h"
#include "oriel/manifold/se3.h"

namespace oriel {

enum class PoseStart {
  file,           // its VERTEX lines
  odometry,       // edges chained from the first pose, consecutive ones before all others (io/chain_odometry.h)
  spanning_tree,  // edges chained along the fewest of them from the first pose
  chordal,        // rotations first, then places, by linear least squares (solve/chordal.h)
};

Pose2d pose_of(const Vec3d& file_pose);  // [x m, y m, theta rad]
Pose3d pose_of(const PoseGraphFile::SpatialPose& file_pose);

// Poses that FIX holds keep the file's value, whatever the start. Without VERTEX lines `file` is odometry. An Error
// only of chordal, where its linear problem has no solution.
Result<std::vector<Pose2d>> start_poses2(const PoseGraphFile& file, PoseStart start);
Result<std::vector<Pose3d>> start_poses3(const PoseGraphFile& file, PoseStart start);

}  // namespace oriel
