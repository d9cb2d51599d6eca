#include "oriel/window/conditional_store.h"

#include <algorithm>
#include <cstring>

#include "oriel/graph/graph_edit.h"

namespace oriel {
namespace {

constexpr std::size_t kForgottenIds = 1024;  // so many are told apart from ids that never were

bool before(const VariableKey& a, const VariableKey& b) {
  if (a.type != b.type) return a.type < b.type;
  if (a.key.index != b.key.index) return a.key.index < b.key.index;
  return a.key.generation < b.key.generation;
}

}  // namespace

void Conditional::clear() {
  variables.clear();
  estimates.clear();
  numbers.clear();
  leaving = rows = cols = 0;
}

// Values begin at 16 bytes' alignment, as in a pool.
void Conditional::add(VariableKey id, const VariableOps& ops, const void* estimate, int column) {
  const std::size_t at = (estimates.size() + 1) / 2 * 2;
  estimates.resize(at + estimate_doubles(ops), 0.0);
  std::memcpy(estimates.data() + at, estimate, ops.bytes);
  variables.push_back({id, &ops, column, at});
}

std::int32_t ConditionalStore::acquire(int capacity) {
  if (pool_.empty()) {
    pool_.resize(static_cast<std::size_t>(capacity) + 2);
    for (std::size_t i = pool_.size(); i-- > 0;) free_conditionals_.push_back(static_cast<std::int32_t>(i));
  }
  if (free_conditionals_.empty()) {
    free_conditionals_.push_back(static_cast<std::int32_t>(pool_.size()));
    pool_.emplace_back();
  }
  const std::int32_t c = free_conditionals_.back();
  free_conditionals_.pop_back();
  at(c).clear();
  return c;
}

void ConditionalStore::release(std::int32_t conditional) {
  if (conditional >= 0) free_conditionals_.push_back(conditional);
}

// A larger one than ever: all are given the room, so that each size is asked for once and not by every block in turn.
void ConditionalStore::make_room(const Conditional& c) {
  if (c.variables.size() <= room_variables_ && c.estimates.size() <= room_estimates_ &&
      c.numbers.size() <= room_numbers_)
    return;
  auto grow = [](std::size_t& room, std::size_t wanted) {
    if (wanted > room) room = wanted + wanted / 4;
  };
  grow(room_variables_, c.variables.size());
  grow(room_estimates_, c.estimates.size());
  grow(room_numbers_, c.numbers.size());
  for (Conditional& each : pool_) {
    each.variables.reserve(room_variables_);
    each.estimates.reserve(room_estimates_);
    each.numbers.reserve(room_numbers_);
  }
  entries_.reserve(pool_.size());
  free_entries_.reserve(pool_.size());
  free_conditionals_.reserve(2 * pool_.size());
  places_.reserve(pool_.size() * room_variables_);
  forgotten_.reserve(kForgottenIds);
}

void ConditionalStore::add(std::int64_t order, std::int32_t conditional) {
  make_room(at(conditional));
  if (free_entries_.empty()) {
    free_entries_.push_back(static_cast<std::int32_t>(entries_.size()));
    entries_.emplace_back();
  }
  const std::int32_t e = free_entries_.back();
  free_entries_.pop_back();
  entries_[static_cast<std::size_t>(e)] = {order, {}, conditional, -1, true, true};
  ++used_;
  const Conditional& c = at(conditional);
  for (std::int32_t i = 0; i < c.leaving; ++i) {
    const Place p{c.variables[static_cast<std::size_t>(i)].id, e, i};
    places_.insert(std::lower_bound(places_.begin(), places_.end(), p,
                                    [](const Place& a, const Place& b) { return before(a.id, b.id); }),
                   p);
  }
}

void ConditionalStore::update(std::int32_t entry, std::int32_t conditional) {
  make_room(at(conditional));
  Entry& e = entries_[static_cast<std::size_t>(entry)];
  release(e.next);
  e.next = conditional;
}

void ConditionalStore::erase(std::int32_t entry, bool remember) {
  Entry& e = entries_[static_cast<std::size_t>(entry)];
  const Conditional& c = at(e.now);
  for (std::int32_t i = 0; i < c.leaving; ++i) {
    const VariableKey id = c.variables[static_cast<std::size_t>(i)].id;
    places_.erase(places_.begin() + (find(id) - places_.data()));
    if (!remember) continue;
    if (forgotten_.size() < kForgottenIds)
      forgotten_.push_back(id);
    else
      forgotten_[forgotten_at_++ % kForgottenIds] = id;
  }
  release(e.now);
  release(e.next);
  e = {};
  free_entries_.push_back(entry);
  --used_;
}

void ConditionalStore::commit(Time stamp, int capacity, Duration horizon) {
  for (Entry& e : entries_) {
    if (e.fresh) e.stamp = stamp;
    e.fresh = false;
    if (e.next < 0) continue;
    release(e.now);
    e.now = e.next;
    e.next = -1;
  }
  forget(capacity, horizon);
}

void ConditionalStore::forget(int capacity, Duration horizon) {
  while (used_ > 0) {
    std::int32_t oldest = -1;
    Time newest{INT64_MIN};
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      const Entry& e = entries_[i];
      if (!e.used) continue;
      newest = std::max(newest, e.stamp);
      const Entry* o = oldest < 0 ? nullptr : &entries_[static_cast<std::size_t>(oldest)];
      if (o == nullptr || e.stamp < o->stamp || (e.stamp == o->stamp && e.order < o->order))
        oldest = static_cast<std::int32_t>(i);
    }
    const bool late = horizon.ns > 0 && newest - entries_[static_cast<std::size_t>(oldest)].stamp > horizon;
    if (!late && used_ <= static_cast<std::size_t>(std::max(capacity, 0))) return;
    erase(oldest, true);
  }
}

void ConditionalStore::discard() {
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    Entry& e = entries_[i];
    if (!e.used) continue;
    if (e.fresh) {
      erase(static_cast<std::int32_t>(i), false);
      continue;
    }
    release(e.next);
    e.next = -1;
  }
}

void ConditionalStore::clear() {
  for (std::size_t i = 0; i < entries_.size(); ++i)
    if (entries_[i].used) erase(static_cast<std::int32_t>(i), false);
  forgotten_.clear();
  forgotten_at_ = 0;
}

const ConditionalStore::Place* ConditionalStore::find(VariableKey id) const {
  const auto at = std::lower_bound(places_.begin(), places_.end(), id,
                                   [](const Place& p, const VariableKey& k) { return before(p.id, k); });
  return at != places_.end() && at->id == id ? &*at : nullptr;
}

VariableKey ConditionalStore::find(Time stamp, std::uint64_t type) const {
  for (const Entry& e : entries_) {
    if (!e.used || e.fresh || e.stamp != stamp) continue;
    const Conditional& c = pool_[static_cast<std::size_t>(e.now)];
    for (int i = 0; i < c.leaving; ++i)
      if (c.variables[static_cast<std::size_t>(i)].id.type == type) return c.variables[static_cast<std::size_t>(i)].id;
  }
  return {};
}

const Conditional& ConditionalStore::latest(std::int32_t entry) const {
  const Entry& e = entries_[static_cast<std::size_t>(entry)];
  return pool_[static_cast<std::size_t>(e.next >= 0 ? e.next : e.now)];
}

bool ConditionalStore::was_forgotten(VariableKey id) const {
  return std::find(forgotten_.begin(), forgotten_.end(), id) != forgotten_.end();
}

}  // namespace oriel
