// From a batch (structure of arrays, dimensions only) to sums in blocks: H += JᵀJ, g += Jᵀr, and the landmark store.
// Eight lanes are multiplied at once, turned over in registers, and each is added where its row says.
#pragma once
#include <cstdint>

#include "oriel/linear/structure.h"
#include "oriel/residual/batch.h"

namespace oriel {

struct LinearSystem;

// Adds rows [first, first + batch.rows) of a plan. `kernel_fallbacks` counts products of dimensions without a fixed
// kernel (fixed: 1, 2, 3, 6, 7, 9).
void accumulate(const LinearStructure& structure, const TablePlan& plan, std::size_t first, const Batch& batch,
                LinearSystem& out, std::int64_t& kernel_fallbacks);

}  // namespace oriel
