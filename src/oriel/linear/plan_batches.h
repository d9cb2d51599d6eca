// How a table of factors falls into batches.
#pragma once
#include <cstdint>

#include "oriel/graph/graph.h"
#include "oriel/linear/structure.h"
#include "oriel/residual/batch.h"

namespace oriel {

inline std::size_t batches_of(const TablePlan& plan) { return (plan.rows.size() + Batch::kRows - 1) / Batch::kRows; }

// [doubles] of r of a batch, or of r and J.
inline std::int64_t doubles_of(const TablePlan& plan, bool jacobians) {
  const int dim = plan.table->ops().dim;
  int cols = 0;
  for (const auto& a : plan.arguments) cols += a.dim;
  return std::int64_t{Batch::kRows} * dim * (1 + (jacobians ? cols : 0));
}

}  // namespace oriel
