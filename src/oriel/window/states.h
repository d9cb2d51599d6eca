// States: which states the window has, for every provider, by their times; and how a new one comes about.
//
// A request stages what it changes, together with the edit that it fills: commit() once the edit was applied,
// rollback() if it was not. So a state is there exactly when its variables are (behaviours W3 to W5).
#pragma once
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "oriel/window/state_provider.h"
#include "oriel/window/timeline.h"

namespace oriel {

struct ProviderId {
  int index = 0;
  friend bool operator==(const ProviderId&, const ProviderId&) = default;
};

// Whether a state at some time can be had.
enum class Reach {
  there,
  possible,  // the provider's measurements reach it
  not_yet,   // before the first state, or beyond the measurements in hand
  too_old,   // older than the window: states of that time have left
};

class States {
 public:
  // The provider's timeline is empty until begin() or a first request.
  ProviderId add(std::unique_ptr<StateProvider> provider);
  int providers() const { return static_cast<int>(chains_.size()); }
  // None has that name: -1.
  int find_provider(std::string_view name) const;
  const StateProvider& provider(ProviderId id) const { return *chains_[id.index].provider; }
  StateProvider& provider(ProviderId id) { return *chains_[id.index].provider; }
  const Timeline<State>& timeline(ProviderId id) const { return chains_[id.index].timeline; }
  // The place of the provider's first variable of a type among a state's variables; -1 where it has none.
  int place_of(ProviderId id, std::uint64_t type) const;

  // The first state of a provider; the timeline must be empty.
  Result<State> begin(GraphEdit& edit, ProviderId id, Time time);
  Reach reach(ProviderId id, Time time) const;
  // The state at a time that is there or possible. A new one comes with its motion factor; between two states the old
  // motion factor leaves and two come. On an error nothing of this request is staged, and the edit is spoilt: clear it.
  Result<State> request(GraphEdit& edit, ProviderId id, Time time);
  void commit();
  void rollback();
  // Takes out a state whose neighbours stay, as if it had never been: its variables leave, and one motion factor takes
  // the place of two. Staged as a request is.
  Result<void> withdraw(GraphEdit& edit, ProviderId id, Time time);

  // ---- for the window ----
  // The state was marginalized or removed: it leaves the timeline, and its successor has no motion factor any more.
  void forget(ProviderId id, Time time);
  void mark_solved();
  void clear();
  // Times before this have been marginalized.
  Time horizon(ProviderId id) const { return chains_[id.index].horizon; }

 private:
  struct Chain {
    std::unique_ptr<StateProvider> provider;
    Timeline<State> timeline;
    Time horizon{std::numeric_limits<std::int64_t>::min()};
  };
  struct Staged {  // what rollback puts back
    int chain = 0;
    Time time;
    bool existed = false;
    State before;
  };
  std::vector<Chain> chains_;
  std::vector<Staged> staged_;
};

}  // namespace oriel
