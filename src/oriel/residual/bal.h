// Reprojection in "Bundle Adjustment in the Large" (Agarwal, Snavely, Seitz, Szeliski, ECCV 2010, section 2 of its data
// page): P = R X + t, p = -P_xy / P_z, r = f (1 + k1 |p|² + k2 |p|⁴) p - pixel [px] (2 × 1).
#pragma once
#include "oriel/manifold/bal_camera.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/linearize_rows.h"
#include "oriel/residual/residual.h"

namespace oriel {

// Valid wherever it is finite: the definition has no notion of "behind the camera", and costs have to be comparable.
//
// With s = |p|², d = 1 + k1 s + k2 s², ∂r/∂p = f (d I + 2 (k1 + 2 k2 s) p pᵀ), ∂p/∂P = -1/P_z [I, p]; the rest follows
// from J_P = ∂r/∂P: J_t = J_P, J_X = J_P R, J_φ = -J_X hat(X), since R Exp(φ) X = R X - R hat(X) φ.
template <class S>
struct BalReprojection {
  static constexpr std::string_view kName = "bal_reprojection/1";
  static constexpr int kDim = 2;
  using Variables = Types<BalCamerad, Point3d>;
  template <class T>
  using rebind = BalReprojection<T>;

  Vec<S, 2> pixel;  // [px], from the centre of the image, y up

  Valid<S> evaluate(const BalCamera<S>& camera, const Point3<S>& point, Vec<S, 2>& r, Mat<S, 2, 9>* J_camera,
                    Mat<S, 2, 3>* J_point) const {
    const Mat<S, 3, 3> R = camera.R_camera_world.matrix();
    const Vec<S, 3>& X = point.p;
    const Vec<S, 3> P = R * X + camera.t;
    const S m = S(-1.0) / P[2];
    const Vec<S, 2> p = {{P[0] * m, P[1] * m}};
    const S s = p[0] * p[0] + p[1] * p[1], d = S(1.0) + s * (camera.k1 + s * camera.k2);
    const S fd = camera.f * d;
    r = {{fd * p[0] - pixel[0], fd * p[1] - pixel[1]}};
    if (J_camera == nullptr) return always_valid<S>();

    const S fm = camera.f * m;
    const S slope = fm * (camera.k1 + S(2.0) * camera.k2 * s) * S(2.0), diagonal = fm * d;
    const S sx = slope * p[0], a = diagonal + sx * p[0], b = sx * p[1], c = diagonal + slope * p[1] * p[1];
    const Mat<S, 2, 3> J_P = {{a, b, b, c, a * p[0] + b * p[1], b * p[0] + c * p[1]}};
    *J_point = J_P * R;
    const Mat<S, 2, 3> turn = times_hat(*J_point, X);
    const S fs = camera.f * s, fss = fs * s;
    *J_camera = {{-turn.m[0], -turn.m[1], -turn.m[2], -turn.m[3], -turn.m[4], -turn.m[5],  //
                  J_P.m[0], J_P.m[1], J_P.m[2], J_P.m[3], J_P.m[4], J_P.m[5],              //
                  d * p[0], d * p[1], fs * p[0], fs * p[1], fss * p[0], fss * p[1]}};
    return always_valid<S>();
  }
};
using BalReprojectiond = BalReprojection<double>;

// Compiled once, in the library.
extern template void linearize_rows<BalReprojectiond, IsotropicNoise>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
