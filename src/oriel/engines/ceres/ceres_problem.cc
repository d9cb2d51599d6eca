#include "oriel/engines/ceres/ceres_problem.h"

#include <algorithm>
#include <bit>
#include <unordered_map>

namespace oriel::ceres_detail {
namespace {

// Columns of an edit stand in an order that its memory has from other edits; serials are the graph's own.
template <class Item>
void sort_by_serial(std::vector<std::pair<std::uint64_t, Item>>& items) {
  std::sort(items.begin(), items.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
}

}  // namespace

CeresProblem::CeresProblem() {
  ceres::Problem::Options own;
  own.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  own.loss_function_ownership = own.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  own.enable_fast_removal = true;
  problem_ = std::make_unique<ceres::Problem>(own);
}

CeresProblem::Pool* CeresProblem::find_pool(std::uint64_t type) const {
  for (const auto& p : pools_)
    if (p->ops->key == type) return p.get();
  return nullptr;
}

CeresProblem::Pool& CeresProblem::pool(const VariableOps& ops) {
  if (Pool* known = find_pool(ops.key)) return *known;
  pools_.push_back(std::make_unique<Pool>(ops));
  return *pools_.back();
}

CeresProblem::Table& CeresProblem::table(std::uint64_t key) {
  for (const auto& t : tables_)
    if (t->key == key) return *t;
  tables_.push_back(std::make_unique<Table>());
  tables_.back()->key = key;
  return *tables_.back();
}

HeldVariable* CeresProblem::find(VariableKey id) const {
  const Pool* p = find_pool(id.type);
  return p == nullptr ? nullptr : p->variables.find(id.key);
}

void CeresProblem::apply(const GraphEdit& net) {
  remove_factors(net);
  remove_variables(net);
  add_variables(net);
  add_factors(net);
  set_flags(net);
}

// Ceres puts the last in the place of what leaves, so the order of leaving is one of its order afterwards.
void CeresProblem::remove_factors(const GraphEdit& net) {
  std::vector<std::pair<std::uint64_t, std::pair<Table*, SlotKey>>> leaving;
  const auto leave = [&](std::uint64_t key, const std::vector<SlotKey>& removed) {
    Table& from = table(key);
    for (const SlotKey k : removed)
      if (const HeldFactor* f = from.factors.find(k)) leaving.push_back({f->serial, {&from, k}});
  };
  for (const auto& c : net.factor_columns()) leave(c->ops->key, c->removed);
  leave(PriorTable::kKey, net.priors().removed);
  sort_by_serial(leaving);
  for (const auto& [serial, factor] : leaving) {
    problem_->RemoveResidualBlock(factor.first->factors.find(factor.second)->block);
    factor.first->factors.erase(factor.second);
  }
}

void CeresProblem::remove_variables(const GraphEdit& net) {
  std::vector<std::pair<std::uint64_t, HeldVariable*>> leaving;
  for (const auto& c : net.variable_columns())
    for (const SlotKey k : c->removed)
      if (HeldVariable* v = pool(*c->ops).variables.find(k)) leaving.emplace_back(v->serial, v);
  sort_by_serial(leaving);
  for (const auto& [serial, v] : leaving) {
    if (v->ops->dim > 0) problem_->RemoveParameterBlock(v->value.data());
    pool(*v->ops).variables.erase(v->key);
  }
}

void CeresProblem::add_variables(const GraphEdit& net) {
  std::vector<std::pair<std::uint64_t, std::pair<const edit::Variables*, std::size_t>>> coming;
  for (const auto& c : net.variable_columns())
    for (std::size_t i = 0; i < c->added.size(); ++i) coming.push_back({c->added[i].serial, {c.get(), i}});
  sort_by_serial(coming);
  for (const auto& [serial, at] : coming) add_variable(*at.first, at.second);
}

void CeresProblem::add_variable(const edit::Variables& column, std::size_t i) {
  const edit::AddedVariable& a = column.added[i];
  Pool& p = pool(*column.ops);
  const auto size = static_cast<std::size_t>(block_size(*p.ops));
  HeldVariable& v = p.variables.add(a.key);
  v.ops = p.ops, v.serial = a.serial, v.fixed = a.fixed, v.has_first_estimate = a.has_first_estimate;
  v.value.assign(size, 0.0), v.first_estimate.assign(size, 0.0);
  std::memcpy(v.value.data(), column.values.at(i), p.ops->bytes);
  if (a.has_first_estimate) std::memcpy(v.first_estimate.data(), column.first_estimates.at(i), p.ops->bytes);
  if (p.ops->dim == 0) return;
  problem_->AddParameterBlock(v.value.data(), static_cast<int>(size), &p.manifold);
  set_freedom(p, v, a.freedom);
  if (v.fixed) problem_->SetParameterBlockConstant(v.value.data());
}

// Its residual blocks stay.
void CeresProblem::set_freedom(Pool& pool, HeldVariable& v, const Freedom& freedom) {
  if (v.freedom == freedom) return;
  v.freedom = freedom;
  std::unique_ptr<ceres::Manifold> before = std::move(v.manifold);  // until it is replaced
  if (!freedom.is_full()) v.manifold = std::make_unique<FreeManifold>(*v.ops, freedom);
  problem_->SetManifold(v.value.data(), v.manifold ? v.manifold.get() : &pool.manifold);
}

void CeresProblem::add_factors(const GraphEdit& net) {
  std::vector<std::pair<std::uint64_t, std::pair<const edit::Factors*, std::size_t>>> coming;  // null: a prior
  for (const auto& c : net.factor_columns())
    for (std::size_t i = 0; i < c->added.size(); ++i) coming.push_back({c->added[i].serial, {c.get(), i}});
  for (std::size_t i = 0; i < net.priors().added.size(); ++i)
    coming.push_back({net.priors().added[i].serial, {nullptr, i}});
  sort_by_serial(coming);
  for (const auto& [serial, at] : coming)
    if (at.first != nullptr)
      add_factor(*at.first, at.second);
    else
      add_prior(net.priors(), at.second);
}

// A variable of a row, and its block among those that the cost function has so far.
Argument CeresProblem::argument(VariableKey id, std::vector<double*>& blocks) const {
  HeldVariable* v = find(id);
  check(v != nullptr, "CeresProblem: a factor of a variable that the graph never told of");
  if (v->ops->dim == 0) return {v, -1};
  double* block = v->value.data();
  const auto known = std::find(blocks.begin(), blocks.end(), block);
  const Argument a{v, static_cast<int>(known - blocks.begin())};
  if (known == blocks.end()) blocks.push_back(block);
  return a;
}

void CeresProblem::add_factor(const edit::Factors& column, std::size_t i) {
  const FactorOps& ops = *column.ops;
  HeldFactor& f = table(ops.key).factors.add(column.added[i].key);
  f.serial = column.added[i].serial;
  std::vector<Argument> arguments;
  for (std::size_t k = 0; k < ops.variables.size(); ++k)
    arguments.push_back(argument({ops.variables[k]->key, column.variables[i * ops.variables.size() + k]}, f.blocks));
  auto cost = std::make_unique<FactorCost>(ops, column.measurements.at(i), column.noises.at(i), std::move(arguments),
                                           switches_);
  f.factor = cost.get();
  f.cost = std::move(cost);
  f.loss = std::make_unique<TableLoss>();  // of those without as well: a loss may be set later
  f.loss->set(column.added[i].loss);
  f.block = problem_->AddResidualBlock(f.cost.get(), f.loss.get(), f.blocks);
}

void CeresProblem::add_prior(const edit::Priors& priors, std::size_t i) {
  const edit::AddedPrior& a = priors.added[i];
  HeldFactor& f = table(PriorTable::kKey).factors.add(a.key);
  f.serial = a.serial;
  std::vector<Argument> arguments;
  for (std::uint32_t k = 0; k < a.variable_count; ++k)
    arguments.push_back(argument(priors.variables[a.variables + k], f.blocks));
  f.cost = std::make_unique<PriorCost>(std::span(priors.numbers).subspan(a.block, a.block_size), std::move(arguments));
  f.block = problem_->AddResidualBlock(f.cost.get(), nullptr, f.blocks);
}

// Values come with take_values.
void CeresProblem::set_flags(const GraphEdit& net) {
  for (const auto& c : net.variable_columns()) {
    for (std::size_t i = 0; i < c->set.size(); ++i) {
      HeldVariable* v = pool(*c->ops).variables.find(c->set[i].first);
      if (v == nullptr || c->set[i].second != edit::SetKind::first_estimate) continue;
      std::memcpy(v->first_estimate.data(), c->set_values.at(i), c->ops->bytes);
      v->has_first_estimate = true;
    }
    for (const auto& [key, fixed] : c->fixed) {
      HeldVariable* v = pool(*c->ops).variables.find(key);
      if (v == nullptr || v->fixed == fixed) continue;
      v->fixed = fixed;
      if (c->ops->dim == 0) continue;
      if (fixed)
        problem_->SetParameterBlockConstant(v->value.data());
      else
        problem_->SetParameterBlockVariable(v->value.data());
    }
    for (const auto& [key, freedom] : c->freedoms)
      if (HeldVariable* v = pool(*c->ops).variables.find(key)) set_freedom(pool(*c->ops), *v, freedom);
  }
  for (const auto& c : net.factor_columns())
    for (const auto& [key, loss] : c->losses)
      if (const HeldFactor* f = table(c->ops->key).factors.find(key)) f->loss->set(loss);
}

void CeresProblem::take_values(const Graph& graph) {
  for (const auto& from : graph.pools()) {
    const Pool* to = find_pool(from->ops().key);
    if (to == nullptr) continue;  // no variable of it yet
    for (std::uint32_t d = 0; d < from->extent(); ++d)
      if (from->slots().is_live(d))
        if (HeldVariable* v = to->variables.find(from->slots().key(d)))
          std::memcpy(v->value.data(), from->value(d), to->ops->bytes);
  }
}

double CeresProblem::cost() {
  double cost = 0.0;
  problem_->Evaluate({}, &cost, nullptr, nullptr, nullptr);
  return cost;
}

std::int64_t CeresProblem::freeze(bool first_estimates) {
  switches_.first_estimates = first_estimates;
  std::int64_t invalid = 0;
  for (const auto& t : tables_)
    t->factors.for_each([&invalid](const HeldFactor& f) {
      if (f.factor == nullptr) return;
      const bool valid = f.factor->valid_at(f.blocks.data());
      f.factor->freeze(valid);
      invalid += !valid;
    });
  return invalid;
}

void CeresProblem::thaw() {
  for (const auto& t : tables_)
    t->factors.for_each([](const HeldFactor& f) {
      if (f.factor != nullptr) f.factor->thaw();
    });
}

CeresProblem::Size CeresProblem::size() const {
  Size size;
  for (const auto& p : pools_)
    p->variables.for_each([&](const HeldVariable& v) {
      if (v.fixed) return;
      size.dim += v.ops->dim;
      size.has_landmarks = size.has_landmarks || v.ops->landmark;
    });
  size.factors = problem_->NumResidualBlocks();
  return size;
}

Solution CeresProblem::solution(std::uint64_t version) const {
  Solution solution;
  solution.version = version;
  for (const auto& p : pools_) {
    if (p->ops->dim == 0) continue;
    Solution::Column column{p->ops, {}, ByteColumn(p->ops->bytes)};
    p->variables.for_each([&column](const HeldVariable& v) {
      if (v.fixed) return;
      column.keys.push_back(v.key);
      column.values.push_back(v.value.data());
    });
    solution.columns.push_back(std::move(column));
  }
  return solution;
}

EngineContents CeresProblem::contents() const {
  EngineContents out;
  std::unordered_map<const double*, VariableKey> ids;
  for (const auto& p : pools_)
    p->variables.for_each([&](const HeldVariable& v) {
      const double* block = v.value.data();
      if (!problem_->HasParameterBlock(block) || problem_->IsParameterBlockConstant(block)) return;
      const VariableKey id{p->ops->key, v.key};
      const auto* value = reinterpret_cast<const std::byte*>(block);
      const auto* free = dynamic_cast<const FreeManifold*>(problem_->GetManifold(block));
      const Freedom freedom = free != nullptr ? free->freedom() : Freedom::full();
      const int dim = problem_->ParameterBlockTangentSize(block) + std::popcount(freedom.held);
      out.parameters.push_back({id, dim, {value, value + p->ops->bytes}, freedom});
      ids.emplace(block, id);
    });
  std::unordered_map<ceres::ResidualBlockId, FactorId> factors;
  for (const auto& t : tables_)
    t->factors.for_each([&](const HeldFactor& f) { factors.emplace(f.block, FactorId{t->key, f.key}); });
  std::vector<ceres::ResidualBlockId> residuals;
  problem_->GetResidualBlocks(&residuals);
  std::vector<double*> blocks;
  for (const ceres::ResidualBlockId block : residuals) {
    problem_->GetParameterBlocksForResidualBlock(block, &blocks);
    EngineContents::Residual residual{
        factors[block], problem_->GetCostFunctionForResidualBlock(block)->num_residuals(), {}};
    for (const double* b : blocks)
      if (const auto id = ids.find(b); id != ids.end()) residual.parameters.push_back(id->second);
    out.residuals.push_back(std::move(residual));
  }
  return out;
}

}  // namespace oriel::ceres_detail
