// What a solve goes by where its caller leaves it to the engine; for graphs the same in all engines, so that they can
// be compared.
#pragma once
#include "oriel/graph/graph.h"
#include "oriel/solve/options.h"

namespace oriel {

// Whether nothing is free but one vector without a meaning of its own (manifold/vector.h): the parameters of a curve
// that is fitted. Such problems start from anywhere, an iteration costs microseconds, and all digits are wanted; a
// window or a pose graph starts near its minimum, and wants to be there soon.
bool is_regression(const Graph& graph);

// The options that may be left open, with nothing left open. No copy of all: a callback may have a state of its own.
struct Settled {
  int max_iterations = 0;
  double function_tolerance = 0.0, gradient_tolerance = 0.0, step_tolerance = 0.0;
  double initial_lambda = 0.0, initial_radius = 0.0;
};
// `landmarks`: whether any are eliminated.
Settled settle(const SolveOptions& options, bool landmarks, bool regression);

}  // namespace oriel
