#include "oriel/window/factor_probe.h"

#include <algorithm>

#include "oriel/linear/row_pointers.h"

namespace oriel {

bool FactorProbe::look(const Graph& graph, FactorId id, bool with_jacobian) {
  const auto table = std::find_if(graph.tables().begin(), graph.tables().end(),
                                  [&](const auto& t) { return t->ops().key == id.table; });
  if (table == graph.tables().end()) return false;
  const std::uint32_t row = (*table)->slots().find(id.key);
  if (row == SlotIndex::kNone) return false;
  ids_.clear();
  for (const VariableRef& ref : (*table)->variables(row)) {
    const VariablePool& pool = *graph.pools()[ref.pool];
    ids_.emplace_back(pool.ops().key, pool.slots().key_of_slot(ref.slot));
  }
  return look(graph, {&(*table)->ops(), (*table)->measurement(row), (*table)->noise(row), (*table)->loss(row), ids_},
              with_jacobian);
}

bool FactorProbe::look(const Graph& graph, const DetachedFactor& f, bool with_jacobian) {
  constexpr std::size_t kLanes = Pack::kLanes;
  RowPointerArrays arrays;
  ops_ = f.ops;
  loss_ = f.loss;
  cols_ = 0;
  variables_.clear();
  for (std::size_t k = 0; k < f.variables.size(); ++k) {
    const void* const value = graph.find_value(f.variables[k]);
    if (value == nullptr) return false;
    std::fill_n(arrays.at + k * Batch::kRows, kLanes, value);
    if (ops_->variables[k]->dim == 0) continue;
    cols_ += ops_->variables[k]->dim;
    variables_.push_back(f.variables[k]);
  }
  for (std::size_t l = 0; l < kLanes; ++l)
    arrays.measurement[l] = f.measurement, arrays.noise[l] = f.noise, arrays.loss[l] = &f.loss;
  RowPointers pointers;
  pointers.rows = 1;
  pointers.measurement = arrays.measurement, pointers.noise = arrays.noise, pointers.loss = arrays.loss;
  pointers.at = pointers.jacobian_at = arrays.at;
  r_.reserve(std::int64_t{Batch::kRows} * ops_->dim);
  j_.reserve(std::int64_t{Batch::kRows} * ops_->dim * cols_);
  Batch batch;
  batch.r = r_.data(), batch.J = with_jacobian ? j_.data() : nullptr;
  ops_->linearize(pointers, batch);
  valid_ = (batch.valid & 1u) != 0;
  return true;
}

double FactorProbe::residual(int i) const { return r_.data()[i * Batch::kRows]; }

double FactorProbe::jacobian(int i, int column) const { return j_.data()[(column * ops_->dim + i) * Batch::kRows]; }

double FactorProbe::weight() const { return evaluate_loss(loss_, squared_norm()).weight; }

double FactorProbe::squared_norm() const {
  double s = 0.0;
  for (int i = 0; i < dim(); ++i) s += residual(i) * residual(i);
  return s;
}

void GroupPruner::finish(const Graph& graph, std::span<const VariableKey> variables, GraphEdit& edit) {
  if (dropped_.empty()) return;
  for (const VariableKey& v : variables) {
    bool left = false;
    graph.for_each_factor(v, [&](std::uint32_t table, std::uint32_t row) {
      if (table == Graph::kPriorTable) {
        left = true;
        return;
      }
      const FactorTable& t = *graph.tables()[table];
      const FactorId id{t.ops().key, t.slots().key(row)};
      left = left || std::find(dropped_.begin(), dropped_.end(), id) == dropped_.end();
    });
    if (!left) edit.remove(v);
  }
  dropped_.clear();
}

}  // namespace oriel
