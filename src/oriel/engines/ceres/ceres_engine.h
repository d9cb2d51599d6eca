// The same graph through Ceres Solver: the oracle of the native engine's tests, and a second opinion for users. Every
// factor of whatever type becomes a cost function that calls the table's own linearize on one row, so that both engines
// have the same residuals, whitening and Jacobians by construction, and only the optimiser differs. That is slow; a
// rival for benchmarks is written by hand (benchmarks/).
#pragma once
#include "oriel/solve/engine.h"

namespace oriel {

class CeresEngine final : public Engine {
 public:
  explicit CeresEngine(Graph& graph) : graph_(&graph) {}

  std::string_view name() const override { return "ceres"; }
  // Makes a ceres::Problem of the graph each time. Gauss–Newton is Levenberg–Marquardt with vanishing damping: Ceres
  // has no other. SolveOptions::ordering is Ceres's own affair. A factor that is not valid at the start does not count;
  // a step to where another one turns invalid is refused.
  Summary solve(const SolveOptions& options) noexcept override;
  double cost() noexcept override;
  Result<EngineContents> contents() noexcept override;

 private:
  Graph* graph_;
};

}  // namespace oriel
