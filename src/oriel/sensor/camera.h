// Cameras: from a point in the camera's frame (z forward, x right, y down) to a pixel, and back to a ray.
#pragma once
#include <concepts>
#include <string>
#include <type_traits>

#include "oriel/base/pack.h"
#include "oriel/base/result.h"
#include "oriel/manifold/manifold.h"

namespace oriel {

// What a comparison of two scalars gives: bool for one, a mask for eight.
template <class S>
using MaskOf = decltype(S(0.0) < S(0.0));

// A user's camera is a struct template over its scalar, all members scalars, with kName, kDim = 0, rebind and
//   MaskOf<S> project(const Vec<S, 3>& h, Vec<S, 2>& pixel, Mat<S, 2, 3>* J_pixel_h) const;
// pixel [px] of the direction h (its length does not matter: landmarks are handed over scaled by their inverse depth),
// ∂pixel/∂h unless it is null, and where the model holds. What comes out where it does not hold is finite or not, but
// never used. And
//   Result<Vec2d> unproject(const Vec2d& pixel) const;    // for double: [x/z, y/z] of the ray
template <class C>
concept Camera = Constant<C> && Rebindable<C> && requires(const C c, const Vec3d h, Vec2d pixel, Mat<double, 2, 3>* J) {
  { c.project(h, pixel, J) } -> std::same_as<bool>;
  { c.unproject(pixel) } -> std::same_as<Result<Vec2d>>;
};

// Pinhole with radial-tangential distortion (OpenCV's and EuRoC's model; Brown, "Close-range camera calibration",
// 1971): with x = X/Z, y = Y/Z, s = x² + y², d = 1 + k1 s + k2 s²,
//   u = fx (d x + 2 p1 x y + p2 (s + 2 x²)) + cx,   v = fy (d y + p1 (s + 2 y²) + 2 p2 x y) + cy.
// It holds for Z > 0 as far out as the radial polynomial grows: 1 + 3 k1 s + 5 k2 s² > 0. Beyond, rays fold back onto
// pixels that belong to others.
template <class S>
struct RadTanCamera {
  static constexpr std::string_view kName = "radtan_camera/1";
  static constexpr int kDim = 0;
  template <class T>
  using rebind = RadTanCamera<T>;

  S fx = S(1.0), fy = S(1.0), cx = S(0.0), cy = S(0.0);  // [px]
  S k1 = S(0.0), k2 = S(0.0), p1 = S(0.0), p2 = S(0.0);  // distortion [-]

  MaskOf<S> project(const Vec<S, 3>& h, Vec<S, 2>& pixel, Mat<S, 2, 3>* J) const {
    const auto ahead = h[2] > S(0.0);
    const S inverse = S(1.0) / select(ahead, h[2], S(1.0));
    const S x = h[0] * inverse, y = h[1] * inverse;
    Vec<S, 2> distorted;
    S a, b, c;
    const S growth = distort(x, y, distorted, a, b, c);
    pixel = {{fx * distorted[0] + cx, fy * distorted[1] + cy}};
    if (J != nullptr) {
      const S m = inverse * fx, n = inverse * fy;
      *J = {{m * a, n * b, m * b, n * c, -m * (a * x + b * y), -n * (b * x + c * y)}};
    }
    return ahead & (growth > S(0.0));
  }

  // Inverts the distortion by Newton's method. Not in Result's good half where it does not converge: a pixel that no
  // ray of the model's range has.
  Result<Vec2d> unproject(const Vec2d& pixel) const requires std::same_as<S, double> {
    const Vec2d target = {{(pixel[0] - cx) / fx, (pixel[1] - cy) / fy}};
    Vec2d p = target;
    for (int iteration = 0; iteration < 20; ++iteration) {
      Vec2d at;
      double a, b, c;
      const double growth = distort(p[0], p[1], at, a, b, c);
      const Vec2d e = target - at;
      const double determinant = a * c - b * b;
      if (!(growth > 0.0) || !(determinant > 0.0)) break;
      const Vec2d step = {{(c * e[0] - b * e[1]) / determinant, (a * e[1] - b * e[0]) / determinant}};
      p += step;
      if (step.squared_norm() < 1e-24 * (1.0 + p.squared_norm())) return p;
    }
    return Error{ErrorCode::bad_input,
                 "pixel (" + std::to_string(pixel[0]) + ", " + std::to_string(pixel[1]) +
                     "): no ray of the camera's distortion model ends there",
                 {},
                 0};
  }

 private:
  // Distorted coordinates, their symmetric derivative [a, b; b, c], and the growth of the radial polynomial.
  S distort(const S& x, const S& y, Vec<S, 2>& out, S& a, S& b, S& c) const {
    const S xx = x * x, yy = y * y, xy = x * y, s = xx + yy, two(2.0), six(6.0);
    const S radial = S(1.0) + s * (k1 + s * k2), slope = two * k1 + S(4.0) * k2 * s;
    out = {{x * radial + two * p1 * xy + p2 * (s + two * xx), y * radial + p1 * (s + two * yy) + two * p2 * xy}};
    a = radial + slope * xx + two * p1 * y + six * p2 * x;
    b = slope * xy + two * p1 * x + two * p2 * y;
    c = radial + slope * yy + six * p1 * y + two * p2 * x;
    return radial + slope * s;
  }
};
using RadTanCamerad = RadTanCamera<double>;

}  // namespace oriel
