// The camera of "Bundle Adjustment in the Large" (Agarwal, Snavely, Seitz, Szeliski, ECCV 2010) as a variable.
#pragma once
#include "oriel/manifold/so3.h"

namespace oriel {

// A point X of the world is P = R X + t in the camera, which looks along -z. The tangent is [φ; δt; δf; δk1; δk2]:
// R ⊞ φ = R·Exp(φ), all else is added to.
template <class S>
struct BalCamera {
  static constexpr std::string_view kName = "bal_camera/1";
  static constexpr int kDim = 9;
  static constexpr std::array<std::string_view, 9> kTangentNames = {
      "rotation x [rad]",  "rotation y [rad]",  "rotation z [rad]",  "translation x [m]", "translation y [m]",
      "translation z [m]", "focal length [px]", "distortion k1 [-]", "distortion k2 [-]"};
  template <class T>
  using rebind = BalCamera<T>;

  Rot3<S> R_camera_world{};
  Vec<S, 3> t = Vec<S, 3>::zero();
  S f = S(1.0), k1 = S(0.0), k2 = S(0.0);  // focal length [px], radial distortion

  // The nine numbers of a file: angle-axis of R [rad], t, f [px], k1, k2.
  static BalCamera from_file(const Vec<S, 9>& c) {
    return {Rot3<S>::exp(c.template segment<3>(0)), c.template segment<3>(3), c[6], c[7], c[8]};
  }
  Vec<S, 9> to_file() const {
    const Vec<S, 3> a = R_camera_world.log();
    return {{a[0], a[1], a[2], t[0], t[1], t[2], f, k1, k2}};
  }

  BalCamera plus(const Vec<S, 9>& d) const {
    return {R_camera_world.plus(d.template segment<3>(0)), t + d.template segment<3>(3), f + d[6], k1 + d[7],
            k2 + d[8]};
  }
  Vec<S, 9> minus(const BalCamera& x) const {
    const Vec<S, 3> a = R_camera_world.minus(x.R_camera_world), b = t - x.t;
    return {{a[0], a[1], a[2], b[0], b[1], b[2], f - x.f, k1 - x.k1, k2 - x.k2}};
  }
};
using BalCamerad = BalCamera<double>;

}  // namespace oriel
