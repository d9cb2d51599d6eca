// Two cameras fixed to a body: what all reprojections of a recording share, a constant of the graph.
#pragma once
#include "oriel/manifold/name.h"
#include "oriel/manifold/se3.h"
#include "oriel/sensor/camera.h"

namespace oriel {

// A camera and T_body_camera, its rotation kept as a matrix: it is used a thousand times for each time that it is set.
template <class S, template <class> class C = RadTanCamera>
struct MountedCamera {
  C<S> camera{};
  Mat<S, 3, 3> R_body_camera = Mat<S, 3, 3>::identity();
  Vec<S, 3> t_body_camera = Vec<S, 3>::zero();  // [m]

  MountedCamera() = default;
  MountedCamera(const C<S>& model, const Pose3<S>& T_body_camera)
      : camera(model), R_body_camera(T_body_camera.R.matrix()), t_body_camera(T_body_camera.t) {}

  Pose3d T_body_camera() const requires std::same_as<S, double> {
    return {Rot3d::from_matrix(R_body_camera), t_body_camera};
  }
};

namespace detail {
struct StereoRigName {
  static constexpr std::string_view kName = "stereo_rig/1";
};
}  // namespace detail

// Camera 0 is the left one, in which tracks are anchored. A rig of one camera leaves cameras[1] as it is.
template <class S, template <class> class C = RadTanCamera>
struct StereoRig {
  static constexpr std::string_view kName = ComposedName<detail::StereoRigName, C<double>>::kName;
  static constexpr int kDim = 0;
  template <class T>
  using rebind = StereoRig<T, C>;

  MountedCamera<S, C> cameras[2];
};
using StereoRigd = StereoRig<double>;

static_assert(Camera<RadTanCamerad> && Constant<StereoRigd> && Rebindable<StereoRigd>);

}  // namespace oriel
