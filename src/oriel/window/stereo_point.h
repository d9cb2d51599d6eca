// Points from one pair of pixels, with their covariance by propagation of the pixels' through the projection.
//
// The point is the least-squares one: p minimizes rᵀ W r with r the four reprojection errors, W = Σ_px⁻¹, from where
// the two rays meet best; its covariance is that of the linear estimate at p,
//   Σ_p = (Jᵀ W J)⁻¹,  J = ∂r/∂p (4 × 3)
// (R. Hartley, A. Zisserman, "Multiple View Geometry", 2004, section 5.2.3; for stereo L. Matthies, S. Shafer, "Error
// modeling in stereo navigation", IEEE J. Robotics and Automation, 1987). For a rectified pair its depth part is
// σ_z = z² / (f b) · σ_d. First order: it says little once σ_z is a good part of z, so such points are not made.
#pragma once
#include <optional>

#include "oriel/sensor/stereo_rig.h"

namespace oriel {

struct StereoSighting {
  Vec2d pixel0, pixel1;            // [px] raw, left and right
  Mat2d covariance0, covariance1;  // [px²]
};

struct StereoPoint {
  Vec3d p_camera;    // [m], in the left camera's coordinates
  Mat3d covariance;  // [m²]
};

struct StereoPointOptions {
  double greatest_depth_share = 0.5;  // σ of the depth over the depth
  double greatest_error = 4.0;        // of rᵀ W r, which has one degree of freedom, in sigmas: epipolar lines missed
};

// None where a pixel has no ray, the rays meet behind a camera or nowhere, or an option says so.
std::optional<StereoPoint> stereo_point(const StereoRigd& rig, const StereoSighting& seen,
                                        const StereoPointOptions& options = {});

// Body coordinates of what is known in the left camera's: R Σ Rᵀ.
Vec3d in_body(const StereoRigd& rig, const Vec3d& p_camera);
Mat3d in_body(const StereoRigd& rig, const Mat3d& covariance);

// One more sighting of a point: the update of an extended Kalman filter in information form,
//   Λ⁺ = Σ⁻¹ + Mᵀ V⁻¹ M,  p⁺ = p - (Λ⁺)⁻¹ Mᵀ V⁻¹ r
// of D measured pixels with r their error, M = ∂r/∂p and V its covariance, what is not known of the pose included.
// False where a matrix is singular; then nothing changes.
template <int D>
bool fuse_sighting(const Vec<double, D>& r, const Mat<double, D, 3>& M, const Mat<double, D, D>& V, Vec3d& p,
                   Mat3d& covariance);
extern template bool fuse_sighting<2>(const Vec2d&, const Mat<double, 2, 3>&, const Mat2d&, Vec3d&, Mat3d&);
extern template bool fuse_sighting<4>(const Vec4d&, const Mat<double, 4, 3>&, const Mat<double, 4, 4>&, Vec3d&, Mat3d&);

}  // namespace oriel
