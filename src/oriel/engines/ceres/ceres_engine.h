// The same graph through Ceres Solver: the oracle of the native engine's tests, and a second opinion for users. Every
// factor of whatever type becomes a cost function that calls the table's own linearize on one row, so that both engines
// have the same residuals, whitening and Jacobians by construction, and only the optimiser differs. That is slow; a
// rival for benchmarks is written by hand (benchmarks/).
#pragma once
#include <memory>

#include "oriel/solve/engine.h"

namespace oriel {

namespace ceres_detail {
class CeresProblem;
}

// It follows its graph edit by edit, in one ceres::Problem that is never made anew.
//
// Gauss–Newton is Levenberg–Marquardt with a damping below rounding (1e-16), Ceres having no other; it ends at the
// first step that does not lower the cost. A factor that is not valid at the start does not count; a step to where
// another one turns invalid is refused. step_tolerance is not asked: Ceres's own is relative. A deadline is looked at
// after each iteration. Ceres keeps what it holds in the order of its coming, with the last in the place of what left:
// the same edits in the same syncs give the same bits, and another way to the same graph gives the same up to rounding.
class CeresEngine final : public Engine {
 public:
  explicit CeresEngine(Graph& graph);
  CeresEngine(const CeresEngine&) = delete;
  CeresEngine& operator=(const CeresEngine&) = delete;
  ~CeresEngine() override;

  std::string_view name() const override { return "ceres"; }
  EngineCapabilities capabilities() const noexcept override;
  Result<void> sync() noexcept override;
  using Engine::solve;
  Summary solve(const SolveOptions& options) noexcept override;
  double cost() noexcept override;
  Result<EngineContents> contents() noexcept override;
  using Engine::joint_covariance;
  // By a sparse QR of the Jacobian; of where its rank ends Ceres has an idea of its own (the norms of the columns). It
  // sorts by address: two times asked, the same up to rounding.
  Result<void> joint_covariance(std::span<const VariableKey> ids, std::vector<double>& out) noexcept override;

 private:
  Graph* graph_;
  Subscription subscription_;
  GraphEdit net_;  // what changed since it last looked
  std::unique_ptr<ceres_detail::CeresProblem> problem_;
  std::uint64_t seen_version_ = ~std::uint64_t{0};  // whose values the problem has; none: to be taken
  bool failed_ = false;                             // the last solve
};

}  // namespace oriel
