// What a structure makes of a graph, for tests that compare two structures to the last bit.
#pragma once
#include <vector>

#include "oriel/linear/linearize.h"

namespace oriel {

inline FactorOptions counts_as_large() {
  FactorOptions options;
  options.least_followed = 10;
  return options;
}

// The whole linear problem at the graph's values, solved.
inline std::vector<double> step_of(const Graph& graph, LinearStructure& s) {
  Linearizer linearizer;
  Point point;
  point.take(graph);
  ActiveSet active;
  LinearSystem system;
  linearizer.evaluate(graph, s, point, nullptr, active, nullptr);
  linearizer.linearize(graph, s, point, &active, system, nullptr);
  const std::vector<double> damping(static_cast<std::size_t>(s.dim()), 1e-3);
  s.factorization().factor(system.h.data(), damping.data());
  std::vector<double> step(static_cast<std::size_t>(s.dim()));
  s.factorization().solve(system.gradient.data(), step.data());
  step.push_back(active.total);
  return step;
}

}  // namespace oriel
