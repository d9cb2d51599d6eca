// WindowPolicy: which states leave the window, and how (behaviour W11). It is asked before each slide.
#pragma once
#include <vector>

#include "oriel/graph/graph.h"
#include "oriel/window/states.h"

namespace oriel {

// A state that is to leave.
struct LeavingState {
  enum class How {
    marginalize,  // what it knew becomes a prior on its neighbours; nothing comes between those any more
    remove,       // with all its factors, as if it had never been: one motion factor takes the place of two
  };
  ProviderId provider;
  Time time;
  How how = How::marginalize;
};

class WindowPolicy {
 public:
  virtual ~WindowPolicy() = default;
  // Appends the states that leave. States that no solve has seen are not marginalized, whatever is asked.
  virtual void choose(const Graph& graph, const States& states, std::vector<LeavingState>& leaving) = 0;
  // The window begins anew.
  virtual void reset() {}
};

// How long the states of a provider stay. The minimum comes first, then the most states, then the duration.
struct Lag {
  int min_states = 1;
  int max_states = 10;
  Duration duration{0};  // from the provider's newest state back; 0: as long as max_states says
};

// The window has one start for all kinds of state: the latest of those that the providers' lags want, but never one
// that leaves a provider fewer than its least states, and none beyond the last solved state. What is older leaves.
class LagPolicy final : public WindowPolicy {
 public:
  // Refused, with nothing changed: fewer than one state at least, fewer at most than at least, a negative duration.
  static Result<void> feasible(const Lag& lag);
  Result<void> set(const Lag& all);
  Result<void> set(ProviderId provider, const Lag& lag);

  const Lag& lag(ProviderId provider) const;
  // The time before which states leave; the least time there is where none does.
  Time start(const States& states) const;
  void choose(const Graph& graph, const States& states, std::vector<LeavingState>& leaving) override;

 private:
  struct Own {
    ProviderId provider;
    Lag lag;
  };
  Lag all_;
  std::vector<Own> own_;
};

}  // namespace oriel
