// What the window's model remembers of states that have left: of each what it is given those that stayed. A late row is
// combined with these, in the order of elimination, until it speaks of what lives alone.
#pragma once
#include <functional>
#include <optional>

#include "model_algebra.h"

namespace oriel::linear_world {

class ModelLedger {
 public:
  using Lives = std::function<bool(const Unknown&)>;

  bool holds(const Unknown& u) const { return find(u) != nullptr; }
  std::size_t size() const { return entries_.size(); }
  void clear() { entries_.clear(); }

  void keep_newest(ModelConditional c, Time stamp) { keep(std::move(c), stamp, ++newest_); }
  // Of a state that nothing which is kept was given.
  void keep_oldest(ModelConditional c, Time stamp) { keep(std::move(c), stamp, --oldest_); }

  // Beyond a number, or older than a horizon (0: none) against the newest. Of those that left together, the one that
  // `is_gone` says went first.
  void forget(std::size_t capacity, Duration horizon, const std::function<bool(const Unknown&)>& is_gone) {
    while (!entries_.empty()) {
      Time newest = entries_[0].stamp, oldest = newest;
      for (const Entry& e : entries_) newest = std::max(newest, e.stamp), oldest = std::min(oldest, e.stamp);
      const bool late = horizon.ns > 0 && newest - oldest > horizon;
      if (!late && entries_.size() <= capacity) return;
      auto first = entries_.end();
      for (auto e = entries_.begin(); e != entries_.end(); ++e) {
        if (e->stamp != oldest) continue;
        if (first == entries_.end() || goes_first(*e, *first, is_gone)) first = e;
      }
      entries_.erase(first);
    }
  }

  // Whether something that neither lives nor is kept is on the way from these, be its weight ever so small.
  bool is_cut(const std::vector<Unknown>& from, const Lives& lives) const {
    std::vector<Unknown> way = from;
    std::set<Unknown> seen(from.begin(), from.end());
    for (std::size_t k = 0; k < way.size(); ++k) {
      if (lives(way[k])) continue;
      const Entry* e = find(way[k]);
      if (e == nullptr) return true;
      for (const auto* more : {&e->c.gone, &e->named})
        for (const Unknown& u : *more)
          if (seen.insert(u).second) way.push_back(u);
    }
    return false;
  }

  // What is there under its name from now on is something else: it was removed, or has left at the newest end and is
  // made anew. `renamed` hears of the name under which it is remembered.
  void disown(const Unknown& u) {
    const Unknown nobody{u.what, -++strangers_};
    for (Entry& e : entries_)
      for (auto* names : {&e.c.gone, &e.c.given, &e.named}) std::replace(names->begin(), names->end(), u, nobody);
    if (renamed) renamed(u, nobody);
  }
  std::function<void(const Unknown&, const Unknown&)> renamed;

  // What a late row says of what lives; nothing if the way is cut.
  std::optional<ModelPrior> fold(const ModelRow& late, const Lives& lives) {
    ModelPrior rows = algebra::prior_of(late);
    std::sort(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) { return a.order < b.order; });
    const std::vector<Entry> before = entries_;
    for (Entry& e : entries_) {
      const std::set<Unknown> gone(e.c.gone.begin(), e.c.gone.end());
      if (!rows.names_any(gone)) continue;
      ModelPrior known{e.c.gone, e.c.R, e.c.d};
      known.of.insert(known.of.end(), e.c.given.begin(), e.c.given.end());
      for (const Unknown& u : rows.of)
        if (!known.names(u)) e.named.push_back(u);
      auto done = algebra::eliminate(gone, {}, {known, rows});
      e.c = pruned(std::move(done.known));
      rows = pruned(std::move(done.rest));
    }
    if (std::all_of(rows.of.begin(), rows.of.end(), lives)) return rows;
    entries_ = before;
    return {};
  }

 private:
  // What is nothing but rounding, beside the largest.
  static double least(const Eigen::MatrixXd& R) { return R.size() > 0 ? 1e-13 * R.cwiseAbs().maxCoeff() : 0.0; }

  struct Entry {
    ModelConditional c;
    std::vector<Unknown> named;  // given which, those of no weight included
    Time stamp;
    std::int64_t order = 0;
  };
  static bool goes_first(const Entry& a, const Entry& b, const std::function<bool(const Unknown&)>& is_gone) {
    const bool x = is_gone(a.c.gone[0]), y = is_gone(b.c.gone[0]);
    return x != y ? x : a.order < b.order;
  }
  const Entry* find(const Unknown& u) const {
    for (const Entry& e : entries_)
      if (std::find(e.c.gone.begin(), e.c.gone.end(), u) != e.c.gone.end()) return &e;
    return nullptr;
  }
  void keep(ModelConditional c, Time stamp, std::int64_t order) {
    std::vector<Unknown> named = c.given;
    entries_.push_back({pruned(std::move(c)), std::move(named), stamp, order});
  }
  static ModelConditional pruned(ModelConditional c) {
    int gone = 0;
    for (const Unknown& u : c.gone) gone += u.dim();
    algebra::prune(c.given, c.R, gone, least(c.R));
    return c;
  }
  static ModelPrior pruned(ModelPrior p) {
    algebra::prune(p.of, p.R, 0, least(p.R));
    return p;
  }

  std::vector<Entry> entries_;
  std::int64_t newest_ = 0, oldest_ = 0, strangers_ = 0;
};

}  // namespace oriel::linear_world
