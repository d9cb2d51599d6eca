#include "oriel/graph/change_log.h"

#include <algorithm>
#include <tuple>

#include "oriel/graph/graph.h"

namespace oriel {
namespace {

// Entries stand in the order of their versions.
template <class Entry>
std::span<const Entry> after(const std::vector<Entry>& log, std::uint64_t seen) {
  const auto first = std::partition_point(log.begin(), log.end(), [seen](const Entry& e) { return e.version <= seen; });
  return {first, log.end()};
}

// The version in which a live variable or factor came; 0 if it is gone.
std::uint64_t added_version(const Graph& graph, const VariableKey& id) {
  const VariablePool* pool = graph.find_pool(id.type);
  const std::uint32_t d = pool->slots().find(id.key);
  return d == SlotIndex::kNone ? 0 : pool->versions(d).added;
}
std::uint64_t added_version(const Graph& graph, const FactorId& id) {
  for (const auto& t : graph.tables()) {
    if (t->ops().key != id.table) continue;
    const std::uint32_t row = t->slots().find(id.key);
    return row == SlotIndex::kNone ? 0 : t->added(row);
  }
  return 0;
}

// Is it the latest of its kind?
bool stands(const Graph& graph, const ChangeLog::Change& c) {
  const VariablePool* pool = graph.find_pool(c.id.type);
  const std::uint32_t d = pool->slots().find(c.id.key);
  if (d == SlotIndex::kNone) return false;
  return pool->versions(d).changed_in(c.version);
}

auto identity(const ChangeLog::LossChange& c) { return std::tuple(c.id.table, c.id.key.index, c.id.key.generation); }

}  // namespace

Subscription ChangeLog::subscribe() {
  for (std::uint32_t i = 0; i < places_.size(); ++i)
    if (places_[i].seen == kNobody) {
      places_[i] = {};
      return {i};
    }
  places_.emplace_back();
  return {static_cast<std::uint32_t>(places_.size() - 1)};
}

void ChangeLog::unsubscribe(Subscription s) { mark_seen(s, kNobody); }

// Where all followers have seen everything, as in a steady window, nothing needs to be looked through.
void ChangeLog::mark_seen(Subscription s, std::uint64_t version) {
  places_[s.number] = {version, false, 0};
  std::uint64_t least = kNobody, latest = 0;
  for (const Place& p : places_)
    if (p.seen > 0) least = std::min(least, p.seen);
  if (!removals_.empty()) latest = removals_.back().version;
  if (!changes_.empty()) latest = std::max(latest, changes_.back().version);
  if (!loss_changes_.empty()) latest = std::max(latest, loss_changes_.back().version);
  if (latest > least) return;
  clear();
}

void ChangeLog::leave_all_behind() {
  for (Place& p : places_)
    if (p.seen > 0 && p.seen != kNobody) leave_behind(p);
  clear();
}

void ChangeLog::clear() {
  removals_.clear();
  changes_.clear();
  loss_changes_.clear();
  kept_ = 0;
}

void ChangeLog::leave_behind(Place& place) {
  place = {0, true, 0};
  ++left_behind_;
}

bool ChangeLog::needed(std::uint64_t added, std::uint64_t version) const {
  return std::any_of(places_.begin(), places_.end(), [&](const Place& p) { return p.needs(added, version); });
}

void ChangeLog::note(const Removal& r) {
  if (needed(r.added, r.version)) removals_.push_back(r);
}
void ChangeLog::note(const Change& c, std::uint64_t added) {
  if (needed(added, c.version)) changes_.push_back(c);
}
void ChangeLog::note(const LossChange& c, std::uint64_t added) {
  if (needed(added, c.version)) loss_changes_.push_back(c);
}

std::span<const ChangeLog::Removal> ChangeLog::removals(std::uint64_t seen) const { return after(removals_, seen); }
std::span<const ChangeLog::Change> ChangeLog::changes(std::uint64_t seen) const { return after(changes_, seen); }
std::span<const ChangeLog::LossChange> ChangeLog::loss_changes(std::uint64_t seen) const {
  return after(loss_changes_, seen);
}

// Each look is paid by as many entries that came since the last one.
void ChangeLog::settle(const Graph& graph) {
  if (entries() <= bound_.least) return;
  const std::size_t most = bound_.entries(graph.variable_count() + graph.factor_count());
  const auto followers = static_cast<std::size_t>(
      std::count_if(places_.begin(), places_.end(), [](const Place& p) { return p.seen > 0 && p.seen != kNobody; }));
  if (entries() <= 2 * kept_ && entries() <= 2 * followers * most) return;
  forget_superseded(graph);
  for_each_entry(graph, [this](std::uint64_t added, std::uint64_t version) {
    for (Place& p : places_) p.net += p.needs(added, version);
    return true;
  });
  for (Place& p : places_) {
    if (p.net > most) leave_behind(p);
    p.net = 0;
  }
  for_each_entry(graph, [this](std::uint64_t added, std::uint64_t version) { return needed(added, version); });
  kept_ = entries();
}

// Of things that are there, or were when some follower looked: those stay of which keep(added, version) is true.
template <class Keep>
void ChangeLog::for_each_entry(const Graph& graph, Keep&& keep) {
  std::erase_if(removals_, [&](const Removal& r) { return !keep(r.added, r.version); });
  std::erase_if(changes_, [&](const Change& c) { return !keep(added_version(graph, c.id), c.version); });
  std::erase_if(loss_changes_, [&](const LossChange& c) { return !keep(added_version(graph, c.id), c.version); });
}

// Sorting and uniting happen in place: a steady window asks for no memory.
void ChangeLog::forget_superseded(const Graph& graph) {
  std::erase_if(changes_, [&](const Change& c) { return !stands(graph, c); });
  auto& log = loss_changes_;
  std::erase_if(log, [&](const LossChange& c) { return added_version(graph, c.id) == 0; });
  std::sort(log.begin(), log.end(), [](const LossChange& a, const LossChange& b) {
    return std::tuple(identity(a), b.version) < std::tuple(identity(b), a.version);  // the latest first
  });
  const auto end =
      std::unique(log.begin(), log.end(), [](const auto& a, const auto& b) { return identity(a) == identity(b); });
  log.erase(end, log.end());
  std::sort(log.begin(), log.end(), [](const LossChange& a, const LossChange& b) {
    return std::tuple(a.version, identity(a)) < std::tuple(b.version, identity(b));
  });
}

}  // namespace oriel
