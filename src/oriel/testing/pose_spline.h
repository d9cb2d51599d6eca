// A uniform B-spline of degree 5 through poses (four times continuously differentiable), with its derivatives in closed
// form: what an IMU without errors measures along it is exact.
//
// Positions are an ordinary B-spline, p(t) = Σ B_j(u) p_j. Rotations are a cumulative one (Kim, Kim, Shin, "A general
// construction scheme for unit quaternion curves", SIGGRAPH 1995): with d_j = Log(R_{j-1}⁻¹ R_j), λ_j = Σ_{i≥j} B_i,
//   R = R_0 Π_j A_j,  A_j = Exp(λ_j d_j),  and from the left to the right (Sommer, Usenko, Schubert, Demmel, Cremers,
// "Efficient derivative computation for cumulative B-splines on Lie groups", CVPR 2020)
//   ω ← A_jᵀ ω + λ'_j d_j,   ω' ← A_jᵀ ω' + λ'_j (A_jᵀ ω) × d_j + λ''_j d_j    (A_jᵀ ω of the first, before it moves).
// The spline approximates its control poses and does not pass through them: it smooths what was measured.
#pragma once
#include <span>
#include <vector>

#include "oriel/base/result.h"
#include "oriel/window/trajectory.h"

namespace oriel {

// A pose and its derivatives by time.
struct PathState {
  Pose3d T_world_body;
  Vec3d v_world = Vec3d::zero();            // [m/s]
  Vec3d a_world = Vec3d::zero();            // [m/s²]
  Vec3d rate_body = Vec3d::zero();          // angular velocity in the body's frame [rad/s]
  Vec3d acceleration_body = Vec3d::zero();  // its derivative [rad/s²]
};

class PoseSpline {
 public:
  static constexpr int kDegree = 5;

  PoseSpline() = default;
  // Control poses every `spacing` seconds; at least six.
  PoseSpline(std::vector<Pose3d> control, double spacing) : control_(std::move(control)), spacing_(spacing) {}

  // Through poses with rising stamps, sampled at `spacing` by straight lines. Errors: stamps that do not rise, too few
  // poses or too short a time for one piece of the spline, a spacing that is not positive.
  static Result<PoseSpline> through(std::span<const StampedPose> poses, double spacing);

  // [s] from its own start, which is the third control pose's time.
  double duration() const {
    return control_.size() > kDegree ? spacing_ * static_cast<double>(control_.size() - kDegree) : 0.0;
  }
  // At t in [0, duration()]; outside of it the end is held, at rest.
  PathState at(double t) const;

 private:
  std::vector<Pose3d> control_;
  double spacing_ = 0.1;  // [s]
};

}  // namespace oriel
