// Marginal covariance of one variable: its block of the inverse of the undamped H at the graph's values, column by
// column through the same elimination as a step (unit right-hand sides).
#include <algorithm>
#include <cmath>

#include "oriel/solve/native_engine.h"

namespace oriel {

Result<void> NativeEngine::covariance_block(VariableKey id, double* out) noexcept {
  const VariablePool* pool = graph_->find_pool(id.type);
  const std::uint32_t dense = pool == nullptr ? SlotIndex::kNone : pool->slots().find(id.key);
  if (dense == SlotIndex::kNone)
    return Error{ErrorCode::stale_id, "covariance: " + graph_->describe(id) + " is not in the graph"};
  if (auto ok = linearize(true); !ok) return ok;
  std::size_t p = 0;
  while (graph_->pools()[p].get() != pool) ++p;
  const Target& target = structure_.target(p, dense);
  const int dim = pool->ops().dim;
  if (target.kind == Target::Kind::fixed) {  // it is known for certain
    std::fill_n(out, dim * dim, 0.0);
    return {};
  }
  Multifrontal& factorization = structure_.factorization();
  const std::size_t n = static_cast<std::size_t>(structure_.dim());
  damping_.assign(n, 0.0);
  step_.resize(n);
  rhs_.resize(static_cast<std::size_t>(structure_.kept_dim()));
  reduced_.reserve(factorization.storage_size());
  for (int c = 0; c < dim; ++c) {
    std::fill(system_.gradient.begin(), system_.gradient.end(), 0.0);
    system_.gradient[static_cast<std::size_t>(target.offset + c)] = -1.0;
    schur_.reduce(structure_, system_, damping_.data(), reduced_.data(), rhs_.data(), nullptr);
    if (c == 0) {
      const FactorReport& report = factorization.factor(reduced_.data(), damping_.data());
      if (report.status == FactorReport::Status::not_finite)
        return Error{ErrorCode::not_finite, "covariance: the linear system is not finite"};
      if (report.status == FactorReport::Status::undetermined || !schur_.undetermined().empty())
        return Error{ErrorCode::singular,
                     "covariance of " + graph_->describe(id) +
                         ": some direction of the graph is determined by nothing (solve names it)"};
    }
    factorization.solve(rhs_.data(), step_.data());
    if (!structure_.landmarks().empty())
      schur_.back_substitute(structure_, system_, damping_.data(), step_.data(), nullptr);
    for (int r = 0; r < dim; ++r) out[c * dim + r] = step_[static_cast<std::size_t>(target.offset + r)];
  }
  return {};
}

}  // namespace oriel
