// Reprojection errors in raw (distorted) pixels, of landmarks that are a 3D point or an inverse depth along the bearing
// of their anchor observation in camera 0 (Civera, Davison, Montiel, "Inverse Depth Parametrization for Monocular
// SLAM", TRO 2008, with the bearing held at its measurement). Projection does not see the length of a vector, so the
// landmark is carried around multiplied by its inverse depth ρ, and nothing is divided by ρ:
//   h_anchor = R_bc [x y 1]ᵀ + ρ t_bc                     in the anchor's body
//   h_body   = R_ba R_bc [x y 1]ᵀ + ρ g,  g = R_ba t_bc + s,  R_ba = R_bᵀ R_a,  s = R_bᵀ (t_a - t_b)
//   h_camera = R_bcᵀ (h_body - ρ t_bc)
// With K = ∂pixel/∂h_camera · R_bcᵀ = ∂pixel/∂h_body and M = K R_ba:
//   J_b = [K hat(h_body), -ρ K],  J_a = [-M hat(h_anchor), ρ M],  J_ρ = K (g - t_bc).
#pragma once
#include "oriel/manifold/inverse_depth.h"
#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/linearize_rows.h"
#include "oriel/residual/residual.h"
#include "oriel/sensor/stereo_rig.h"

namespace oriel {

// A landmark nearer to a camera's plane than this, or behind it, makes its factor invalid [m].
inline constexpr double kLeastDepth = 0.05;

namespace detail {

// Inlined by force: a call would pass eight-lane matrices through memory (measured: 18 → 16 ns a stereo row).
// A landmark in the body's frame times ρ (ρ = 1 for points), seen by one camera of the rig. r: rows [row, row + 2).
template <class S, template <class> class C, int D>
[[gnu::always_inline]] inline MaskOf<S> view(const MountedCamera<S, C>& mount, const Vec<S, 3>& h_body, const S& rho,
                                             const Vec<S, 2>& pixel, int row, Vec<S, D>& r, Mat<S, 2, 3>* K) {
  const Vec<S, 3> h = transposed_times(mount.R_body_camera, h_body - mount.t_body_camera * rho);
  Vec<S, 2> at;
  Mat<S, 2, 3> J;
  const auto holds = mount.camera.project(h, at, K != nullptr ? &J : nullptr);
  r[row] = at[0] - pixel[0];
  r[row + 1] = at[1] - pixel[1];
  if (K != nullptr) *K = J * mount.R_body_camera.transposed();
  return holds & (h[2] > rho * S(kLeastDepth));
}

// What all cameras of one body share about a landmark with an anchor.
template <class S>
struct AnchoredLandmark {
  Mat<S, 3, 3> R_ba;
  Vec<S, 3> h_anchor, h_body, g;

  template <template <class> class C>
  [[gnu::always_inline]] AnchoredLandmark(const Vec<S, 2>& bearing, const MountedCamera<S, C>& anchor,
                                          const Pose3<S>& a, const Pose3<S>& b, const S& rho) {
    const Rot3<S> b_inverse = b.R.inverse();
    const Vec<S, 3> ray = anchor.R_body_camera * Vec<S, 3>{{bearing[0], bearing[1], S(1.0)}};
    R_ba = (b_inverse * a.R).matrix();
    g = R_ba * anchor.t_body_camera + b_inverse * (a.t - b.t);
    h_anchor = ray + anchor.t_body_camera * rho;
    h_body = R_ba * ray + g * rho;
  }

  template <template <class> class C, int D>
  [[gnu::always_inline]] void jacobians(const Mat<S, 2, 3>& K, const MountedCamera<S, C>& mount, const S& rho, int row,
                                        Mat<S, D, 6>& J_a, Mat<S, D, 6>& J_b, Mat<S, D, 1>& J_rho) const {
    const Mat<S, 2, 3> M = K * R_ba;
    J_b.set_block(row, 0, times_hat(K, h_body));
    J_b.set_block(row, 3, K * -rho);
    J_a.set_block(row, 0, -times_hat(M, h_anchor));
    J_a.set_block(row, 3, M * rho);
    J_rho.set_block(row, 0, K * (g - mount.t_body_camera));
  }
};

}  // namespace detail

// Both cameras at body pose b: r = [u0, v0, u1, v1] [px] (4 × 1).
template <class S, template <class> class C = RadTanCamera>
struct StereoReprojection {
  struct Name {
    static constexpr std::string_view kName = "stereo_reprojection/1";
  };
  static constexpr std::string_view kName = ComposedName<Name, C<double>>::kName;
  static constexpr int kDim = 4;
  using Variables = Types<Pose3d, Pose3d, InverseDepthd, StereoRig<double, C>>;  // T_world_anchorbody, T_world_body
  template <class T>
  using rebind = StereoReprojection<T, C>;

  Vec<S, 2> bearing;         // of the anchor observation in camera 0, undistorted: [x/z, y/z]
  Vec<S, 2> pixel0, pixel1;  // [px]

  Valid<S> evaluate(const Pose3<S>& a, const Pose3<S>& b, const InverseDepth<S>& depth, const StereoRig<S, C>& rig,
                    Vec<S, 4>& r, Mat<S, 4, 6>* J_a, Mat<S, 4, 6>* J_b, Mat<S, 4, 1>* J_depth) const {
    const bool wanted = J_a != nullptr;
    const detail::AnchoredLandmark<S> landmark(bearing, rig.cameras[0], a, b, depth.rho);
    Mat<S, 2, 3> K;
    const auto valid0 = detail::view(rig.cameras[0], landmark.h_body, depth.rho, pixel0, 0, r, wanted ? &K : nullptr);
    if (wanted) landmark.jacobians(K, rig.cameras[0], depth.rho, 0, *J_a, *J_b, *J_depth);
    const auto valid1 = detail::view(rig.cameras[1], landmark.h_body, depth.rho, pixel1, 2, r, wanted ? &K : nullptr);
    if (wanted) landmark.jacobians(K, rig.cameras[1], depth.rho, 2, *J_a, *J_b, *J_depth);
    return valid0 & valid1;
  }
};
using StereoReprojectiond = StereoReprojection<double>;

// One camera of the rig at body pose b: r = [u, v] [px] (2 × 1).
template <class S, int Index = 0, template <class> class C = RadTanCamera>
struct MonoReprojection {
  struct Name {
    static constexpr std::string_view kName = Index == 0 ? "mono_reprojection0/1" : "mono_reprojection1/1";
  };
  static_assert(Index == 0 || Index == 1);
  static constexpr std::string_view kName = ComposedName<Name, C<double>>::kName;
  static constexpr int kDim = 2;
  using Variables = Types<Pose3d, Pose3d, InverseDepthd, StereoRig<double, C>>;  // T_world_anchorbody, T_world_body
  template <class T>
  using rebind = MonoReprojection<T, Index, C>;

  Vec<S, 2> bearing;  // of the anchor observation in camera 0, undistorted: [x/z, y/z]
  Vec<S, 2> pixel;    // [px]

  Valid<S> evaluate(const Pose3<S>& a, const Pose3<S>& b, const InverseDepth<S>& depth, const StereoRig<S, C>& rig,
                    Vec<S, 2>& r, Mat<S, 2, 6>* J_a, Mat<S, 2, 6>* J_b, Mat<S, 2, 1>* J_depth) const {
    const bool wanted = J_a != nullptr;
    const detail::AnchoredLandmark<S> landmark(bearing, rig.cameras[0], a, b, depth.rho);
    const auto& mount = rig.cameras[Index];
    Mat<S, 2, 3> K;
    const auto valid = detail::view(mount, landmark.h_body, depth.rho, pixel, 0, r, wanted ? &K : nullptr);
    if (wanted) landmark.jacobians(K, mount, depth.rho, 0, *J_a, *J_b, *J_depth);
    return valid;
  }
};
using MonoReprojectiond = MonoReprojection<double>;

// The other camera of the anchor's own body: poses cancel, and the baseline alone fixes the depth. r = [u, v] [px].
template <class S, int Index = 1, template <class> class C = RadTanCamera>
struct AnchorReprojection {
  struct Name {
    static constexpr std::string_view kName = "anchor_reprojection/1";
  };
  static_assert(Index == 1, "camera 0 of the anchor sees its own bearing: there is nothing to measure");
  static constexpr std::string_view kName = ComposedName<Name, C<double>>::kName;
  static constexpr int kDim = 2;
  using Variables = Types<InverseDepthd, StereoRig<double, C>>;
  template <class T>
  using rebind = AnchorReprojection<T, Index, C>;

  Vec<S, 2> bearing;  // of the anchor observation in camera 0, undistorted: [x/z, y/z]
  Vec<S, 2> pixel;    // [px]

  Valid<S> evaluate(const InverseDepth<S>& depth, const StereoRig<S, C>& rig, Vec<S, 2>& r,
                    Mat<S, 2, 1>* J_depth) const {
    const auto &anchor = rig.cameras[0], &mount = rig.cameras[Index];
    const Vec<S, 3> ray = anchor.R_body_camera * Vec<S, 3>{{bearing[0], bearing[1], S(1.0)}};
    const Vec<S, 3> h_body = ray + anchor.t_body_camera * depth.rho;
    Mat<S, 2, 3> K;
    const auto valid = detail::view(mount, h_body, depth.rho, pixel, 0, r, J_depth != nullptr ? &K : nullptr);
    if (J_depth != nullptr) *J_depth = K * (anchor.t_body_camera - mount.t_body_camera);
    return valid;
  }
};
using AnchorReprojectiond = AnchorReprojection<double>;

namespace detail {

// Rows [row, row + 2) of a point's residual and its Jacobians: with p_b = R_bᵀ (p - t_b),
// J_pose = [K hat(p_b), -K], J_point = K R_bᵀ.
template <class S, template <class> class C, int D>
[[gnu::always_inline]] inline MaskOf<S> view_point(const MountedCamera<S, C>& mount, const Vec<S, 3>& p_body,
                                                   const Mat<S, 3, 3>& R_body_world, const Vec<S, 2>& pixel, int row,
                                                   Vec<S, D>& r, Mat<S, D, 6>* J_pose, Mat<S, D, 3>* J_point) {
  Mat<S, 2, 3> K;
  const auto valid = view(mount, p_body, S(1.0), pixel, row, r, J_pose != nullptr ? &K : nullptr);
  if (J_pose == nullptr) return valid;
  J_pose->set_block(row, 0, times_hat(K, p_body));
  J_pose->set_block(row, 3, -K);
  J_point->set_block(row, 0, K * R_body_world);
  return valid;
}

}  // namespace detail

// A 3D point in both cameras: r = [u0, v0, u1, v1] [px] (4 × 1).
template <class S, template <class> class C = RadTanCamera>
struct StereoPointReprojection {
  struct Name {
    static constexpr std::string_view kName = "stereo_point_reprojection/1";
  };
  static constexpr std::string_view kName = ComposedName<Name, C<double>>::kName;
  static constexpr int kDim = 4;
  using Variables = Types<Pose3d, Point3d, StereoRig<double, C>>;  // T_world_body, p_world_landmark
  template <class T>
  using rebind = StereoPointReprojection<T, C>;

  Vec<S, 2> pixel0, pixel1;  // [px]

  Valid<S> evaluate(const Pose3<S>& b, const Point3<S>& point, const StereoRig<S, C>& rig, Vec<S, 4>& r,
                    Mat<S, 4, 6>* J_b, Mat<S, 4, 3>* J_point) const {
    const Mat<S, 3, 3> R = b.R.inverse().matrix();
    const Vec<S, 3> p = R * (point.p - b.t);
    const auto valid0 = detail::view_point(rig.cameras[0], p, R, pixel0, 0, r, J_b, J_point);
    const auto valid1 = detail::view_point(rig.cameras[1], p, R, pixel1, 2, r, J_b, J_point);
    return valid0 & valid1;
  }
};
using StereoPointReprojectiond = StereoPointReprojection<double>;

// A 3D point in one camera of the rig: r = [u, v] [px] (2 × 1).
template <class S, int Index = 0, template <class> class C = RadTanCamera>
struct MonoPointReprojection {
  struct Name {
    static constexpr std::string_view kName = Index == 0 ? "mono_point_reprojection0/1" : "mono_point_reprojection1/1";
  };
  static_assert(Index == 0 || Index == 1);
  static constexpr std::string_view kName = ComposedName<Name, C<double>>::kName;
  static constexpr int kDim = 2;
  using Variables = Types<Pose3d, Point3d, StereoRig<double, C>>;  // T_world_body, p_world_landmark
  template <class T>
  using rebind = MonoPointReprojection<T, Index, C>;

  Vec<S, 2> pixel;  // [px]

  Valid<S> evaluate(const Pose3<S>& b, const Point3<S>& point, const StereoRig<S, C>& rig, Vec<S, 2>& r,
                    Mat<S, 2, 6>* J_b, Mat<S, 2, 3>* J_point) const {
    const Mat<S, 3, 3> R = b.R.inverse().matrix();
    return detail::view_point(rig.cameras[Index], R * (point.p - b.t), R, pixel, 0, r, J_b, J_point);
  }
};
using MonoPointReprojectiond = MonoPointReprojection<double>;

// Compiled once, in the library.
extern template void linearize_rows<StereoReprojectiond, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<MonoReprojectiond, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<MonoReprojection<double, 1>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<AnchorReprojectiond, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<StereoPointReprojectiond, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<MonoPointReprojectiond, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<MonoPointReprojection<double, 1>, IsotropicNoise>(const RowPointers&,
                                                                                      Batch&) noexcept;

}  // namespace oriel
