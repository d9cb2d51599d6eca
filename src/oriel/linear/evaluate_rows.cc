#include "oriel/linear/evaluate_rows.h"

#include <algorithm>

namespace oriel {
namespace {

constexpr std::size_t kRows = Batch::kRows;

struct Pointers {
  const void *measurement[kRows], *noise[kRows], *at[16 * kRows], *estimate[16 * kRows];
  const Loss* loss[kRows];
};

}  // namespace

void evaluate_rows(const Graph& graph, const FactorTable& table, std::span<const std::uint32_t> rows,
                   const Point* point, bool first_estimates, double* r, double* j, Batch& batch) {
  const std::size_t n = rows.size(), end = (n + 7) / 8 * 8, arity = static_cast<std::size_t>(table.arity());
  Pointers p;
  for (std::size_t l = 0; l < end; ++l) {  // past the end: the last row again
    const std::uint32_t row = rows[std::min(l, n - 1)];
    p.measurement[l] = table.measurement(row);
    p.noise[l] = table.noise(row);
    p.loss[l] = &table.loss(row);
  }
  bool apart = false;
  for (std::size_t k = 0; k < arity; ++k) {
    const std::uint32_t index = table.variables(rows[0])[k].pool;  // pools are the same in every row
    const VariablePool& pool = *graph.pools()[index];
    const std::byte* column = point != nullptr ? point->column(index) : pool.values();
    const bool estimates = first_estimates && j != nullptr && pool.first_estimate_count() > 0;
    for (std::size_t l = 0; l < end; ++l) {
      const std::uint32_t d = pool.slots().dense(table.variables(rows[std::min(l, n - 1)])[k].slot);
      p.at[k * kRows + l] = p.estimate[k * kRows + l] = column + std::size_t{d} * pool.ops().bytes;
      if (estimates && pool.has_first_estimate(d)) p.estimate[k * kRows + l] = pool.first_estimate(d), apart = true;
    }
  }
  RowPointers pointers;
  pointers.rows = static_cast<int>(n);
  pointers.measurement = p.measurement;
  pointers.noise = p.noise;
  pointers.loss = table.robust() ? p.loss : nullptr;
  pointers.at = p.at;
  pointers.jacobian_at = apart ? p.estimate : p.at;
  batch.r = r;
  batch.J = j;
  table.ops().linearize(pointers, batch);
}

}  // namespace oriel
