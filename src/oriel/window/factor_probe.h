// FactorProbe: one factor at the graph's values, without its loss, for hooks that judge it.
#pragma once
#include <span>
#include <vector>

#include "oriel/graph/graph.h"
#include "oriel/linear/aligned_buffer.h"
#include "oriel/window/detached_factor.h"

namespace oriel {

class FactorProbe {
 public:
  // False for priors and what is not in the graph: there is nothing to judge.
  bool look(const Graph& graph, FactorId id, bool with_jacobian);
  // One that is not in the graph; its variables are.
  bool look(const Graph& graph, const DetachedFactor& factor, bool with_jacobian);

  bool valid() const { return valid_; }
  const FactorOps& ops() const { return *ops_; }
  int dim() const { return ops_->dim; }
  int cols() const { return cols_; }
  // Whitened.
  double residual(int i) const;
  double jacobian(int i, int column) const;
  double squared_norm() const;  // of the residual
  double weight() const;        // ρ'(‖r‖²), which the factor's loss gives it
  // Those with columns, in the order of the residual's.
  std::span<const VariableKey> variables() const { return variables_; }

 private:
  const FactorOps* ops_ = nullptr;
  bool valid_ = false;
  int cols_ = 0;
  Loss loss_;
  std::vector<VariableKey> ids_, variables_;
  AlignedBuffer r_, j_;
};

// Takes factors out of a group that has just entered, and the group's own variables that no factor is left for.
class GroupPruner {
 public:
  void drop(GraphEdit& edit, FactorId id) {
    dropped_.push_back(id);
    edit.remove(id);
  }
  int dropped() const { return static_cast<int>(dropped_.size()); }
  // The last call. `variables`: those that came with the group.
  void finish(const Graph& graph, std::span<const VariableKey> variables, GraphEdit& edit);

 private:
  std::vector<FactorId> dropped_;
};

}  // namespace oriel
