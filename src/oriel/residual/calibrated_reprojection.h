// Reprojection of a point into a camera whose intrinsics are estimated with it: rows that name the same intrinsics
// share them, rows of images with a camera each have them free, and known ones are fixed by the edit.
//   h = R_world_cameraᵀ (p_world_point - t),  x = h_x/h_z, y = h_y/h_z, s = x² + y², d = 1 + k1 s + k2 s²
//   r = [fx d x + cx, fy d y + cy] - pixel [px] (2 × 1)      (Brown, "Close-range camera calibration", 1971, radial
//   part)
// With l = 2 k1 + 4 k2 s: ∂(d x, d y)/∂(x, y) = [d + l x², l x y; l x y, d + l y²], and from K = ∂r/∂h
//   J_pose = [K hat(h), -K],  J_point = K Rᵀ,  J_k1 = s f·(x, y),  J_k2 = s² f·(x, y).
// Not valid nearer to the camera's plane than kLeastDepth, nor where the radial polynomial falls (sensor/camera.h).
#pragma once
#include "oriel/manifold/pinhole_intrinsics.h"
#include "oriel/residual/reprojection.h"

namespace oriel {

template <class S>
struct CalibratedReprojection {
  static constexpr std::string_view kName = "calibrated_reprojection/1";
  static constexpr int kDim = 2;
  using Variables = Types<Pose3d, Point3d, PinholeIntrinsicsd>;  // T_world_camera, p_world_point
  template <class T>
  using rebind = CalibratedReprojection<T>;

  Vec<S, 2> pixel;  // [px]

  Valid<S> evaluate(const Pose3<S>& pose, const Point3<S>& point, const PinholeIntrinsics<S>& c, Vec<S, 2>& r,
                    Mat<S, 2, 6>* J_pose, Mat<S, 2, 3>* J_point, Mat<S, 2, 6>* J_intrinsics) const {
    const Mat<S, 3, 3> R = pose.R.inverse().matrix();
    const Vec<S, 3> h = R * (point.p - pose.t);
    const auto ahead = h[2] > S(kLeastDepth);
    const S one(1.0), o(0.0), inverse = one / select(ahead, h[2], one);
    const S x = h[0] * inverse, y = h[1] * inverse, s = x * x + y * y;
    const S d = one + s * (c.k1 + s * c.k2), slope = S(2.0) * c.k1 + S(4.0) * c.k2 * s;
    r = {{c.fx * d * x + c.cx - pixel[0], c.fy * d * y + c.cy - pixel[1]}};
    if (J_pose != nullptr) {
      const S a = d + slope * x * x, b = slope * x * y, e = d + slope * y * y, m = inverse * c.fx, n = inverse * c.fy;
      const Mat<S, 2, 3> K = {{m * a, n * b, m * b, n * e, -m * (a * x + b * y), -n * (b * x + e * y)}};
      J_pose->set_block(0, 0, times_hat(K, h));
      J_pose->set_block(0, 3, -K);
      *J_point = K * R;
      const S u = s * c.fx * x, v = s * c.fy * y;
      *J_intrinsics = {{d * x, o, o, d * y, one, o, o, one, u, v, u * s, v * s}};
    }
    return ahead & (d + slope * s > o);
  }
};
using CalibratedReprojectiond = CalibratedReprojection<double>;

// Compiled once, in the library.
extern template void linearize_rows<CalibratedReprojectiond, IsotropicNoise>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
