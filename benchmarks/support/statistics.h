// Order statistics of samples.
#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

namespace oriel::benchmark {

// The smallest sample that at least share q of all samples do not exceed (nearest rank); NaN where there is none.
inline double quantile(std::vector<double> samples, double q) {
  if (samples.empty()) return std::nan("");
  const auto rank = static_cast<std::ptrdiff_t>(std::ceil(q * static_cast<double>(samples.size()))) - 1;
  const auto at = samples.begin() + std::clamp<std::ptrdiff_t>(rank, 0, std::ssize(samples) - 1);
  std::nth_element(samples.begin(), at, samples.end());
  return *at;
}
inline double median(const std::vector<double>& samples) { return quantile(samples, 0.5); }

}  // namespace oriel::benchmark
