#include "oriel/testing/pose_spline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

namespace oriel {
namespace {

constexpr int kPoints = PoseSpline::kDegree + 1;
using Weights = std::array<double, kPoints>;

// Values of the uniform basis functions of a degree at u in [0, 1] of a piece, the oldest point's first; 0 beyond.
// De Boor, "A practical guide to splines", 1978, X.(9) with knots one apart.
Weights basis(int degree, double u) {
  Weights b{};
  b[0] = 1.0;
  for (int p = 1; p <= degree; ++p) {
    double saved = 0.0;
    for (int r = 0; r < p; ++r) {
      const double share = b[static_cast<std::size_t>(r)] / p;
      b[static_cast<std::size_t>(r)] = saved + (r + 1 - u) * share;
      saved = (u + p - r - 1) * share;
    }
    b[static_cast<std::size_t>(p)] = saved;
  }
  return b;
}

// Derivatives by u of the basis one degree up: B'_j = b_{j-1} - b_j.
Weights raised(const Weights& b) {
  Weights d{};
  for (std::size_t j = 0; j < kPoints; ++j) d[j] = (j > 0 ? b[j - 1] : 0.0) - b[j];
  return d;
}

Weights cumulative(Weights b) {
  for (std::size_t j = kPoints - 1; j-- > 0;) b[j] += b[j + 1];
  return b;
}

Pose3d between(const StampedPose& a, const StampedPose& b, double seconds_after_a) {
  const double u = seconds_after_a / (b.time - a.time).seconds();
  const Vec3d turn = b.T_world_body.R.minus(a.T_world_body.R);
  return {a.T_world_body.R.plus(turn * u), a.T_world_body.t + (b.T_world_body.t - a.T_world_body.t) * u};
}

Result<void> check_poses(std::span<const StampedPose> poses, double spacing) {
  if (!(spacing > 0.0) || !std::isfinite(spacing))
    return Error{ErrorCode::bad_input, "spline: expected a spacing > 0 s, found " + std::to_string(spacing)};
  for (std::size_t k = 1; k < poses.size(); ++k)
    if (poses[k].time <= poses[k - 1].time)
      return Error{ErrorCode::bad_input, "spline: expected rising stamps, pose " + std::to_string(k) + " at " +
                                             std::to_string(poses[k].time.ns) + " ns is not later than the one before"};
  const double seconds = poses.empty() ? 0.0 : (poses.back().time - poses.front().time).seconds();
  if (!(seconds >= spacing * PoseSpline::kDegree))
    return Error{ErrorCode::bad_input, "spline: expected poses over " + std::to_string(spacing * PoseSpline::kDegree) +
                                           " s or more, found " + std::to_string(seconds) + " s"};
  return {};
}

}  // namespace

Result<PoseSpline> PoseSpline::through(std::span<const StampedPose> poses, double spacing) {
  if (auto ok = check_poses(poses, spacing); !ok) return ok.error();
  const Time first = poses.front().time;
  const auto count = static_cast<std::size_t>((poses.back().time - first).seconds() / spacing) + 1;
  std::vector<Pose3d> control;
  control.reserve(count);
  std::size_t next = 1;
  for (std::size_t k = 0; k < count; ++k) {
    const double t = spacing * static_cast<double>(k);
    while (next + 1 < poses.size() && (poses[next].time - first).seconds() < t) ++next;
    control.push_back(between(poses[next - 1], poses[next], t - (poses[next - 1].time - first).seconds()));
  }
  return PoseSpline(std::move(control), spacing);
}

PathState PoseSpline::at(double t) const {
  const bool outside = !(t >= 0.0 && t <= duration());
  const double x = std::clamp(t, 0.0, duration()) / spacing_;
  const std::size_t first = std::min(static_cast<std::size_t>(x), control_.size() - kPoints);
  const double u = x - static_cast<double>(first);
  const Weights b = basis(kDegree, u), b1 = raised(basis(kDegree - 1, u)), b2 = raised(raised(basis(kDegree - 2, u)));
  const double rate = outside ? 0.0 : 1.0 / spacing_;

  PathState s;
  const Pose3d* c = &control_[first];
  for (std::size_t j = 0; j < kPoints; ++j) {
    s.T_world_body.t += c[j].t * b[j];
    s.v_world += c[j].t * (b1[j] * rate);
    s.a_world += c[j].t * (b2[j] * rate * rate);
  }
  const Weights l = cumulative(b), l1 = cumulative(b1), l2 = cumulative(b2);
  s.T_world_body.R = c[0].R;
  for (std::size_t j = 1; j < kPoints; ++j) {
    const Vec3d d = c[j].R.minus(c[j - 1].R);
    const Rot3d A = Rot3d::exp(d * l[j]), back = A.inverse();
    s.T_world_body.R = s.T_world_body.R * A;
    const Vec3d turned = back * s.rate_body;
    s.acceleration_body = back * s.acceleration_body + cross(turned, d) * (l1[j] * rate) + d * (l2[j] * rate * rate);
    s.rate_body = turned + d * (l1[j] * rate);
  }
  s.T_world_body.R = s.T_world_body.R.normalized();
  return s;
}

}  // namespace oriel
