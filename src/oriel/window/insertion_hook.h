// InsertionHook: looks at a group of factors once it is in the graph, before the next solve. It may drop factors, weigh
// them anew, add variables and factors of its own, or have the group rejected as a whole.
#pragma once
#include <span>
#include <string_view>

#include "oriel/graph/graph.h"
#include "oriel/window/states.h"

namespace oriel {

struct InsertedGroup {
  int sensor = 0;  // SlidingWindow::sensor_name
  Time newest;     // of the states that it touches
  std::span<const FactorId> factors;
  std::span<const VariableKey> new_variables;  // of states that were made for it
};

class InsertionHook {
 public:
  struct Verdict {
    bool reject = false;
    const char* reason = "";  // of a rejection; a literal
    bool reset = false;       // the window is to begin anew (a gap)
  };
  virtual ~InsertionHook() = default;
  virtual std::string_view name() const = 0;
  // What it puts into `edit` is applied when it returns, unless it rejects: then the group and the states that were
  // made for it leave, and nothing of them stays behind. Factors that it adds and removes are told to later hooks.
  virtual Verdict inserted(const Graph& graph, const States& states, const InsertedGroup& group, GraphEdit& edit) = 0;
  virtual void reset() {}
};

}  // namespace oriel
