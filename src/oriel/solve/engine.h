// An engine follows one graph and finds its most likely values.
#pragma once
#include <string_view>

#include "oriel/base/result.h"
#include "oriel/graph/graph.h"
#include "oriel/solve/engine_contents.h"
#include "oriel/solve/options.h"
#include "oriel/solve/summary.h"

namespace oriel {

class Engine {
 public:
  virtual ~Engine() = default;
  virtual std::string_view name() const = 0;
  // Looks at what changed, solves, and gives the graph the values (Graph::adopt) unless the solve failed; then the
  // graph is as it was.
  virtual Summary solve(const SolveOptions& options) noexcept = 0;
  // Cost of the graph's values: ½Σρ(‖r‖²), priors included, over the factors that are valid there. Jacobians
  // are not asked for: a factor whose Jacobian alone is not finite counts here, and not in a solve.
  virtual double cost() noexcept = 0;
  // Looks at what changed, as solve does, and says what it holds now; for `check`.
  virtual Result<EngineContents> contents() noexcept = 0;
};

// Does the engine hold what the graph holds (C7)? As many residuals and parameters, of the same dimensions, connected
// alike, at the same values, priors included, with the same cost; else an Error that names the first difference.
Result<void> check(Engine& engine, const Graph& graph);

}  // namespace oriel
