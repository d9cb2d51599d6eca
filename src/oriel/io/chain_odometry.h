// A start for the poses of a file: edges chained from the first pose, consecutive ones (i, i + 1) before all others.
#pragma once
#include <vector>

#include "oriel/io/g2o.h"
#include "oriel/manifold/se2.h"
#include "oriel/manifold/se3.h"

namespace oriel {

// Breadth first from the first pose of every piece of the graph; its value is the file's, or identity.
std::vector<Pose2d> chain_odometry2(const PoseGraphFile& file);
std::vector<Pose3d> chain_odometry3(const PoseGraphFile& file);

}  // namespace oriel
