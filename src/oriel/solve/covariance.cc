// Marginal covariance of some variables: their part of the inverse of the undamped H at the graph's values, column by
// column through the same elimination as a step (unit right-hand sides).
#include <algorithm>
#include <cmath>

#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

// Where a variable stands in a step, or an error for an id that does not resolve.
Result<Target> find_target(const Graph& graph, const LinearStructure& structure, VariableKey id) {
  for (std::size_t p = 0; p < graph.pools().size(); ++p) {
    const VariablePool& pool = *graph.pools()[p];
    if (pool.ops().key != id.type) continue;
    const std::uint32_t dense = pool.slots().find(id.key);
    if (dense != SlotIndex::kNone) return structure.target(p, dense);
  }
  return Error{ErrorCode::stale_id, "covariance: " + graph.describe(id) + " is not in the graph"};
}

int dim_of(const Graph& graph, VariableKey id) {
  const VariableOps* ops = graph.find_ops(id.type);
  return ops == nullptr ? 0 : ops->dim;
}

}  // namespace

Result<std::vector<double>> NativeEngine::joint_covariance(std::span<const VariableKey> ids) noexcept {
  std::vector<double> out;
  if (auto ok = joint_covariance(ids, out); !ok) return ok.error();
  return out;
}

Result<void> NativeEngine::joint_covariance(std::span<const VariableKey> ids, std::vector<double>& out) noexcept {
  std::size_t n = 0;
  for (const VariableKey& id : ids) {
    if (std::count(ids.begin(), ids.end(), id) > 1)
      return Error{ErrorCode::duplicate, "covariance: " + graph_->describe(id) + " is named twice"};
    n += static_cast<std::size_t>(dim_of(*graph_, id));
  }
  out.resize(n * n);
  return covariance_block(ids, out.data());
}

// Eliminates at the first right-hand side, which must be in place; `id` is for the words of an error.
Result<void> NativeEngine::factor_undamped(VariableKey id) noexcept {
  const FactorReport& report = structure_.factorization().factor(reduced_.data(), damping_.data());
  if (report.status == FactorReport::Status::not_finite)
    return Error{ErrorCode::not_finite, "covariance: the linear system is not finite"};
  if (report.status == FactorReport::Status::undetermined || !schur_.undetermined().empty())
    return Error{ErrorCode::singular, "covariance of " + graph_->describe(id) +
                                          ": some direction of the graph is determined by nothing (solve names it)"};
  return {};
}

Result<void> NativeEngine::covariance_block(std::span<const VariableKey> ids, double* out) noexcept {
  if (failed_) return Error{ErrorCode::conflict, "covariance: the last solve failed, so there is none"};
  if (auto ok = linearize(linearizer_.first_estimates); !ok) return ok;  // as the last solve did
  std::vector<int>& scalars = covariance_scalars_;  // in a step, of each row and column; -1: fixed, known for certain
  scalars.clear();
  for (const VariableKey& id : ids) {
    auto target = find_target(*graph_, structure_, id);
    if (!target) return target.error();
    for (int k = 0; k < dim_of(*graph_, id); ++k)
      scalars.push_back(target->kind == Target::Kind::fixed ? -1 : target->offset + k);
  }
  const std::size_t n = scalars.size();
  std::fill_n(out, n * n, 0.0);
  damping_.assign(static_cast<std::size_t>(structure_.dim()), 0.0);
  step_.resize(damping_.size());
  rhs_.resize(static_cast<std::size_t>(structure_.kept_dim()));
  reduced_.reserve(structure_.factorization().storage_size());
  bool factored = false;
  for (std::size_t c = 0; c < n; ++c) {
    if (scalars[c] < 0) continue;
    std::fill(system_.gradient.begin(), system_.gradient.end(), 0.0);
    system_.gradient[static_cast<std::size_t>(scalars[c])] = -1.0;
    schur_.reduce(structure_, system_, damping_.data(), reduced_.data(), rhs_.data(), nullptr);
    if (!factored)
      if (auto ok = factor_undamped(ids[0]); !ok) return ok;
    factored = true;
    structure_.factorization().solve(rhs_.data(), step_.data());
    if (!structure_.landmarks().empty())
      schur_.back_substitute(structure_, system_, damping_.data(), step_.data(), nullptr);
    for (std::size_t r = 0; r < n; ++r)
      if (scalars[r] >= 0) out[c * n + r] = step_[static_cast<std::size_t>(scalars[r])];
  }
  return {};
}

}  // namespace oriel
