// Which rigid motion (or similarity) brings an estimated trajectory closest to the true one.
//
// Umeyama, "Least-squares estimation of transformation parameters between two point patterns", PAMI 1991, eq. 34–43:
// min over s, R, t of Σ ‖g_i − (s·R·e_i + t)‖².
#pragma once
#include <span>
#include <string_view>

#include "oriel/base/matrix.h"
#include "oriel/base/result.h"

namespace oriel {

enum class Alignment {
  none,  // as they are
  yaw,   // position and rotation about world z: what a visual-inertial estimator cannot observe
  se3,   // position and rotation
  sim3,  // and scale: what one camera alone cannot observe
};

Result<Alignment> parse_alignment(std::string_view name);
std::string_view name_of(Alignment alignment);

struct Similarity {
  double scale = 1;
  Mat3d R = Mat3d::identity();
  Vec3d t = Vec3d::zero();  // [m]
  Vec3d operator()(const Vec3d& p) const { return scale * (R * p) + t; }
};

// `estimate` and `truth` are pairs. No pair is an error; so is a scale where all estimates are one point. Where the
// points lie on a line the rotation about it is not determined, and is one of the minimisers.
Result<Similarity> align(std::span<const Vec3d> estimate, std::span<const Vec3d> truth, Alignment alignment);

}  // namespace oriel
