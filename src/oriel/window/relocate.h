// Where a stereo frame is among points that are known, without a guess: for many triples of its points, placed in the
// body by the two cameras, the pose that lays them on the known ones; that with the least sum of squared errors in the
// image, each cut at some pixels (MSAC: Torr & Zisserman, "MLESAC", 2000, eq. 19), stands against most of them being
// wrong.
#pragma once
#include <optional>
#include <span>
#include <vector>

#include "oriel/window/refine_pose.h"

namespace oriel {

// The pose T with T b[k] = a[k] for k = 0; with the triangle's plane and its first side's direction alike. None where
// the three points lie on a line, or the triangles are of different size by more than `tolerance` (share of a side).
std::optional<Pose3d> lay_triangle(const Vec3d a[3], const Vec3d b[3], double tolerance);

// Memory that is kept between calls.
struct PoseWorkspace {
  struct Pair {
    Vec3d p_world, p_body;  // [m]
  };
  std::vector<double> errors;
  std::vector<Pair> pairs;
};

// None with fewer than `least_points` that both cameras see. The triples are the same for the same sightings.
std::optional<Pose3d> relocate(std::span<const PointSighting> sightings, const StereoRigd& rig, int least_points,
                               PoseWorkspace& work);

// refine_pose from the pose given; where too few points agree with what it finds, from where relocate says.
RefinePoseReport find_pose(std::span<const PointSighting> sightings, const StereoRigd& rig, int least_points,
                           Pose3d& T_world_body, PoseWorkspace& work);
// At least `least_points` and a third of those in view agree.
bool agrees(const RefinePoseReport& report, int least_points);

}  // namespace oriel
