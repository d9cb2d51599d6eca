#include "oriel/window/window_core.h"

namespace oriel {

Result<void> WindowCore::commit() {
  if (edit_.empty()) return {};
  if (auto ok = graph_.apply(edit_); !ok) return ok;
  if (observer_ != nullptr) observer_->edited();
  return {};
}

Summary WindowCore::solve(const SolveOptions& options) {
  const SolverState before = engine_.state();
  Summary summary = engine_.solve(options);
  if (observer_ != nullptr) observer_->solved(options, before, summary, engine_);
  return summary;
}

Result<MarginalizeReport> WindowCore::slide(std::span<const VariableKey> leaving, const MarginalizeOptions& options) {
  Result<MarginalizeReport> report = marginalizer_.marginalize(graph_, leaving, options, edit());
  if (!report) return report;
  if (auto ok = commit(); !ok) return ok.error();
  return report;
}

Result<void> WindowCore::drop(std::span<const VariableKey> leaving, LandmarkPolicy landmarks) {
  if (auto ok = scope_.collect(graph_, leaving, landmarks); !ok) return ok;
  GraphEdit& all = edit();
  for (const MarginalVariable& v : scope_.variables())
    if (v.role != MarginalVariable::Role::staying) all.remove(v.id);
  // Those of their priors as well: graphs would keep what these say of the variables that stay.
  for (const MarginalPrior& p : scope_.priors())
    all.remove(FactorId{PriorTable::kKey, graph_.priors().slots().key(p.row)});
  return commit();
}

Result<void> WindowCore::clear() {
  GraphEdit& all = edit();
  for (const auto& pool : graph_.pools())
    for (std::uint32_t d = 0; d < pool->extent(); ++d)
      if (pool->slots().is_live(d)) all.remove(VariableKey{pool->ops().key, pool->slots().key(d)});
  return commit();
}

}  // namespace oriel
