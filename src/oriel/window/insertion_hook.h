// InsertionHook: looks at a group of factors once it is in the graph, before the next solve. It may drop factors, weigh
// them anew (GraphEdit::set of a loss, or removed and added with another noise), edit other factors and variables, add
// some of its own, or have the group rejected as a whole.
#pragma once
#include <span>
#include <string_view>

#include "oriel/graph/graph.h"
#include "oriel/window/states.h"

namespace oriel {

struct InsertedGroup {
  int sensor = 0;                              // SlidingWindow::sensor_name
  Time newest;                                 // of the states that it touches
  std::span<const FactorId> factors;           // its own and those that hooks before this one have added
  std::span<const VariableKey> variables;      // that came with it, and those that hooks have added
  std::span<const VariableKey> new_variables;  // of states that were made for it
};

// A group that came after its states had left, as it would go into the prior (late_groups.h). Its factors will never be
// in the graph: what is known of it is what it says about the variables that live.
struct LateArrival {
  int sensor = 0;
  Time oldest, newest;  // of the times that it names
  // What would be applied. Its priors' rows are white: they hold the noise of all that lies between, given what lives.
  // A factor all of whose variables live is in it as it is.
  const GraphEdit& edit;
};

class InsertionHook {
 public:
  struct Verdict {
    bool reject = false;
    bool reset = false;       // a gap: the window is to begin anew, with this group if it is not rejected as well
    const char* reason = "";  // of either; a literal
  };
  virtual ~InsertionHook() = default;
  virtual std::string_view name() const = 0;
  // What it puts into `edit` is applied when it returns, unless it rejects: then the group, the states that were made
  // for it and what earlier hooks have added to it leave, and nothing of them stays behind. What earlier hooks have
  // changed of other factors and variables is not undone: hooks that may reject stand before those that edit.
  // An edit that is refused rejects the group.
  virtual Verdict inserted(const Graph& graph, const States& states, const InsertedGroup& group, GraphEdit& edit) = 0;
  // Asked before a late group is folded: it may be rejected as a whole, and that is all; a reset that is asked for here
  // is not heard.
  virtual Verdict late(const Graph& graph, const States& states, const LateArrival& arrival) {
    (void)graph, (void)states, (void)arrival;
    return {};
  }
  virtual void reset() {}
};

}  // namespace oriel
