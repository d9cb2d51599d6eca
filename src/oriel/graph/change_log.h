// What happened to a graph, for any number of followers, each at its own pace (behaviours C1–C4).
//
// The graph stamps everything with the version that added or changed it, so what a follower that saw version v has not
// seen is: the rows added after v (the ends of the columns: serials rise), and the entries of three short logs. What
// was added and removed after v is in none of them.
//
// Memory: an entry is kept while some follower needs it, and of what changed again only the latest. A follower whose
// net has grown longer than the bound would cost more than the graph itself: it falls behind, is no longer counted, and
// its next collect gives the whole graph (GraphEdit::whole).
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "oriel/graph/ids.h"

namespace oriel {

class Graph;

// A follower's place in the log. Made by Graph::subscribe; the first collect gives the whole graph.
struct Subscription {
  std::uint32_t number = 0;
};

class ChangeLog {
 public:
  struct Removal {
    bool factor = false;
    std::uint64_t type = 0;  // type key of the variable, or key of the table
    SlotKey key;
    std::uint64_t added = 0, version = 0;  // versions; the latter of the removal
  };
  // The user set this value, flag or first estimate (the variable's own versions say which is the latest).
  struct Change {
    VariableKey id;
    std::uint64_t version = 0;
  };
  // The loss of a factor was set.
  struct LossChange {
    FactorId id;
    std::uint64_t version = 0;
  };
  // A follower falls behind once its net has more entries than per_live times the variables and factors of the graph,
  // and more than `least`. After every edit the log as a whole holds no more than twice that a follower.
  struct Bound {
    double per_live = 1.0;
    std::size_t least = 1024;
    std::size_t entries(std::size_t live) const {
      const double n = per_live * static_cast<double>(live);
      return n > static_cast<double>(least) ? static_cast<std::size_t>(n) : least;
    }
  };

  Subscription subscribe();
  void unsubscribe(Subscription s);
  std::uint64_t seen(Subscription s) const { return places_[s.number].seen; }
  // True from when the follower was dropped from the log until it has taken the whole graph.
  bool behind(Subscription s) const { return places_[s.number].behind; }
  void mark_seen(Subscription s, std::uint64_t version);
  // Everybody who has seen anything takes the whole graph next: it was replaced.
  void leave_all_behind();

  // `added`: the version in which the thing came. What no follower has heard of is not kept.
  void note(const Removal& r);
  void note(const Change& c, std::uint64_t added);
  void note(const LossChange& c, std::uint64_t added);
  // What happened after a version, in order.
  std::span<const Removal> removals(std::uint64_t seen) const;
  std::span<const Change> changes(std::uint64_t seen) const;
  std::span<const LossChange> loss_changes(std::uint64_t seen) const;

  void set_bound(const Bound& bound) { bound_ = bound; }
  const Bound& bound() const { return bound_; }
  // After every edit: forgets what nobody needs, once enough has come to be worth the look.
  void settle(const Graph& graph);
  std::size_t entries() const { return removals_.size() + changes_.size() + loss_changes_.size(); }
  // How often a follower fell behind.
  std::uint64_t left_behind() const { return left_behind_; }

 private:
  static constexpr std::uint64_t kNobody = ~std::uint64_t{0};
  struct Place {
    std::uint64_t seen = 0;  // 0: nothing, so that it needs no entry; kNobody: unsubscribed
    bool behind = false;
    std::size_t net = 0;  // scratch of settle
    // What came in version `added` and changed in `version`?
    bool needs(std::uint64_t added, std::uint64_t version) const { return added <= seen && seen < version; }
  };
  bool needed(std::uint64_t added, std::uint64_t version) const;  // by anybody
  void forget_superseded(const Graph& graph);
  template <class Keep>
  void for_each_entry(const Graph& graph, Keep&& keep);
  void leave_behind(Place& place);
  void clear();

  std::vector<Place> places_;
  std::vector<Removal> removals_;
  std::vector<Change> changes_;
  std::vector<LossChange> loss_changes_;
  Bound bound_;
  std::size_t kept_ = 0;  // entries when they were last looked through
  std::uint64_t left_behind_ = 0;
};

}  // namespace oriel
