// What happened to a graph, for any number of followers, each at its own pace (behaviours C1–C4).
//
// The graph stamps everything with the version that added or changed it, so what a follower that saw version v has not
// seen is: the rows added after v (the ends of the columns: serials rise), and the entries of two short logs. What was
// added and removed after v is in neither. Entries that every follower has seen are forgotten.
#pragma once
#include <cstdint>
#include <vector>

#include "oriel/graph/ids.h"

namespace oriel {

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
    std::uint64_t added = 0, removed = 0;  // versions
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

  Subscription subscribe();
  void unsubscribe(Subscription s) { mark_seen(s, kNobody); }
  std::uint64_t seen(Subscription s) const { return seen_[s.number]; }
  void mark_seen(Subscription s, std::uint64_t version);

  void note(const Removal& r);
  void note(const Change& c);
  void note(const LossChange& c);
  const std::vector<Removal>& removals() const { return removals_; }
  const std::vector<Change>& changes() const { return changes_; }
  const std::vector<LossChange>& loss_changes() const { return loss_changes_; }

 private:
  static constexpr std::uint64_t kNobody = ~std::uint64_t{0};
  std::uint64_t least_seen() const;

  std::vector<std::uint64_t> seen_;
  std::vector<Removal> removals_;
  std::vector<Change> changes_;
  std::vector<LossChange> loss_changes_;
};

}  // namespace oriel
