#include "oriel/graph/change_log.h"

namespace oriel {

Subscription ChangeLog::subscribe() {
  for (std::uint32_t i = 0; i < seen_.size(); ++i)
    if (seen_[i] == kNobody) {
      seen_[i] = 0;
      return {i};
    }
  seen_.push_back(0);
  return {static_cast<std::uint32_t>(seen_.size() - 1)};
}

void ChangeLog::mark_seen(Subscription s, std::uint64_t version) {
  seen_[s.number] = version;
  const std::uint64_t least = least_seen();
  std::erase_if(removals_, [least](const Removal& r) { return r.removed <= least; });
  std::erase_if(changes_, [least](const Change& c) { return c.version <= least; });
  std::erase_if(loss_changes_, [least](const LossChange& c) { return c.version <= least; });
}

void ChangeLog::note(const Removal& r) {
  if (least_seen() != kNobody) removals_.push_back(r);
}
void ChangeLog::note(const Change& c) {
  if (least_seen() != kNobody) changes_.push_back(c);
}
void ChangeLog::note(const LossChange& c) {
  if (least_seen() != kNobody) loss_changes_.push_back(c);
}

std::uint64_t ChangeLog::least_seen() const {
  std::uint64_t least = kNobody;
  for (std::uint64_t s : seen_) least = s < least ? s : least;
  return least;
}

}  // namespace oriel
