// Percentiles of samples.
#pragma once
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

namespace oriel {

// By nearest rank: the least of the rising `sorted` that at least `share` (from 0 to 1) of them do not exceed. NaN of
// none.
inline double percentile(std::span<const double> sorted, double share) {
  if (sorted.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(sorted.size())));
  return sorted[std::clamp<std::size_t>(rank, 1, sorted.size()) - 1];
}

}  // namespace oriel
