#include "oriel/window/refine_pose.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "oriel/residual/reprojection.h"

namespace oriel {
namespace {

// Both cameras of a sighting, or one: rows of r and J that count, 0 where the point is not in view.
int project(const PointSighting& s, const StereoRigd& rig, const Pose3d& T, Vec4d& r, Mat<double, 4, 6>* J) {
  Mat<double, 4, 3> J_point;
  const Point3d point{s.p_world};
  if (s.has_right) {
    const StereoPointReprojectiond residual{s.pixel0, s.pixel1};
    return residual.evaluate(T, point, rig, r, J, J != nullptr ? &J_point : nullptr) ? 4 : 0;
  }
  Vec2d r0;
  Mat<double, 2, 6> J0;
  Mat<double, 2, 3> J0_point;
  const MonoPointReprojection<double> residual{s.pixel0};
  if (!residual.evaluate(T, point, rig, r0, J != nullptr ? &J0 : nullptr, J != nullptr ? &J0_point : nullptr)) return 0;
  r.set_segment(0, r0);
  if (J != nullptr) J->set_block(0, 0, J0);
  return 2;
}

// Length of the worse camera's error.
double error_of(const Vec4d& r, int rows) {
  const double left = std::hypot(r[0], r[1]);
  return rows == 4 ? std::max(left, std::hypot(r[2], r[3])) : left;
}

using System = Eigen::Matrix<double, 6, 6>;
using Vector = Eigen::Matrix<double, 6, 1>;

void add(const Vec4d& r, const Mat<double, 4, 6>& J, int rows, double weight, System& H, Vector& g) {
  const Eigen::Map<const Eigen::Matrix<double, 4, 6>> Jm(J.data());
  const Eigen::Map<const Eigen::Vector4d> rm(r.data());
  H.noalias() += weight * Jm.topRows(rows).transpose() * Jm.topRows(rows);
  g.noalias() += weight * Jm.topRows(rows).transpose() * rm.head(rows);
}

// One weighted Gauss–Newton step; false where the system is singular.
bool step(std::span<const PointSighting> sightings, const StereoRigd& rig, double scale, Pose3d& T) {
  System H = System::Zero();
  Vector g = Vector::Zero();
  Vec4d r;
  Mat<double, 4, 6> J;
  for (const PointSighting& s : sightings) {
    const int rows = project(s, rig, T, r, &J);
    if (rows == 0) continue;
    const double e = error_of(r, rows) / scale;
    add(r, J, rows, 1.0 / (1.0 + e * e), H, g);
  }
  const Eigen::LDLT<System> factor(H);
  if (factor.info() != Eigen::Success || !(factor.vectorD().minCoeff() > 1e-9 * factor.vectorD().maxCoeff()))
    return false;
  const Vector d = factor.solve(-g);
  if (!d.allFinite()) return false;
  Vec6d delta;
  for (int i = 0; i < 6; ++i) delta[i] = d[i];
  T = T.plus(delta);
  return true;
}

}  // namespace

double error_at(const PointSighting& s, const StereoRigd& rig, const Pose3d& T) {
  Vec4d r;
  const int rows = project(s, rig, T, r, nullptr);
  return rows > 0 ? error_of(r, rows) : HUGE_VAL;
}

double median_error(std::span<const PointSighting> sightings, const StereoRigd& rig, const Pose3d& T,
                    std::vector<double>& scratch) {
  scratch.clear();
  Vec4d r;
  for (const PointSighting& s : sightings)
    if (const int rows = project(s, rig, T, r, nullptr); rows > 0) scratch.push_back(error_of(r, rows));
  if (scratch.empty()) return HUGE_VAL;
  const auto middle = scratch.begin() + static_cast<std::ptrdiff_t>(scratch.size() / 2);
  std::nth_element(scratch.begin(), middle, scratch.end());
  return *middle;
}

RefinePoseReport refine_pose(std::span<const PointSighting> sightings, const StereoRigd& rig,
                             const RefinePoseOptions& options, Pose3d& T_world_body, std::vector<double>& errors) {
  RefinePoseReport report;
  Pose3d T = T_world_body;
  double median = report.median_before = median_error(sightings, rig, T, errors);
  for (int k = 0; k < options.max_iterations && std::isfinite(median); ++k) {
    report.solved = step(sightings, rig, std::max(options.least_scale, median), T);
    if (!report.solved) break;
    median = median_error(sightings, rig, T, errors);
  }
  report.median_after = median;
  report.valid = static_cast<int>(errors.size());
  for (const double e : errors) report.inliers += e <= options.inlier_pixels ? 1 : 0;
  if (report.solved && median < report.median_before) T_world_body = T;
  return report;
}

}  // namespace oriel
