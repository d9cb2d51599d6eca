#include "oriel/linear/evaluate_rows.h"

#include "oriel/linear/row_pointers.h"

namespace oriel {

void evaluate_rows(const Graph& graph, const FactorTable& table, std::span<const std::uint32_t> rows,
                   const Point* point, bool first_estimates, double* r, double* j, Batch& batch) {
  RowPointerArrays arrays;
  auto row = [&](std::size_t l) { return rows[l]; };
  auto dense = [&](std::size_t l, std::size_t k) {
    const VariableRef& ref = table.variables(rows[l])[k];
    return graph.pools()[ref.pool]->slots().dense(ref.slot);
  };
  batch.r = r;
  batch.J = j;
  RowPointers pointers;
  pointers.robust = table.robust();
  point_measurements(table, rows.size(), row, arrays, pointers);
  point_values(graph, table.variables(rows[0]), rows.size(), point, first_estimates && j != nullptr, dense, arrays,
               pointers);
  table.ops().linearize(pointers, batch);
}

}  // namespace oriel
