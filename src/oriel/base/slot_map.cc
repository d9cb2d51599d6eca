#include "oriel/base/slot_map.h"

#include <algorithm>

namespace oriel {

std::uint32_t SlotIndex::first_after(std::uint64_t serial) const {
  return static_cast<std::uint32_t>(std::upper_bound(serial_.begin(), serial_.end(), serial) - serial_.begin());
}

SlotKey SlotIndex::lend() {
  while (!free_.empty()) {
    const SlotKey k = free_.back();
    free_.pop_back();
    if (k.index >= slots_.size()) continue;
    Slot& s = slots_[k.index];
    // A slot may have been filled since, under an id that came from elsewhere.
    if (s.dense != kNone || k.generation <= s.generation || k.generation <= s.lent) continue;
    s.lent = k.generation;
    return k;
  }
  slots_.resize(next_ + 1);
  slots_[next_].lent = 1;
  return {next_++, 1};
}

void SlotIndex::claim(SlotKey k) {
  if (k.index >= slots_.size()) slots_.resize(k.index + 1);
  next_ = static_cast<std::uint32_t>(slots_.size());
  if (slots_[k.index].lent < k.generation) slots_[k.index].lent = k.generation;
}

void SlotIndex::give_back(SlotKey k) {
  if (!is_placeholder(k)) free_.push_back({k.index, k.generation + 1});
}

std::uint32_t SlotIndex::insert(SlotKey k, std::uint64_t serial) {
  check(is_new(k, kNone) && find_slot(k.index) == kNone, "a slot key is inserted twice");
  if (k.index >= slots_.size()) slots_.resize(k.index + 1);
  next_ = static_cast<std::uint32_t>(slots_.size());
  const std::uint32_t d = extent();
  slots_[k.index].dense = d;
  slots_[k.index].generation = k.generation;
  slot_of_.push_back(k.index);
  serial_.push_back(serial);
  last_serial_ = serial;
  ++live_;
  return d;
}

bool SlotIndex::erase(SlotKey k) {
  const std::uint32_t d = find(k);
  if (d == kNone) return false;
  slot_of_[d] = kNone;
  changes_.note(d);
  Slot& s = slots_[k.index];
  s.dense = kNone;
  free_.push_back({k.index, (s.lent > s.generation ? s.lent : s.generation) + 1});
  if (free_.size() > 2 * slots_.size() + 64) forget_used_up();
  --live_;
  return true;
}

void SlotIndex::reserve(std::uint32_t more) {
  reserve_more(slots_, more);
  reserve_more(slot_of_, more);
  reserve_more(serial_, more);
  reserve_more(free_, std::size_t{live_} + more);
}

// A follower never lends, so that what could be lent piles up: all but the latest key of each slot is used up.
void SlotIndex::forget_used_up() {
  std::erase_if(free_,
                [this](SlotKey k) { return k.index >= slots_.size() || k.generation <= slots_[k.index].generation; });
}

void SlotIndex::truncate(std::uint32_t extent) {
  changes_.note(extent);  // what comes next stands where a hole was
  slot_of_.resize(extent);
  serial_.resize(extent);
}

}  // namespace oriel
