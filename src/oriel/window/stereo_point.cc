#include "oriel/window/stereo_point.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>

#include "oriel/residual/reprojection.h"
#include "oriel/window/triangulate.h"

namespace oriel {
namespace {

constexpr int kIterations = 6;
constexpr double kLeastParallax = 1e-5;  // [rad]: numerical; what is too far is a matter of the covariance

template <int R, int C>
Eigen::Map<const Eigen::Matrix<double, R, C>> eigen(const Mat<double, R, C>& a) {
  return Eigen::Map<const Eigen::Matrix<double, R, C>>(a.data());
}
template <int R, int C>
Mat<double, R, C> own(const Eigen::Matrix<double, R, C>& a) {
  Mat<double, R, C> out;
  Eigen::Map<Eigen::Matrix<double, R, C>>(out.data()) = a;
  return out;
}
Mat3d symmetric(const Eigen::Matrix3d& a) { return own<3, 3>(0.5 * (a + a.transpose())); }

std::optional<Vec3d> meet(const StereoRigd& rig, const StereoSighting& seen) {
  Ray rays[2];
  const Vec2d pixels[2] = {seen.pixel0, seen.pixel1};
  for (int c = 0; c < 2; ++c) {
    const Result<Vec2d> b = rig.cameras[c].camera.unproject(pixels[c]);
    if (!b) return std::nullopt;
    rays[c] = {rig.cameras[c].t_body_camera, rig.cameras[c].R_body_camera * Vec3d{{(*b)[0], (*b)[1], 1.0}}};
  }
  return triangulate(rays, kLeastParallax);
}

// Errors of a point of the body in both cameras, and ∂r/∂p_body.
bool errors_at(const StereoRigd& rig, const StereoSighting& seen, const Vec3d& p, Vec4d& r, Mat<double, 4, 3>& J) {
  Mat<double, 2, 3> K;
  const Vec2d pixels[2] = {seen.pixel0, seen.pixel1};
  for (int c = 0; c < 2; ++c) {
    if (!detail::view(rig.cameras[c], p, 1.0, pixels[c], 2 * c, r, &K)) return false;
    J.set_block(2 * c, 0, K);
  }
  return true;
}

}  // namespace

Vec3d in_body(const StereoRigd& rig, const Vec3d& p_camera) {
  return rig.cameras[0].R_body_camera * p_camera + rig.cameras[0].t_body_camera;
}
Mat3d in_body(const StereoRigd& rig, const Mat3d& covariance) {
  const Mat3d& R = rig.cameras[0].R_body_camera;
  return symmetric(eigen(R) * eigen(covariance) * eigen(R).transpose());
}

std::optional<StereoPoint> stereo_point(const StereoRigd& rig, const StereoSighting& seen,
                                        const StereoPointOptions& options) {
  const std::optional<Vec3d> start = meet(rig, seen);
  if (!start) return std::nullopt;
  Eigen::Matrix4d W = Eigen::Matrix4d::Zero();
  W.topLeftCorner<2, 2>() = eigen(seen.covariance0).inverse();
  W.bottomRightCorner<2, 2>() = eigen(seen.covariance1).inverse();
  Vec3d p = *start;
  Vec4d r;
  Mat<double, 4, 3> J;
  Eigen::LDLT<Eigen::Matrix3d> information;
  for (int k = 0; k <= kIterations; ++k) {
    if (!errors_at(rig, seen, p, r, J)) return std::nullopt;
    const Eigen::Matrix<double, 3, 4> JtW = eigen(J).transpose() * W;
    information.compute(JtW * eigen(J));
    if (information.info() != Eigen::Success || !(information.vectorD().minCoeff() > 0.0)) return std::nullopt;
    if (k < kIterations) p -= own<3, 1>(information.solve(JtW * eigen(r)));
  }
  const double error = eigen(r).dot(W * eigen(r));
  if (!(error <= options.greatest_error * options.greatest_error)) return std::nullopt;
  const Mat3d& R = rig.cameras[0].R_body_camera;
  StereoPoint point;
  point.p_camera = transposed_times(R, p - rig.cameras[0].t_body_camera);
  const Eigen::Matrix3d covariance = information.solve(Eigen::Matrix3d::Identity());
  point.covariance = symmetric(eigen(R).transpose() * covariance * eigen(R));
  const double z = point.p_camera[2];
  if (!(z > 0.0) || !(point.covariance(2, 2) <= options.greatest_depth_share * options.greatest_depth_share * z * z))
    return std::nullopt;
  return point;
}

template <int D>
bool fuse_sighting(const Vec<double, D>& r, const Mat<double, D, 3>& M, const Mat<double, D, D>& V, Vec3d& p,
                   Mat3d& covariance) {
  const Eigen::LDLT<Eigen::Matrix<double, D, D>> noise(eigen(V));
  const Eigen::LDLT<Eigen::Matrix3d> before(eigen(covariance));
  if (!(noise.vectorD().minCoeff() > 0.0) || !(before.vectorD().minCoeff() > 0.0)) return false;
  const Eigen::Matrix<double, D, 3> VinvM = noise.solve(eigen(M));
  const Eigen::Matrix3d information =
      before.solve(Eigen::Matrix3d::Identity()) + Eigen::Matrix3d(eigen(M).transpose() * VinvM);
  const Eigen::LDLT<Eigen::Matrix3d> after(information);
  if (!(after.vectorD().minCoeff() > 0.0)) return false;
  const Eigen::Vector3d step = after.solve(VinvM.transpose() * eigen(r));
  if (!step.allFinite()) return false;
  p -= own<3, 1>(step);
  covariance = symmetric(after.solve(Eigen::Matrix3d::Identity()));
  return true;
}
template bool fuse_sighting<2>(const Vec2d&, const Mat<double, 2, 3>&, const Mat2d&, Vec3d&, Mat3d&);
template bool fuse_sighting<4>(const Vec4d&, const Mat<double, 4, 3>&, const Mat<double, 4, 4>&, Vec3d&, Mat3d&);

}  // namespace oriel
