// A landmark's track without the landmark: N poses that saw the same point, the point itself projected out of their
// residual (Mourikis & Roumeliotis, "A Multi-State Constraint Kalman Filter for Vision-aided Inertial Navigation", ICRA
// 2007, eq. 18-24). With e(x, l) all reprojection errors of the track [px], x the poses and l the point,
//   l*(x) = argmin_l ½‖e(x, l)‖²,   J_x = ∂e/∂x,  J_l = ∂e/∂l at l*,   J_l = [Q₁ Q₂] [R; 0],
//   r = Q₂ᵀ e(x, l*)   and   J = Q₂ᵀ J_x.
// At l* the gradient by l vanishes, J_lᵀ e = 0, so Q₁ᵀ e = 0. Hence
// - the cost is the cost with the point at its best place: ‖r‖² = ‖e‖² - ‖Q₁ᵀ e‖² = ‖e(x, l*)‖²;
// - the gradient is exact: Jᵀ r = J_xᵀ Q₂ Q₂ᵀ e = J_xᵀ e = d/dx ½‖e(x, l*(x))‖², since l* moves only where the cost
//   does not change (variable projection: Golub & Pereyra, SIAM J. Numer. Anal. 10, 1973);
// - JᵀJ is the Schur complement of the point in the Gauss–Newton matrix, J_xᵀJ_x - J_xᵀJ_l (J_lᵀJ_l)⁻¹ J_lᵀJ_x. J
// itself
//   is not all of ∂r/∂x: what the turning of Q₂ adds, which is of the size of e, is left out (Kaufman, "A variable
//   projection method for solving separable nonlinear least squares problems", BIT 15, 1975), as Gauss–Newton does.
#pragma once
#include <array>
#include <string_view>
#include <tuple>
#include <utility>

#include "oriel/manifold/se3.h"
#include "oriel/residual/linearize_rows.h"
#include "oriel/residual/noise.h"
#include "oriel/residual/residual.h"
#include "oriel/sensor/stereo_rig.h"

namespace oriel {

// A track whose rays turn by less than this says nothing that a Gaussian could hold [rad]: then it is not valid.
inline constexpr double kLeastTrackParallax = 1e-3;

// What one pose saw of a track. Doubles alone, so that its bytes are defined.
struct TrackView {
  Vec2d bearing0 = Vec2d::zero(), bearing1 = Vec2d::zero();  // undistorted [x/z, y/z]; where the point is looked for
  Vec2d pixel0 = Vec2d::zero(), pixel1 = Vec2d::zero();      // [px]; what is measured
  double right = 0.0;                                        // 1: camera 1 saw it too
};

namespace detail {

inline constexpr int kMostTrackViews = 8;

// r: 4 n - 3 rows, of which those that no camera filled are zero; J[k]: as many rows × 6, column-major, J null where
// they are not wanted. False where the point is behind a camera, has no parallax or no best place.
bool evaluate_structureless(const TrackView* views, const Pose3d* const* poses, int n, const StereoRigd& rig, double* r,
                            double* const* J);
// l* in world; false where evaluate_structureless says so.
bool locate_structureless(const TrackView* views, const Pose3d* const* poses, int n, const StereoRigd& rig,
                          Vec3d& p_world);

// structureless_trackN/1
template <int N>
struct StructurelessName {
  static_assert(N >= 2 && N <= kMostTrackViews);
  static constexpr char kText[] = {'s', 't', 'r', 'u', 'c', 't', 'u', 'r',     'e', 'l', 'e', 's',
                                   's', '_', 't', 'r', 'a', 'c', 'k', '0' + N, '/', '1', '\0'};
};

template <int N, class... V>
struct PosesAndRig : PosesAndRig<N - 1, Pose3d, V...> {};
template <class... V>
struct PosesAndRig<0, V...> {
  using type = Types<V..., StereoRigd>;
};

}  // namespace detail

// Of N poses, T_world_body each; r is (4 N - 3) × 1 [px]. Its noise is isotropic, σ that of a pixel's coordinate: any
// other would weigh the projected rows and not the coordinates. A loss sees the track as a whole.
template <int N>
struct StructurelessTrack {
  static constexpr std::string_view kName = detail::StructurelessName<N>::kText;
  static constexpr int kDim = 4 * N - 3;
  using Variables = typename detail::PosesAndRig<N>::type;

  std::array<TrackView, N> views;

  // N poses, the rig, r, and N Jacobians (kDim × 6).
  template <class... Args>
  bool evaluate(Args&&... args) const {
    static_assert(sizeof...(Args) == 2 * N + 2);
    return unpack(std::forward_as_tuple(args...), std::make_index_sequence<N>{});
  }
  bool finite() const {
    for (const TrackView& v : views)
      if (!all_finite(&v.bearing0[0], sizeof(TrackView) / sizeof(double))) return false;
    return true;
  }

 private:
  template <class All, std::size_t... I>
  bool unpack(const All& all, std::index_sequence<I...>) const {
    const Pose3d* poses[N] = {&std::get<I>(all)...};
    const bool wanted = std::get<N + 2>(all) != nullptr;
    double* J[N] = {(wanted ? std::get<N + 2 + I>(all)->m : nullptr)...};
    return detail::evaluate_structureless(views.data(), poses, N, std::get<N>(all), std::get<N + 1>(all).m,
                                          wanted ? J : nullptr);
  }
};

// Compiled once, in the library.
extern template void linearize_rows<StructurelessTrack<2>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<StructurelessTrack<3>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<StructurelessTrack<4>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<StructurelessTrack<5>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<StructurelessTrack<6>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<StructurelessTrack<7>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<StructurelessTrack<8>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
