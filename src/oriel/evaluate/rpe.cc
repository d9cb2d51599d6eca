#include "oriel/evaluate/rpe.h"

#include <numbers>
#include <utility>

namespace oriel {
namespace {

struct Motion {
  Mat3d R;
  Vec3d t;
};

// A⁻¹·B
Motion between(const TumPose& a, const TumPose& b, double scale) {
  const Mat3d Ra_t = rotation_of(a).transposed();
  return {Ra_t * rotation_of(b), Ra_t * ((b.p - a.p) * scale)};
}

// `far_enough(i, j)` grows with j, and so does the j of each i with i.
template <class FarEnough>
RelativeError relative_error(const std::vector<TumPose>& estimate, const std::vector<TumPose>& truth,
                             const std::vector<PosePair>& pairs, double scale, FarEnough far_enough) {
  std::vector<double> position, orientation;
  std::size_t j = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (j <= i) j = i + 1;
    while (j < pairs.size() && !far_enough(i, j)) ++j;
    if (j >= pairs.size()) break;
    const Motion Q = between(truth[pairs[i].truth], truth[pairs[j].truth], 1);
    const Motion P = between(estimate[pairs[i].estimate], estimate[pairs[j].estimate], scale);
    position.push_back((P.t - Q.t).norm());  // Q's rotation keeps the length
    orientation.push_back(rotation_angle(Q.R.transposed() * P.R) * 180 / std::numbers::pi);
  }
  return {statistics_of(std::move(position)), statistics_of(std::move(orientation))};
}

}  // namespace

RelativeError relative_error_over_distance(const std::vector<TumPose>& estimate, const std::vector<TumPose>& truth,
                                           const std::vector<PosePair>& pairs, double delta_m, double scale) {
  // Along the truth, all its poses counted.
  std::vector<double> way(truth.size(), 0);
  for (std::size_t k = 1; k < truth.size(); ++k) way[k] = way[k - 1] + (truth[k].p - truth[k - 1].p).norm();
  return relative_error(estimate, truth, pairs, scale, [&](std::size_t i, std::size_t j) {
    return way[pairs[j].truth] - way[pairs[i].truth] >= delta_m;
  });
}

RelativeError relative_error_over_time(const std::vector<TumPose>& estimate, const std::vector<TumPose>& truth,
                                       const std::vector<PosePair>& pairs, Duration delta, double scale) {
  return relative_error(estimate, truth, pairs, scale, [&](std::size_t i, std::size_t j) {
    return truth[pairs[j].truth].time - truth[pairs[i].truth].time >= delta;
  });
}

}  // namespace oriel
