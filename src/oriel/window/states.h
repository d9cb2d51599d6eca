// States: which states the window has, for every provider, by their times; and how a new one comes about.
//
//   if (states.request(edit, imu, time) && states.link(edit) && graph.apply(edit)) states.commit();
//   else edit.clear(), states.rollback();
//
// A request stages what it changes, together with the edit that it fills: commit() once the edit was applied,
// rollback() if it was not. So a state is there exactly when its variables are (behaviours W3 to W5). Motion factors
// come at the end, by link(): a state that came between two in the same edit would else have to take out again a
// factor that is not in the graph yet.
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
  too_old,   // older than the window, or between two states whose motion is in the prior
};

class States {
 public:
  static constexpr Time kNever{std::numeric_limits<std::int64_t>::min()};

  // The provider's timeline is empty until begin() or a first request.
  ProviderId add(std::unique_ptr<StateProvider> provider);
  int providers() const { return static_cast<int>(chains_.size()); }
  bool has(ProviderId id) const { return id.index >= 0 && id.index < providers(); }
  // None has that name: -1.
  int find_provider(std::string_view name) const;
  const StateProvider& provider(ProviderId id) const { return *chains_[id.index].provider; }
  StateProvider& provider(ProviderId id) { return *chains_[id.index].provider; }
  const Timeline<State>& timeline(ProviderId id) const { return chains_[id.index].timeline; }
  // The place of the provider's first variable of a type among a state's variables; -1 where it has none.
  int place_of(ProviderId id, std::uint64_t type) const;
  // The variable of that type of the state at that time; a key of generation 0 where there is none.
  VariableKey find(ProviderId id, Time time, std::uint64_t type) const;

  Reach reach(ProviderId id, Time time) const;
  // The state at a time that is there or possible. A new one is predicted from the nearest older one; the first of a
  // provider has priors. On an error the edit is spoilt: clear it and roll back.
  Result<State> request(GraphEdit& edit, ProviderId id, Time time);
  // Takes out a state whose neighbours stay, as if it had never been: its variables leave, and one motion factor takes
  // the place of two. Only of a state that is in the graph.
  Result<void> withdraw(GraphEdit& edit, ProviderId id, Time time);
  // The motion factors of all that was requested and withdrawn since the last commit: the last call before the edit is
  // applied. Where a state came between two, the old motion factor leaves and two come. On an error as above.
  Result<void> link(GraphEdit& edit);
  void commit();
  void rollback();
  // Variables of the states that the edit at hand makes, in the order of the requests.
  const std::vector<VariableKey>& new_variables() const { return new_variables_; }
  struct Made {
    ProviderId provider;
    Time time;
  };
  const std::vector<Made>& new_states() const { return new_states_; }

  // ---- for the window ----
  // The state was marginalized: it leaves the timeline, and nothing comes between its neighbours any more. Where it was
  // the oldest, times before the next are too old from now on.
  void forget(ProviderId id, Time time);
  // Times before the oldest state, or up to `left` where there is none, are too old from now on.
  void raise_horizon(ProviderId id, Time left);
  void mark_solved();
  // After edits by others: where a motion factor is gone, nothing comes between its states any more; a state without
  // its variables is none.
  void follow(const Graph& graph);
  // No state is left, and times before `horizon` are too old.
  void clear(Time horizon = kNever);
  // How long before the oldest state providers keep their measurements: for states that come late.
  void remember(Duration memory) { memory_ = memory; }
  Time horizon(ProviderId id) const { return chains_[id.index].horizon; }
  bool staged() const { return !staged_.empty(); }

 private:
  struct Chain {
    std::unique_ptr<StateProvider> provider;
    Timeline<State> timeline;
    Time horizon = kNever;
  };
  struct Staged {  // what rollback puts back, last first
    enum class Kind { made, changed, withdrawn };
    Kind kind = Kind::made;
    int chain = 0;
    State before;  // of `made` its time alone
  };
  struct Gap {  // before a state: its motion factor has to come
    int chain = 0;
    Time time;
  };
  // The motion factor of the state, if there is one, leaves; link() makes another.
  void unlink(GraphEdit& edit, int chain, State& state);
  void insert(int chain, const State& state);

  Duration memory_{0};
  std::vector<Chain> chains_;
  std::vector<Staged> staged_;
  std::vector<Gap> gaps_;
  std::vector<VariableKey> new_variables_;
  std::vector<Made> new_states_;
};

}  // namespace oriel
