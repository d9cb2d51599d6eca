// What an update of a window has to say, and who listens to it.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "oriel/base/result.h"
#include "oriel/solve/summary.h"
#include "oriel/window/marginalize.h"
#include "oriel/window/states.h"

namespace oriel {

// Why a group of factors is not in the window.
enum class Refusal : std::uint8_t {
  too_old,        // it names a time that has left the window, and nobody takes late groups
  unknown_id,     // it names a static variable that is not in the graph
  unknown_state,  // it names a provider, or a variable of its states, that does not exist
  no_motion,      // the provider failed to make a state, or a motion factor
  not_finite,     // a measurement, value or noise is not finite, or no noise
  refused,        // the graph refused it for another reason
  rejected,       // a hook did
  count
};
inline constexpr std::array<const char*, static_cast<std::size_t>(Refusal::count)> kRefusalNames = {
    "too_old", "unknown_id", "unknown_state", "no_motion", "not_finite", "refused", "rejected"};

// How many groups of a sensor were refused, by reason.
struct Refusals {
  std::array<std::int64_t, kRefusalNames.size()> counts{};
  std::int64_t operator[](Refusal r) const { return counts[static_cast<std::size_t>(r)]; }
  std::int64_t total() const {
    std::int64_t n = 0;
    for (const std::int64_t c : counts) n += c;
    return n;
  }
};

struct WindowUpdate {
  enum class Status {
    nothing_new,   // nothing has changed since the last update, and nothing was done
    updated,       // solved, and slid where the policy said so
    solve_failed,  // values and priors are as before, with what is new; `solve` says why
    slide_failed,  // solved, but nothing has left the window; `error` says why
    begun,         // what is new is being solved beside the caller, and no solve was merged yet
  };
  Status status = Status::nothing_new;
  const char* reset = "";  // why the window has begun anew in this update; empty where it has not
  int entered = 0;         // groups that are in now
  int late = 0;            // groups that were folded into the prior
  int waiting = 0;         // groups whose states are not there yet
  int refused = 0;         // groups; `refusals` has them by sensor and reason
  int states_made = 0, states_marginalized = 0, states_removed = 0;
  Summary solve;
  MarginalizeReport slide;
  const char* rejection = "";      // of the last group that a hook rejected
  Error error;                     // of the last thing that was refused or failed; no message where none was
  std::vector<Refusals> refusals;  // by sensor, of this update
  std::vector<FactorId> expelled;  // taken out after a solve failed: their squares are beyond what a sum can take
};

class WindowListener {
 public:
  virtual ~WindowListener() = default;
  // A state is about to leave, with the values of the last solve. Said again where the slide failed after this.
  virtual void leaving(const Graph& graph, const States& states, ProviderId provider, const State& state) {
    (void)graph, (void)states, (void)provider, (void)state;
  }
  // An update is done.
  virtual void updated(const Graph& graph, const States& states, const WindowUpdate& update) {
    (void)graph, (void)states, (void)update;
  }
};

}  // namespace oriel
