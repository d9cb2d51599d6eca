#include "oriel/evaluate/align.h"

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>
#include <string>

namespace oriel {
namespace {

struct Moments {
  Vec3d estimate_mean = Vec3d::zero(), truth_mean = Vec3d::zero();
  double estimate_variance = 0;      // σ_x², eq. 36
  Mat3d covariance = Mat3d::zero();  // Σ_xy, eq. 38
};

Moments moments(std::span<const Vec3d> estimate, std::span<const Vec3d> truth) {
  Moments m;
  const double share = 1.0 / static_cast<double>(estimate.size());
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    m.estimate_mean += estimate[i] * share;
    m.truth_mean += truth[i] * share;
  }
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    const Vec3d e = estimate[i] - m.estimate_mean, g = truth[i] - m.truth_mean;
    m.estimate_variance += e.squared_norm() * share;
    m.covariance += (g * e.transposed()) * share;
  }
  return m;
}

// R = U·S·Vᵀ, eq. 40–43; the trace of D·S, for the scale, comes with it.
Mat3d rotation_of(const Mat3d& covariance, double& trace) {
  const Eigen::Map<const Eigen::Matrix3d> sigma(covariance.data());
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sigma, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d S(1, 1, 1);
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) S[2] = -1;
  trace = svd.singularValues().dot(S);
  Mat3d R;
  Eigen::Map<Eigen::Matrix3d>(R.data()) = svd.matrixU() * S.asDiagonal() * svd.matrixV().transpose();
  return R;
}

// The maximum of tr(R·Σ_xyᵀ) over rotations about z: with c·(Σ_11 + Σ_22) + s·(Σ_21 − Σ_12), tan θ is their ratio.
Mat3d yaw_of(const Mat3d& covariance) {
  const double theta = std::atan2(covariance(1, 0) - covariance(0, 1), covariance(0, 0) + covariance(1, 1));
  Mat3d R = Mat3d::identity();
  R(0, 0) = R(1, 1) = std::cos(theta);
  R(1, 0) = std::sin(theta);
  R(0, 1) = -R(1, 0);
  return R;
}

}  // namespace

Result<Alignment> parse_alignment(std::string_view name) {
  for (Alignment a : {Alignment::none, Alignment::yaw, Alignment::se3, Alignment::sim3})
    if (name == name_of(a)) return a;
  return Error{ErrorCode::bad_input, "expected an alignment se3, sim3, yaw or none, found '" + std::string(name) + "'",
               ""};
}

std::string_view name_of(Alignment alignment) {
  switch (alignment) {
    case Alignment::none:
      return "none";
    case Alignment::yaw:
      return "yaw";
    case Alignment::se3:
      return "se3";
    case Alignment::sim3:
      return "sim3";
  }
  return "none";
}

Result<Similarity> align(std::span<const Vec3d> estimate, std::span<const Vec3d> truth, Alignment alignment) {
  if (estimate.size() != truth.size() || estimate.empty())
    return Error{ErrorCode::size_mismatch,
                 "expected pairs of estimated and true positions, found " + std::to_string(estimate.size()) + " and " +
                     std::to_string(truth.size()),
                 ""};
  Similarity T;
  if (alignment == Alignment::none) return T;
  const Moments m = moments(estimate, truth);
  double trace = 0;
  T.R = alignment == Alignment::yaw ? yaw_of(m.covariance) : rotation_of(m.covariance, trace);
  if (alignment == Alignment::sim3) {
    // Points that differ by the rounding of their mean alone are one.
    if (!(m.estimate_variance > 1e-28 * m.estimate_mean.squared_norm()))
      return Error{ErrorCode::singular, "expected an estimate that moves, as a scale is to be found; all are one point",
                   ""};
    T.scale = trace / m.estimate_variance;  // eq. 42
  }
  T.t = m.truth_mean - T.scale * (T.R * m.estimate_mean);  // eq. 41
  return T;
}

}  // namespace oriel
