// The pose of one frame against points that are known: Gauss–Newton with Cauchy weights whose scale follows the spread
// of the residuals down, so that a start some dozens of pixels off and gross errors do no harm.
#pragma once
#include <span>
#include <vector>

#include "oriel/manifold/se3.h"
#include "oriel/sensor/stereo_rig.h"

namespace oriel {

struct PointSighting {
  Vec3d p_world;         // [m]
  Vec2d pixel0, pixel1;  // [px]
  bool has_right = false;
};

struct RefinePoseOptions {
  int max_iterations = 12;
  double least_scale = 1.5;    // the Cauchy scale where the spread of residuals ends [px]
  double inlier_pixels = 5.0;  // per camera [px]
};

struct RefinePoseReport {
  int valid = 0, inliers = 0;
  double median_before = 0.0, median_after = 0.0;  // of the errors' lengths [px]
  bool solved = false;                             // the last system had full rank
};

// T_world_body is moved only if the report says solved and the median fell.
RefinePoseReport refine_pose(std::span<const PointSighting> sightings, const StereoRigd& rig,
                             const RefinePoseOptions& options, Pose3d& T_world_body, std::vector<double>& scratch);

// Length of the error in the worse camera [px]; infinite where the point is not in view.
double error_at(const PointSighting& sighting, const StereoRigd& rig, const Pose3d& T_world_body);

// Median of the errors' lengths at a pose [px]; how many were valid.
double median_error(std::span<const PointSighting> sightings, const StereoRigd& rig, const Pose3d& T_world_body,
                    std::vector<double>& scratch);

}  // namespace oriel
