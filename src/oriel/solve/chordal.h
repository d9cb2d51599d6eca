// A start for pose graphs that does not depend on a guess: rotations first, then places, each a linear problem.
//   min Σ κ ‖R_j - R_i R_ij‖²_F over all 3×3 (2×2) matrices, each projected to the nearest rotation; then
//   min Σ ‖t_j - t_i - R_i t_ij‖²_Ω over the places.
// D. Martinec, T. Pajdla, Robust Rotation and Translation Estimation in Multiview Reconstruction, CVPR 2007, section 3;
// L. Carlone, R. Tron, K. Daniilidis, F. Dellaert, Initialization Techniques for 3D SLAM, ICRA 2015, section III-B.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "oriel/base/result.h"
#include "oriel/manifold/se2.h"
#include "oriel/manifold/se3.h"

namespace oriel {

// What was measured of the pose `to` as seen from the pose `from`; poses are named by their place.
template <class Pose>
struct RelativePose {
  std::int32_t from = 0, to = 0;
  Pose motion;                                                                            // T_from_to
  double rotation_weight = 1.0;                                                           // κ [1/rad²], ≥ 0
  Mat<double, Pose::kDim == 3 ? 2 : 3, Pose::kDim == 3 ? 2 : 3> translation_information;  // Ω [1/m²], in `from`
};

// Poses that are known; each piece of the graph without any begins at its first pose, at the identity. An edge whose
// κ is 0 holds no piece together.
template <class Pose>
struct KnownPose {
  std::int32_t pose = 0;
  Pose value;
};

// An error names what is wrong with an edge (an end that does not exist), or says that the linear problem has no
// solution (information that leaves a place undetermined).
Result<std::vector<Pose2d>> chordal_start(std::size_t poses, std::span<const RelativePose<Pose2d>> edges,
                                          std::span<const KnownPose<Pose2d>> known = {});
Result<std::vector<Pose3d>> chordal_start(std::size_t poses, std::span<const RelativePose<Pose3d>> edges,
                                          std::span<const KnownPose<Pose3d>> known = {});

}  // namespace oriel
