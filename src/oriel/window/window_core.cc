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

Result<MarginalizeReport> WindowCore::slide(std::span<const VariableKey> leaving,
                                               const MarginalizeOptions& options) {
  Result<MarginalizeReport> report = marginalizer_.marginalize(graph_, leaving, options, edit());
  if (!report) return report;
  if (auto ok = commit(); !ok) return ok.error();
  return report;
}

Result<void> WindowCore::clear() {
  GraphEdit& all = edit();
  for (const auto& pool : graph_.pools())
    for (std::uint32_t d = 0; d < pool->extent(); ++d)
      if (pool->slots().is_live(d)) all.remove(VariableKey{pool->ops().key, pool->slots().key(d)});
  return commit();
}

}  // namespace oriel
