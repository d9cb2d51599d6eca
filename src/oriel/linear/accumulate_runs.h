// Sums over runs: rows of a batch that name the same kept variables (structure_runs.cc).
#pragma once
#include <cstddef>
#include <cstdint>

#include "oriel/linear/structure.h"
#include "oriel/residual/batch.h"

namespace oriel {

struct LinearSystem;

// H += JᵀJ and g += Jᵀr of the kept variables, for the runs of the batch of rows [first, first + batch.rows).
void accumulate_runs(const TablePlan& plan, std::size_t first, const Batch& batch, LinearSystem& out,
                     std::int64_t& kernel_fallbacks);

}  // namespace oriel
