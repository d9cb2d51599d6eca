#include "oriel/linear/linearize_factor.h"

#include "oriel/linear/aligned_buffer.h"
#include "oriel/linear/evaluate_rows.h"

namespace oriel {
namespace {

constexpr int kRows = Batch::kRows;

FactorLinearization linearize_table(const Graph& graph, const FactorTable& table, std::uint32_t row,
                                    bool first_estimates) {
  FactorLinearization out;
  out.rows = table.ops().dim;
  for (const VariableRef& ref : table.variables(row)) {
    const VariablePool& pool = *graph.pools()[ref.pool];
    if (pool.ops().dim == 0) continue;
    out.variables.push_back({pool.ops().key, pool.slots().key_of_slot(ref.slot)});
    out.cols += pool.ops().dim;
  }
  AlignedBuffer numbers;
  numbers.reserve(std::int64_t{kRows} * out.rows * (1 + out.cols));
  Batch batch;
  double* const r = numbers.data();
  evaluate_rows(graph, table, {&row, 1}, nullptr, first_estimates, r, r + std::int64_t{kRows} * out.rows, batch);
  for (int i = 0; i < out.rows; ++i) out.residual.push_back(batch.r[i * kRows]);
  for (int i = 0; i < out.rows * out.cols; ++i) out.jacobian.push_back(batch.J[i * kRows]);
  out.valid = batch.valid & 1;
  out.finite = !(batch.not_finite & 1);
  out.cost = batch.cost[0];
  return out;
}

FactorLinearization linearize_prior(const Graph& graph, std::uint32_t row) {
  const LinearPriorView prior = graph.priors().numbers(row);
  FactorLinearization out;
  out.rows = prior.rows, out.cols = prior.cols;
  std::vector<double> error(static_cast<std::size_t>(prior.cols));
  const double* estimate = graph.priors().estimates(row);
  std::size_t column = 0;
  for (const VariableRef& ref : graph.priors().variables(row)) {
    const VariablePool& pool = *graph.pools()[ref.pool];
    out.variables.push_back({pool.ops().key, pool.slots().key_of_slot(ref.slot)});
    pool.ops().minus(pool.value(pool.slots().dense(ref.slot)), estimate, error.data() + column);
    column += static_cast<std::size_t>(pool.ops().dim);
    estimate += estimate_doubles(pool.ops());
  }
  out.residual.resize(static_cast<std::size_t>(prior.rows));
  evaluate_prior(prior, error.data(), out.residual.data());
  out.jacobian.assign(prior.R, prior.R + static_cast<std::size_t>(prior.rows) * static_cast<std::size_t>(prior.cols));
  for (const double r : out.residual) out.cost += 0.5 * r * r;
  out.valid = true;
  return out;
}

}  // namespace

Result<FactorLinearization> linearize_factor(const Graph& graph, FactorId id, bool first_estimates) {
  if (!graph.contains(id))
    return Error{ErrorCode::stale_id, "linearize_factor: factor #" + std::to_string(id.key.index) + "." +
                                          std::to_string(id.key.generation) + " is not in the graph"};
  if (id.table == PriorTable::kKey) return linearize_prior(graph, graph.priors().slots().find(id.key));
  for (const auto& t : graph.tables())
    if (t->ops().key == id.table) return linearize_table(graph, *t, t->slots().find(id.key), first_estimates);
  return Error{ErrorCode::not_found, "linearize_factor: no such table"};
}

}  // namespace oriel
