// A start for the poses of a file: edges chained from the poses that are held, or else the first one, consecutive ones
// (i, i + 1) before all others.
#pragma once
#include <vector>

#include "oriel/io/g2o.h"
#include "oriel/manifold/se2.h"
#include "oriel/manifold/se3.h"

namespace oriel {

// Poses that FIX holds keep the file's value (without VERTEX lines there is none to keep). Pieces of the graph that
// they do not reach begin at their first pose, at the file's value or identity.
// With `shortest` every pose is reached by as few edges as can be, whichever they are: a spanning tree.
std::vector<Pose2d> chain_odometry2(const PoseGraphFile& file, bool shortest = false);
std::vector<Pose3d> chain_odometry3(const PoseGraphFile& file, bool shortest = false);

}  // namespace oriel
