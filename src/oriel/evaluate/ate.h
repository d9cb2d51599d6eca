// Absolute trajectory error: how far the estimate lies from the truth, after one alignment of the whole.
// Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems", IROS 2012, eq. 2.
#pragma once
#include <span>
#include <vector>

#include "oriel/base/matrix.h"
#include "oriel/base/result.h"
#include "oriel/evaluate/align.h"
#include "oriel/evaluate/associate.h"

namespace oriel {

// Of a list of errors, all 0 or more.
struct ErrorStatistics {
  std::size_t count = 0;
  double rmse = 0, mean = 0, median = 0, max = 0;
};
ErrorStatistics statistics_of(std::vector<double> errors);

struct AbsoluteError {
  Similarity alignment;         // p_truth ≈ alignment(p_estimate)
  ErrorStatistics position;     // [m]
  ErrorStatistics orientation;  // [deg], angle of R_truthᵀ·R_align·R_estimate
};

Result<AbsoluteError> absolute_error(const std::vector<TumPose>& estimate, const std::vector<TumPose>& truth,
                                     const std::vector<PosePair>& pairs, Alignment alignment);

Mat3d rotation_of(const TumPose& pose);
double rotation_angle(const Mat3d& R);  // [rad], 0 to π

// The way from the first pose to the last [m].
double path_length(std::span<const TumPose> poses);

}  // namespace oriel
