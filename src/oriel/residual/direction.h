// The direction in which a body sees a point, as a unit vector of its own frame (S²): of a camera of any kind, a wide
// one too, where pixels would mean nothing.
//   q = R_world_bodyᵀ (p_world_point - t),  y = q/‖q‖,  r = y ⊟ z (2 × 1) [rad], manifold/unit_vector.h
//   J_q = ∂(y ⊟ z)/∂y (I - y yᵀ)/‖q‖,  J_pose = J_q [hat(q), -I],  J_point = J_q Rᵀ
// with ∂(y ⊟ z)/∂y = θ/sin θ B(z)ᵀ + B(z)ᵀ y · d(θ/sin θ)/d(cos θ) zᵀ, θ = ∠(y, z). At the point itself there is no
// direction, and opposite to z none that r could say: there the factor is not valid.
#pragma once
#include "oriel/manifold/se3.h"
#include "oriel/manifold/unit_vector.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/linearize_rows.h"
#include "oriel/residual/residual.h"

namespace oriel {

template <class S>
struct DirectionToPoint {
  static constexpr std::string_view kName = "direction_to_point/1";
  static constexpr int kDim = 2;
  static constexpr double kLeastDistance = 1e-6;   // [m]
  static constexpr double kOpposite = -0.9999995;  // cos θ: within 1e-3 rad
  using Variables = Types<Pose3d, Point3d>;        // T_world_body, p_world_point
  template <class T>
  using rebind = DirectionToPoint<T>;

  UnitVector3<S> measured;  // z, in the body's frame

  Valid<S> evaluate(const Pose3<S>& x, const Point3<S>& point, Vec<S, 2>& r, Mat<S, 2, 6>* J_x,
                    Mat<S, 2, 3>* J_point) const {
    using std::sqrt;
    const Mat<S, 3, 3> R_body_world = x.R.inverse().matrix();
    const Vec<S, 3> q = R_body_world * (point.p - x.t);
    const S squared = q.squared_norm();
    const auto away = squared > S(kLeastDistance * kLeastDistance);
    const S inverse = S(1.0) / sqrt(select(away, squared, S(1.0)));
    const Vec<S, 3> y = q * inverse;
    const Mat<S, 3, 2> B = measured.basis();
    const Vec<S, 2> across = transposed_times(B, y);
    const S c = measured.v.dot(y);
    S stretch, slope;
    UnitVector3<S>::angles(across, c, stretch, slope);
    r = across * stretch;
    if (J_x != nullptr) {
      const Mat<S, 2, 3> by_y = B.transposed() * stretch + (across * slope) * measured.v.transposed();
      const Mat<S, 2, 3> by_q = (by_y - (by_y * y) * y.transposed()) * inverse;
      J_x->set_block(0, 0, times_hat(by_q, q));
      J_x->set_block(0, 3, -by_q);
      *J_point = by_q * R_body_world;
    }
    return away & (c > S(kOpposite));
  }
};
using DirectionToPointd = DirectionToPoint<double>;

// Compiled once, in the library.
extern template void linearize_rows<DirectionToPointd, IsotropicNoise>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
