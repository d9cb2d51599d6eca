// When to look for an answer instead of sleeping: a core that sleeps is 30 to 130 us late, one that looks works for
// nothing, and takes from the other thread of its core where there is one.
#pragma once
#include <algorithm>
#include <array>

#include "oriel/base/time.h"

namespace oriel {

// Of a wait: it sleeps for `after`, then looks for so long, then sleeps again.
struct Look {
  Duration after{0}, time{0};

  // The same in a wait that ends after so long.
  Look within(Duration limit) const {
    const Duration sleeps = std::min(after, limit);
    return {sleeps, std::min(time, limit - sleeps)};
  }
};

// From how long the last answers took: the next is looked for from shortly before the quickest of them would be there.
// Where answers take now this long and now that, by more than one looks for, those that are late are slept for; and
// those that come at once (decision 18 says what was seen of them).
class UsualTime {
 public:
  // Only of answers that were waited for: when others came nobody saw.
  void took(Duration time) { last_[count_++ % last_.size()] = time; }
  // For a wait that begins so long after the question.
  Look look(Duration so_far, Duration time) const {
    if (count_ == 0) return {};
    const auto known = last_.begin() + static_cast<std::ptrdiff_t>(std::min(count_, last_.size()));
    const Duration quickest = *std::min_element(last_.begin(), known);
    if (quickest < kLate + kLate) return {};
    const Duration after = quickest - Duration{quickest.ns / 8} - kLate - so_far;
    return {std::max(after, Duration{}), time};
  }

 private:
  static constexpr Duration kLate{100'000};  // that a sleep ends after its time
  std::array<Duration, 8> last_{};
  std::size_t count_ = 0;
};

}  // namespace oriel
