// The IMU samples that the window may still need: from the newest keyframe on.
#pragma once
#include <algorithm>
#include <span>
#include <vector>

#include "oriel/base/result.h"
#include "oriel/sensor/imu.h"

namespace oriel {

class ImuBuffer {
 public:
  void reserve(std::size_t samples) { samples_.reserve(samples); }
  // A sample that is not finite, or not later than the one before, is refused and leaves the buffer as it was.
  Result<void> add(const ImuSample& sample);

  std::span<const ImuSample> samples() const { return {samples_.data() + first_, samples_.size() - first_}; }
  // Samples from `from` to `to`, and the neighbours that interpolation at both ends needs.
  std::span<const ImuSample> between(Time from, Time to) const;
  // Forgets what lies before `time`, but for the last sample before it.
  void forget_before(Time time);
  void clear() {
    samples_.clear();
    first_ = 0;
  }

 private:
  std::vector<ImuSample> samples_;
  std::size_t first_ = 0;  // what is older was forgotten; moved away when it is most of the vector
};

}  // namespace oriel
