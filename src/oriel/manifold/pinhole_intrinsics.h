// What is inside a pinhole camera with radial distortion, as a variable: to be estimated, one for each image or one
// that many share. The tangent is added to it.
#pragma once
#include "oriel/manifold/manifold.h"

namespace oriel {

// The camera looks along z, x is right and y is down; model and meaning as in RadTanCamera (sensor/camera.h).
template <class S>
struct PinholeIntrinsics {
  static constexpr std::string_view kName = "pinhole_intrinsics/1";
  static constexpr int kDim = 6;
  static constexpr std::array<std::string_view, 6> kTangentNames = {"focal length x [px]", "focal length y [px]",
                                                                    "centre x [px]",       "centre y [px]",
                                                                    "distortion k1 [-]",   "distortion k2 [-]"};
  template <class T>
  using rebind = PinholeIntrinsics<T>;

  S fx = S(1.0), fy = S(1.0), cx = S(0.0), cy = S(0.0);  // [px]
  S k1 = S(0.0), k2 = S(0.0);                            // radial distortion [-]

  PinholeIntrinsics plus(const Vec<S, 6>& d) const {
    return {fx + d[0], fy + d[1], cx + d[2], cy + d[3], k1 + d[4], k2 + d[5]};
  }
  Vec<S, 6> minus(const PinholeIntrinsics& x) const {
    return {{fx - x.fx, fy - x.fy, cx - x.cx, cy - x.cy, k1 - x.k1, k2 - x.k2}};
  }
};
using PinholeIntrinsicsd = PinholeIntrinsics<double>;

template <class S>
Mat<S, 6, 6> analytic_minus_jacobian(const PinholeIntrinsics<S>&, const PinholeIntrinsics<S>&, const Vec<S, 6>&) {
  return Mat<S, 6, 6>::identity();
}

}  // namespace oriel
