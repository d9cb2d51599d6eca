#include "oriel/window/imu_buffer.h"

#include <string>

#include "oriel/base/finite.h"

namespace oriel {
namespace {

bool earlier(const ImuSample& s, Time t) { return s.time < t; }

}  // namespace

Result<void> ImuBuffer::add(const ImuSample& sample) {
  if (!all_finite(sample.gyro) || !all_finite(sample.accel))
    return Error{ErrorCode::not_finite,
                 "IMU sample at " + std::to_string(sample.time.ns) + " ns: a reading is not finite"};
  if (samples_.size() > first_ && sample.time <= samples_.back().time)
    return Error{ErrorCode::bad_input, "IMU sample at " + std::to_string(sample.time.ns) +
                                           " ns: expected a stamp after " + std::to_string(samples_.back().time.ns) +
                                           " ns"};
  samples_.push_back(sample);
  return {};
}

std::span<const ImuSample> ImuBuffer::between(Time from, Time to) const {
  const auto all = samples();
  auto first = std::lower_bound(all.begin(), all.end(), from, earlier);
  auto last = std::lower_bound(first, all.end(), to, earlier);
  if (first != all.begin()) --first;
  if (last != all.end()) ++last;
  return {first, last};
}

void ImuBuffer::forget_before(Time time) {
  const auto all = samples();
  const auto first = std::lower_bound(all.begin(), all.end(), time, earlier);
  if (first - all.begin() <= 1) return;
  first_ += static_cast<std::size_t>(first - all.begin()) - 1;
  if (2 * first_ < samples_.size()) return;
  samples_.erase(samples_.begin(), samples_.begin() + static_cast<std::ptrdiff_t>(first_));
  first_ = 0;
}

}  // namespace oriel
