// A point that is known in one frame, with its covariance, seen by the cameras of another. The body poses of both are
// variables, so that one problem can be written down in world, or in the frame of the first (T_world_a = identity).
//   q = T_world_b⁻¹ T_world_a p_a = R_ba p_a + R_bᵀ (t_a - t_b)                  [m], in the body of b
// r = seen(q) - seen [px], the rows being
//   MatchedPixel     [u0, v0]          of the left camera alone                  (2 × 1)
//   MatchedDisparity [u0, v0, u0 - u1] of a pair whose epipolar lines are rows   (3 × 1)
//   MatchedStereo    [u0, v0, u1, v1]  of any pair                               (4 × 1)
// With K = ∂seen/∂q (D × 3) and M = K R_ba:
//   J_b = [K hat(q), -K],  J_a = [-M hat(p_a), M],  ∂r/∂p_a = M.
// The noise is that of r: Σ = Σ_seen + M Σ_p Mᵀ, with Σ_p the point's covariance carried to first order at a first guess
// (R. Hartley, A. Zisserman, "Multiple View Geometry", 2004, section 5.2.1).
#pragma once
#include "oriel/residual/reprojection.h"

namespace oriel {

namespace detail {

// Rows of r and K of both cameras, or of the left one.
template <int D, class S>
MaskOf<S> see_match(const StereoRig<S>& rig, const Vec<S, 3>& q, const Vec<S, D>& seen, Vec<S, D>& r, Mat<S, D, 3>* K) {
  Mat<S, 2, 3> K0, K1;
  Vec<S, 4> both = Vec<S, 4>::zero();
  const Vec<S, 2> zero = Vec<S, 2>::zero();
  auto valid = view(rig.cameras[0], q, S(1.0), zero, 0, both, K != nullptr ? &K0 : nullptr);
  if constexpr (D > 2) valid = valid & view(rig.cameras[1], q, S(1.0), zero, 2, both, K != nullptr ? &K1 : nullptr);
  if constexpr (D == 3) both[2] = both[0] - both[2];
  for (int i = 0; i < D; ++i) r[i] = both[i] - seen[i];
  if (K == nullptr) return valid;
  K->set_block(0, 0, K0);
  if constexpr (D == 3)
    for (int j = 0; j < 3; ++j) (*K)(2, j) = K0(0, j) - K1(0, j);
  if constexpr (D == 4) K->set_block(2, 0, K1);
  return valid;
}

template <int D>
struct MatchedPointName {
  static constexpr std::string_view kName = D == 2   ? "matched_pixel/1"
                                            : D == 3 ? "matched_disparity/1"
                                                     : "matched_stereo/1";
};

}  // namespace detail

template <class S, int D>
struct MatchedPoint {
  static_assert(D >= 2 && D <= 4);
  static constexpr std::string_view kName = detail::MatchedPointName<D>::kName;
  static constexpr int kDim = D;
  using Variables = Types<Pose3d, Pose3d, StereoRigd>;  // T_world_a, T_world_b
  template <class T>
  using rebind = MatchedPoint<T, D>;

  Vec<S, 3> p_a;   // [m], in the body of a
  Vec<S, D> seen;  // [px], in b

  Valid<S> evaluate(const Pose3<S>& a, const Pose3<S>& b, const StereoRig<S>& rig, Vec<S, D>& r, Mat<S, D, 6>* J_a,
                    Mat<S, D, 6>* J_b) const {
    const Rot3<S> b_inverse = b.R.inverse();
    const Mat<S, 3, 3> R_ba = (b_inverse * a.R).matrix();
    const Vec<S, 3> q = R_ba * p_a + b_inverse * (a.t - b.t);
    Mat<S, D, 3> K;
    const auto valid = detail::see_match<D>(rig, q, seen, r, J_a != nullptr ? &K : nullptr);
    if (J_a == nullptr) return valid;
    const Mat<S, D, 3> M = K * R_ba;
    J_a->set_block(0, 0, -times_hat(M, p_a));
    J_a->set_block(0, 3, M);
    J_b->set_block(0, 0, times_hat(K, q));
    J_b->set_block(0, 3, -K);
    return valid;
  }
};
using MatchedPixeld = MatchedPoint<double, 2>;
using MatchedDisparityd = MatchedPoint<double, 3>;
using MatchedStereod = MatchedPoint<double, 4>;

// Compiled once, in the library.
extern template void linearize_rows<MatchedPixeld, FullNoise<2>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<MatchedDisparityd, FullNoise<3>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<MatchedStereod, FullNoise<4>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
