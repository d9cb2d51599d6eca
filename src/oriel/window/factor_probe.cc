#include "oriel/window/factor_probe.h"

#include <algorithm>

#include "oriel/linear/evaluate_rows.h"

namespace oriel {

bool FactorProbe::look(const Graph& graph, FactorId id, bool with_jacobian) {
  const auto table = std::find_if(graph.tables().begin(), graph.tables().end(),
                                  [&](const auto& t) { return t->ops().key == id.table; });
  if (table == graph.tables().end()) return false;
  const std::uint32_t row = (*table)->slots().find(id.key);
  if (row == SlotIndex::kNone) return false;
  ops_ = &(*table)->ops();
  cols_ = 0;
  variables_.clear();
  for (int k = 0; k < (*table)->arity(); ++k) {
    const VariableRef& ref = (*table)->variables(row)[static_cast<std::size_t>(k)];
    const VariablePool& pool = *graph.pools()[ref.pool];
    cols_ += pool.ops().dim;
    if (pool.ops().dim > 0) variables_.emplace_back(pool.ops().key, pool.slots().key_of_slot(ref.slot));
  }
  r_.reserve(std::int64_t{Batch::kRows} * ops_->dim);
  j_.reserve(std::int64_t{Batch::kRows} * ops_->dim * cols_);
  Batch batch;
  evaluate_rows(graph, **table, {&row, 1}, nullptr, false, r_.data(), with_jacobian ? j_.data() : nullptr, batch);
  valid_ = (batch.valid & 1u) != 0;
  weight_ = (*table)->robust() ? batch.weight[0] : 1.0;
  if (!(weight_ > 0.0)) weight_ = 1.0;  // a loss that ends: r is zero, and that is all there is to see
  return true;
}

double FactorProbe::residual(int i) const { return r_.data()[i * Batch::kRows] / weight_; }

double FactorProbe::jacobian(int i, int column) const {
  return j_.data()[(column * ops_->dim + i) * Batch::kRows] / weight_;
}

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
