// V, g and W of the landmarks that the rows of a batch touch.
#pragma once
#include <cstddef>
#include <cstdint>

#include "oriel/linear/structure.h"
#include "oriel/residual/batch.h"

namespace oriel {

struct LinearSystem;

// Adds what rows [first, first + batch.rows) of a plan with a landmark argument say about landmarks.
void accumulate_landmarks(const LinearStructure& structure, const TablePlan& plan, std::size_t first,
                          const Batch& batch, LinearSystem& out, std::int64_t& kernel_fallbacks);

}  // namespace oriel
