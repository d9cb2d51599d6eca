// Some rows of one table, evaluated where they stand: what marginalization and reports ask for, without the layout of a
// whole linear problem.
#pragma once
#include <cstdint>
#include <span>

#include "oriel/graph/graph.h"
#include "oriel/linear/point.h"
#include "oriel/residual/batch.h"

namespace oriel {

// Evaluates up to Batch::kRows rows (live, at least one) of a table of `graph` at `point`, or at the graph's own values
// where it is null. With `first_estimates`, Jacobians are taken there for the variables that have one, residuals never
// (decision 9). r: 64 × dim; j: 64 × dim × cols, or null where only costs are wanted; both 64-byte aligned.
void evaluate_rows(const Graph& graph, const FactorTable& table, std::span<const std::uint32_t> rows,
                   const Point* point, bool first_estimates, double* r, double* j, Batch& batch);

}  // namespace oriel
