// Relative pose error: drift over a fixed way or time, whatever came before. Sturm et al., IROS 2012, eq. 1:
// E_i = (Q_i⁻¹·Q_j)⁻¹·(P_i⁻¹·P_j) with truth Q, estimate P, and j the first pair that is `delta` or more after i.
#pragma once
#include <vector>

#include "oriel/evaluate/ate.h"

namespace oriel {

struct RelativeError {
  ErrorStatistics position;     // [m] over the delta
  ErrorStatistics orientation;  // [deg] over the delta
};

// No alignment is needed; `scale` multiplies the estimate's positions (for sim3). No pair of pairs: counts are 0.
RelativeError relative_error_over_distance(const std::vector<TumPose>& estimate, const std::vector<TumPose>& truth,
                                           const std::vector<PosePair>& pairs, double delta_m, double scale = 1);
RelativeError relative_error_over_time(const std::vector<TumPose>& estimate, const std::vector<TumPose>& truth,
                                       const std::vector<PosePair>& pairs, Duration delta, double scale = 1);

}  // namespace oriel
