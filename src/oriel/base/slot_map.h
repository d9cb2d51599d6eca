// Slot map: dense values found by keys of index + generation (behaviours V1, V2).
//
// A key that was erased never resolves again: the next value in its slot has a higher generation. Dense positions are
// in the order of insertion, which is the order of serials; an erased value leaves a hole, and when more than a quarter
// are holes the rest moves together, in order (no swap with the last: the order is what makes two runs alike).
#pragma once
#include <cstdint>
#include <utility>
#include <vector>

#include "oriel/base/change_mark.h"
#include "oriel/base/check.h"

namespace oriel {

struct SlotKey {
  std::uint32_t index = 0;
  std::uint32_t generation = 0;  // live ones begin at 1
  friend bool operator==(const SlotKey&, const SlotKey&) = default;
};

// Stands for a key that the owner of a pool has not given yet: the n-th of the things that come together. It resolves
// to nothing anywhere.
constexpr std::uint32_t kFirstPlaceholder = 0x80000000u;
constexpr SlotKey placeholder_key(std::uint32_t n) { return {kFirstPlaceholder | n, 0}; }
constexpr bool is_placeholder(SlotKey k) {
  return k.generation == 0 && k.index >= kFirstPlaceholder && k.index != 0xffffffffu;
}
constexpr std::uint32_t placeholder_number(SlotKey k) { return k.index & ~kFirstPlaceholder; }

// Room for `more` elements beyond the present ones. std::vector::reserve takes exactly what it is asked for, so that
// growing one by one would copy everything each time.
template <class Vector>
void reserve_more(Vector& v, std::size_t more) {
  const std::size_t wanted = v.size() + more;
  if (wanted > v.capacity()) v.reserve(wanted > 2 * v.capacity() ? wanted : 2 * v.capacity());
}

// The keys alone; whoever owns values keeps them in columns beside it. What is asked in loops is inline; what changes
// the keys is in the library, for the sake of compile time.
class SlotIndex {
 public:
  static constexpr std::uint32_t kNone = 0xffffffffu;

  std::uint32_t size() const { return live_; }
  // Dense positions in use, holes included: the length of the columns.
  std::uint32_t extent() const { return static_cast<std::uint32_t>(slot_of_.size()); }
  bool is_live(std::uint32_t dense) const { return slot_of_[dense] != kNone; }
  std::uint64_t serial(std::uint32_t dense) const { return serial_[dense]; }
  std::uint64_t last_serial() const { return last_serial_; }
  SlotKey key(std::uint32_t dense) const { return {slot_of_[dense], slots_[slot_of_[dense]].generation}; }

  // Dense position of a live key, else kNone.
  std::uint32_t find(SlotKey k) const {
    if (k.index >= slots_.size()) return kNone;
    const Slot& s = slots_[k.index];
    return s.generation == k.generation ? s.dense : kNone;
  }
  // The latest key of a slot, live or dead; generation 0 if it was never used.
  SlotKey key_of_slot(std::uint32_t index) const {
    return {index, index < slots_.size() ? slots_[index].generation : 0};
  }
  // Dense position of whatever key lives in a slot, else kNone.
  std::uint32_t find_slot(std::uint32_t index) const { return index < slots_.size() ? slots_[index].dense : kNone; }
  // Dense position of a slot that is known to be live.
  std::uint32_t dense(std::uint32_t index) const { return slots_[index].dense; }

  // A key that nobody has had. It resolves to nothing until it is inserted.
  SlotKey lend();
  // A key that was given elsewhere is about to be inserted: it is not lent until then.
  void claim(SlotKey k);
  // Back from an edit that will not be applied; its generation is spent.
  void give_back(SlotKey k);

  // Slots that were ever in use: the index of every live key is below.
  std::uint32_t slot_count() const { return static_cast<std::uint32_t>(slots_.size()); }

  // True for a key that nobody has had. Of `incoming` keys that arrive together, none may be farther out than honest
  // ones can be: a damaged message must not ask for all memory.
  bool is_new(SlotKey k, std::size_t incoming = 0) const {
    if (k.generation == 0 || k.index == kNone) return false;
    if (k.index >= slots_.size()) return k.index < slots_.size() + kLargestLeap + incoming;
    return k.generation > slots_[k.index].generation;
  }
  // True if `insert` of this key will succeed as things stand.
  bool can_insert(SlotKey k, std::size_t incoming = 0) const {
    return is_new(k, incoming) && find_slot(k.index) == kNone;
  }
  // Appends; the dense position of the new value. Serials rise.
  std::uint32_t insert(SlotKey k, std::uint64_t serial);
  // False for a key that does not resolve.
  bool erase(SlotKey k);

  // The first dense position behind a serial, which need not be there.
  std::uint32_t first_after(std::uint64_t serial) const;
  // Since when the columns' beginning stands as it does: what stands below changes().same_since(then) has had its place
  // and its key since, what stood there. What comes is behind the extent of then, and is not noted.
  const ChangeMark& changes() const { return changes_; }
  // Another column's change, that whoever follows has to hear of.
  void note_change(std::uint32_t dense) { changes_.note(dense); }

  bool wants_compaction() const { return (extent() - live_) * 4 > extent(); }
  // Closes the holes in order: move(from, to) for each value that changes its place, then resize(live).
  template <class Move, class Resize>
  void compact(Move&& move, Resize&& resize) {
    std::uint32_t to = 0, first_moved = kNone;
    for (std::uint32_t from = 0; from < extent(); ++from) {
      if (!is_live(from)) continue;
      if (from != to) {
        if (to < first_moved) changes_.note(first_moved = to);
        slot_of_[to] = slot_of_[from];
        serial_[to] = serial_[from];
        slots_[slot_of_[to]].dense = to;
        move(from, to);
      }
      ++to;
    }
    truncate(to);
    resize(to);
  }
  void reserve(std::uint32_t more);

 private:
  void forget_used_up();

  void truncate(std::uint32_t extent);

  static constexpr std::size_t kLargestLeap = std::size_t{1} << 24;
  struct Slot {
    std::uint32_t dense = kNone;
    std::uint32_t generation = 0;  // of the latest value
    std::uint32_t lent = 0;        // the highest generation that was lent
  };
  std::vector<Slot> slots_;
  std::vector<std::uint32_t> slot_of_;  // by dense position; kNone: a hole
  std::vector<std::uint64_t> serial_;
  std::vector<SlotKey> free_;
  std::uint64_t last_serial_ = 0;
  std::uint32_t live_ = 0, next_ = 0;
  ChangeMark changes_;
};

// Keys and values of one type.
template <class T>
class SlotMap {
 public:
  SlotKey add(T value) {
    const SlotKey k = index_.lend();
    index_.insert(k, index_.last_serial() + 1);
    values_.push_back(std::move(value));
    return k;
  }
  bool erase(SlotKey k) {
    if (!index_.erase(k)) return false;
    if (index_.wants_compaction())
      index_.compact([this](auto from, auto to) { values_[to] = std::move(values_[from]); },
                     [this](auto n) { values_.erase(values_.begin() + n, values_.end()); });
    return true;
  }
  // Every key is dead afterwards, also when its slot is used again.
  void clear() {
    for (std::uint32_t d = 0; d < index_.extent(); ++d)
      if (index_.is_live(d)) index_.erase(index_.key(d));
    if (index_.extent() > 0) index_.compact([](auto, auto) {}, [this](auto) { values_.clear(); });
  }
  T* find(SlotKey k) {
    const std::uint32_t d = index_.find(k);
    return d == SlotIndex::kNone ? nullptr : &values_[d];
  }
  const T* find(SlotKey k) const { return const_cast<SlotMap*>(this)->find(k); }
  T& operator[](SlotKey k) {
    T* v = find(k);
    check(v != nullptr, "SlotMap: a key that does not resolve");
    return *v;
  }
  std::size_t size() const { return index_.size(); }
  std::size_t extent() const { return index_.extent(); }
  // In the order of insertion: f(key, value).
  template <class F>
  void for_each(F&& f) const {
    for (std::uint32_t d = 0; d < index_.extent(); ++d)
      if (index_.is_live(d)) f(index_.key(d), values_[d]);
  }

 private:
  SlotIndex index_;
  std::vector<T> values_;
};

}  // namespace oriel
