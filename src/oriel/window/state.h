// State: the variables of one state provider at one time (pose, velocity, biases, each a variable of its own).
#pragma once
#include <span>

#include "oriel/base/time.h"
#include "oriel/graph/ids.h"

namespace oriel {

struct State {
  static constexpr int kMostVariables = 6;

  Time time;
  int count = 0;
  VariableKey variables[kMostVariables];  // in the provider's order
  FactorId motion;                        // from the state before it; table 0 where there is none
  bool severed = false;                   // what moved it from the state before is in the prior: none comes between
  bool solved = false;                    // a solve that did not fail has seen it

  std::span<const VariableKey> all() const { return {variables, static_cast<std::size_t>(count)}; }
  bool has_motion() const { return motion.table != 0; }
};

}  // namespace oriel
