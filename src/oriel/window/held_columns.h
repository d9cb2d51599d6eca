// Leaving variables some of whose directions are held (graph/freedom.h): what is held is known, so what leaves is the
// rest. In the axes in which directions are named, d = Bᵀ y, columns J become J Bᵀ, those of held scalars are cleared,
// and a row of its own with 1 for each of them says that it does not move; it ties nothing. Variables that stay keep
// whole columns: what the prior says of a direction that is held today is there when it is free again.
#pragma once
#include <vector>

#include "oriel/window/absorbed_batch.h"

namespace oriel {

class HeldColumns {
 public:
  // B at the graph's values, where all that is absorbed is linearized.
  void begin(const Graph& graph, const MarginalScope& scope);
  bool empty() const { return held_.empty(); }

  // Rows that `restrict` adds to a component.
  int rows(const MarginalScope& scope, const MarginalComponent& component) const;
  void restrict(const AbsorbedBatch& absorbed, Batch& batch);
  // Columns of R, `rows` of them each, by the places of their variables.
  void restrict(const MarginalScope& scope, std::span<const std::int32_t> variables, int rows, std::vector<double>& R);
  // What a component's held scalars are told; good until the next call. Null rows: nothing.
  AbsorbedPrior known(const MarginalScope& scope, const MarginalComponent& component);

 private:
  struct Held {
    std::int32_t variable = 0;  // in the scope
    int dim = 0;
    Freedom freedom;
    std::size_t axes = 0;
  };
  const Held* find(std::int32_t variable) const;
  void restrict_row(const Held& h, double* x, std::size_t stride);

  std::vector<Held> held_;
  std::vector<double> axes_, turned_, ones_, zeros_;
  std::vector<std::int32_t> targets_;
};

}  // namespace oriel
