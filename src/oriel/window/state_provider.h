// StateProvider: makes states and the motion factors between them, out of measurements of its own. The window asks it
// for a state where a factor needs one, and asks for two halves of a motion where a state arrives between two others.
//
// A provider adds to the edit that it is handed and remembers nothing of what it added: the edit may be refused. Which
// states there are is the window's to know.
#pragma once
#include <span>
#include <string_view>

#include "oriel/base/result.h"
#include "oriel/graph/graph.h"
#include "oriel/window/state.h"

namespace oriel {

class StateProvider {
 public:
  virtual ~StateProvider() = default;
  virtual std::string_view name() const = 0;
  // The variables of a state, in order; at most State::kMostVariables.
  virtual std::span<const VariableOps* const> variables() const = 0;

  // Can there be a first state at that time? False: not yet.
  virtual bool can_begin(Time time) const {
    (void)time;
    return true;
  }
  // Adds the variables of the first state and a prior on each; writes them to `state`, whose time is set.
  virtual Result<void> begin(GraphEdit& edit, State& state) = 0;

  // Do the measurements in hand say how it moved from one time to the other? False: not yet, or no more.
  virtual bool covers(Time from, Time to) const = 0;
  // Adds the variables of a state, with values predicted from an older one (edit.value() of its variables).
  // covers(from.time, state.time) holds.
  virtual Result<void> predict(GraphEdit& edit, const State& from, State& state) = 0;
  // Adds the motion factor between two states, in the order of time. covers(from.time, to.time) holds. Called again for
  // the same pair, it adds an equal factor.
  virtual Result<FactorId> link(GraphEdit& edit, const State& from, const State& to) = 0;

  // The window is about to begin anew; `last` is the newest state that it had, still in the graph. The next first state
  // may go on from there.
  virtual void ended(const Graph& graph, const State& last) { (void)graph, (void)last; }
  // No motion that begins before `time` is asked for any more.
  virtual void forget_before(Time time) { (void)time; }
};

}  // namespace oriel
