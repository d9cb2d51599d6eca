#include "oriel/engines/ceres/ceres_problem.h"

#include <algorithm>

namespace oriel::ceres_detail {

CeresProblem::CeresProblem(const Graph& graph, bool first_estimates) {
  ceres::Problem::Options own;
  own.loss_function_ownership = own.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_ = std::make_unique<ceres::Problem>(own);
  add_variables(graph);
  add_factors(graph, first_estimates);
  add_priors(graph);
}

void CeresProblem::add_variables(const Graph& graph) {
  const auto& pools = graph.pools();
  values_.resize(pools.size());
  for (std::size_t p = 0; p < pools.size(); ++p) {
    const VariablePool& pool = *pools[p];
    const VariableOps& ops = pool.ops();
    manifolds_.push_back(std::make_unique<PoolManifold>(ops));
    if (ops.dim == 0) continue;
    const int size = block_size(ops);
    values_[p].assign(static_cast<std::size_t>(size) * pool.extent(), 0.0);
    for (std::uint32_t d = 0; d < pool.extent(); ++d) {
      if (!pool.slots().is_live(d) || pool.fixed(d)) continue;
      double* block = &values_[p][static_cast<std::size_t>(size) * d];
      std::memcpy(block, pool.value(d), ops.bytes);
      problem_->AddParameterBlock(block, size, manifolds_[p].get());
      dim_ += ops.dim;
      has_landmarks_ = has_landmarks_ || ops.landmark;
    }
  }
}

// A variable of a row, and its block among those that the cost function has so far.
Argument CeresProblem::argument(const Graph& graph, const VariableRef& ref, bool first_estimates,
                                std::vector<double*>& blocks) const {
  const VariablePool& pool = *graph.pools()[ref.pool];
  const std::uint32_t d = pool.slots().dense(ref.slot);
  Argument a{&pool.ops(), -1, pool.value(d), nullptr};
  if (first_estimates && pool.has_first_estimate(d)) a.first_estimate = pool.first_estimate(d);
  if (pool.ops().dim == 0 || pool.fixed(d)) return a;
  auto* block = const_cast<double*>(&values_[ref.pool][static_cast<std::size_t>(block_size(pool.ops())) * d]);
  const auto known = std::find(blocks.begin(), blocks.end(), block);
  a.block = static_cast<int>(known - blocks.begin());
  if (known == blocks.end()) blocks.push_back(block);
  return a;
}

ceres::LossFunction* CeresProblem::loss(const Loss& loss) {
  if (loss.kind == LossKind::none) return nullptr;
  losses_.push_back(std::make_unique<TableLoss>(loss));
  return losses_.back().get();
}

void CeresProblem::add_factors(const Graph& graph, bool first_estimates) {
  for (const auto& table : graph.tables())
    for (std::uint32_t row = 0; row < table->extent(); ++row) {
      if (!table->slots().is_live(row)) continue;
      Factor factor;
      std::vector<Argument> arguments;
      for (const VariableRef& ref : table->variables(row))
        arguments.push_back(argument(graph, ref, first_estimates, factor.blocks));
      factor.cost = new FactorCost(table->ops(), table->measurement(row), table->noise(row), std::move(arguments));
      residuals_.emplace(problem_->AddResidualBlock(factor.cost, loss(table->loss(row)), factor.blocks),
                         FactorId{table->ops().key, table->slots().key(row)});
      factors_.push_back(std::move(factor));
    }
}

void CeresProblem::add_priors(const Graph& graph) {
  const PriorTable& table = graph.priors();
  for (std::uint32_t row = 0; row < table.extent(); ++row) {
    if (!table.slots().is_live(row)) continue;
    std::vector<double*> blocks;
    std::vector<Argument> arguments;
    for (const VariableRef& ref : table.variables(row)) arguments.push_back(argument(graph, ref, false, blocks));
    auto* cost = new PriorCost(table.numbers(row), table.estimates(row), std::move(arguments));
    residuals_.emplace(problem_->AddResidualBlock(cost, nullptr, blocks),
                       FactorId{PriorTable::kKey, table.slots().key(row)});
  }
}

double CeresProblem::cost() {
  double cost = 0.0;
  problem_->Evaluate({}, &cost, nullptr, nullptr, nullptr);
  return cost;
}

void CeresProblem::freeze() {
  invalid_ = 0;
  for (Factor& f : factors_) {
    const bool valid = f.cost->valid_at(f.blocks.data());
    f.cost->freeze(valid);
    invalid_ += !valid;
  }
}

Solution CeresProblem::solution(const Graph& graph) const {
  Solution solution;
  solution.version = graph.version();
  for (std::size_t p = 0; p < values_.size(); ++p) {
    const VariablePool& pool = *graph.pools()[p];
    if (values_[p].empty()) continue;
    Solution::Column column{&pool.ops(), {}, ByteColumn(pool.ops().bytes)};
    for (std::uint32_t d = 0; d < pool.extent(); ++d) {
      if (!pool.slots().is_live(d) || pool.fixed(d)) continue;
      column.keys.push_back(pool.slots().key(d));
      column.values.push_back(&values_[p][static_cast<std::size_t>(block_size(pool.ops())) * d]);
    }
    solution.columns.push_back(std::move(column));
  }
  return solution;
}

EngineContents CeresProblem::contents(const Graph& graph) const {
  EngineContents out;
  std::unordered_map<const double*, VariableKey> ids;
  for (std::size_t p = 0; p < values_.size(); ++p) {
    const VariablePool& pool = *graph.pools()[p];
    const auto size = static_cast<std::size_t>(block_size(pool.ops()));
    for (std::uint32_t d = 0; d < pool.extent() && !values_[p].empty(); ++d) {
      const double* block = &values_[p][size * d];
      if (!problem_->HasParameterBlock(block)) continue;
      const VariableKey id{pool.ops().key, pool.slots().key(d)};
      const auto* value = reinterpret_cast<const std::byte*>(block);
      out.parameters.push_back({id, problem_->ParameterBlockTangentSize(block), {value, value + pool.ops().bytes}});
      ids.emplace(block, id);
    }
  }
  std::vector<ceres::ResidualBlockId> residuals;
  problem_->GetResidualBlocks(&residuals);
  std::vector<double*> blocks;
  for (const ceres::ResidualBlockId block : residuals) {
    problem_->GetParameterBlocksForResidualBlock(block, &blocks);
    EngineContents::Residual residual{
        residuals_.at(block), problem_->GetCostFunctionForResidualBlock(block)->num_residuals(), {}};
    for (const double* b : blocks) residual.parameters.push_back(ids.at(b));
    out.residuals.push_back(std::move(residual));
  }
  return out;
}

}  // namespace oriel::ceres_detail
