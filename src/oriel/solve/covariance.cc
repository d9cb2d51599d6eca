// Marginal covariance of some variables: their part of the inverse of the undamped H at the graph's values, column by
// column through the same elimination as a step (unit right-hand sides). Held directions are known for certain; the
// rest of a restricted variable is found in the axes of its directions (linear/restriction.h) and turned back.
#include <algorithm>

#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

// Of a variable that is in the graph: pool, and where it stands.
Target target_of(const Graph& graph, const LinearStructure& structure, const VariableKey& id, int& dim) {
  std::size_t p = 0;
  while (graph.pools()[p]->ops().key != id.type) ++p;
  const VariablePool& pool = *graph.pools()[p];
  dim = pool.ops().dim;
  return structure.target(p, pool.slots().find(id.key));
}

// Where each scalar of the variables stands in a step; -1: fixed or held, known for certain.
void find_scalars(const Graph& graph, const LinearStructure& structure, const Restriction& restriction,
                  std::span<const VariableKey> ids, std::vector<int>& out) {
  out.clear();
  for (const VariableKey& id : ids) {
    int dim = 0;
    const Target target = target_of(graph, structure, id, dim);
    for (int k = 0; k < dim; ++k) {
      const bool known = target.kind == Target::Kind::fixed || restriction.holds(target.offset + k);
      out.push_back(known ? -1 : target.offset + k);
    }
  }
}

void turn_back(const Graph& graph, const LinearStructure& structure, Restriction& restriction,
               std::span<const VariableKey> ids, std::size_t n, double* covariance) {
  std::size_t at = 0;
  for (const VariableKey& id : ids) {
    int dim = 0;
    const Target target = target_of(graph, structure, id, dim);
    if (target.kind != Target::Kind::fixed) restriction.to_tangent(target.offset, covariance, n, at);
    at += static_cast<std::size_t>(dim);
  }
}

}  // namespace

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

Result<void> NativeEngine::joint_covariance(std::span<const VariableKey> ids, std::vector<double>& out) noexcept {
  const auto size = covariance_size(*graph_, ids);
  if (!size) return size.error();
  if (failed_) return Error{ErrorCode::conflict, "covariance: the last solve failed, so there is none"};
  if (auto ok = linearize(linearizer_.first_estimates); !ok) return ok;  // as the last solve did
  std::vector<int>& scalars = covariance_scalars_;
  find_scalars(*graph_, structure_, restriction_, ids, scalars);
  const std::size_t n = *size;
  out.assign(n * n, 0.0);
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
  turn_back(*graph_, structure_, restriction_, ids, n, out.data());
  return {};
}

}  // namespace oriel
