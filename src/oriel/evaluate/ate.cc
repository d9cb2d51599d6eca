#include "oriel/evaluate/ate.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace oriel {

ErrorStatistics statistics_of(std::vector<double> errors) {
  ErrorStatistics s;
  s.count = errors.size();
  if (errors.empty()) return s;
  std::sort(errors.begin(), errors.end());
  double sum = 0, squares = 0;
  for (double e : errors) sum += e, squares += e * e;
  const auto n = static_cast<double>(errors.size());
  s.mean = sum / n;
  s.rmse = std::sqrt(squares / n);
  s.max = errors.back();
  const std::size_t middle = errors.size() / 2;
  s.median = errors.size() % 2 == 1 ? errors[middle] : 0.5 * (errors[middle - 1] + errors[middle]);
  return s;
}

Mat3d rotation_of(const TumPose& pose) {
  const double x = pose.qx, y = pose.qy, z = pose.qz, w = pose.qw;
  Mat3d R;
  R(0, 0) = 1 - 2 * (y * y + z * z), R(0, 1) = 2 * (x * y - z * w), R(0, 2) = 2 * (x * z + y * w);
  R(1, 0) = 2 * (x * y + z * w), R(1, 1) = 1 - 2 * (x * x + z * z), R(1, 2) = 2 * (y * z - x * w);
  R(2, 0) = 2 * (x * z - y * w), R(2, 1) = 2 * (y * z + x * w), R(2, 2) = 1 - 2 * (x * x + y * y);
  return R;
}

double rotation_angle(const Mat3d& R) {
  // atan2 of sine and cosine: the arc cosine of the trace alone loses half the digits near 0 and π.
  const double sine = 0.5 * Vec3d{R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1)}.norm();
  return std::atan2(sine, 0.5 * (R(0, 0) + R(1, 1) + R(2, 2) - 1));
}

double path_length(std::span<const TumPose> poses) {
  double length = 0;
  for (std::size_t i = 1; i < poses.size(); ++i) length += (poses[i].p - poses[i - 1].p).norm();
  return length;
}

Result<AbsoluteError> absolute_error(const std::vector<TumPose>& estimate, const std::vector<TumPose>& truth,
                                     const std::vector<PosePair>& pairs, Alignment alignment) {
  std::vector<Vec3d> e, g;
  for (const PosePair& pair : pairs) {
    e.push_back(estimate[pair.estimate].p);
    g.push_back(truth[pair.truth].p);
  }
  const Result<Similarity> T = align(e, g, alignment);
  if (!T) return T.error();
  std::vector<double> position, orientation;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    position.push_back(((*T)(e[i]) - g[i]).norm());
    const Mat3d R = rotation_of(truth[pairs[i].truth]).transposed() * T->R * rotation_of(estimate[pairs[i].estimate]);
    orientation.push_back(rotation_angle(R) * 180 / std::numbers::pi);
  }
  return AbsoluteError{*T, statistics_of(std::move(position)), statistics_of(std::move(orientation))};
}

}  // namespace oriel
