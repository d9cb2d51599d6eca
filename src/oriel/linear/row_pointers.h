// Where up to 64 rows of a table find their values: the arrays behind a RowPointers, and how they are filled.
#pragma once
#include <algorithm>
#include <cstring>
#include <span>

#include "oriel/graph/graph.h"
#include "oriel/linear/point.h"
#include "oriel/residual/batch.h"

namespace oriel {

struct RowPointerArrays {
  static constexpr std::size_t kRows = Batch::kRows, kMostArguments = 16;
  const void *measurement[kRows], *noise[kRows], *at[kMostArguments * kRows], *estimate[kMostArguments * kRows];
  const Loss* loss[kRows];
};

// Measurement, noise and loss of rows row(0) … row(n - 1) of `table`, n <= 64. Lanes up to the next multiple of eight
// repeat the last row.
template <class Row>
void point_measurements(const FactorTable& table, std::size_t n, Row row, RowPointerArrays& arrays, RowPointers& out) {
  for (std::size_t l = 0; l < (n + 7) / 8 * 8; ++l) {
    const std::uint32_t at = row(std::min(l, n - 1));
    arrays.measurement[l] = table.measurement(at);
    arrays.noise[l] = table.noise(at);
    arrays.loss[l] = &table.loss(at);
  }
  out.measurement = arrays.measurement;
  out.noise = arrays.noise;
  out.loss = arrays.loss;
}

// What eight rows (of a residual that is evaluated over packs) measured, as RowPointers::packed has it: one group.
inline void pack_rows(const void* const* measurement, int measurement_doubles, const void* const* noise,
                      int noise_doubles, const Loss* const* loss, double* to) {
  constexpr int kLanes = Pack::kLanes;
  for (int l = 0; l < kLanes; ++l) {
    double* out = to + l;
    const double* m = static_cast<const double*>(measurement[l]);
    for (int i = 0; i < measurement_doubles; ++i, out += kLanes) *out = m[i];
    const double* n = static_cast<const double*>(noise[l]);
    for (int i = 0; i < noise_doubles; ++i, out += kLanes) *out = n[i];
    if (loss == nullptr) continue;
    out[0] = loss[l]->scale;
    out[kLanes] = static_cast<double>(loss[l]->kind);
    std::memcpy(out + 2 * kLanes, &loss[l], sizeof(void*));
  }
}

// Their values: dense(l, k) is the position of argument k. They are those of `point`, or the graph's own where it is
// null; Jacobians are taken at first estimates if these are asked for (decision 9). `refs`: the variables of any row,
// since pools are the same in every row.
template <class Dense>
void point_values(const Graph& graph, std::span<const VariableRef> refs, std::size_t n, const Point* point,
                  bool first_estimates, Dense dense, RowPointerArrays& arrays, RowPointers& out) {
  constexpr std::size_t kRows = RowPointerArrays::kRows;
  const std::size_t end = (n + 7) / 8 * 8;
  bool apart = false;
  for (std::size_t k = 0; k < refs.size(); ++k) {
    const VariablePool& pool = *graph.pools()[refs[k].pool];
    const std::byte* column = point != nullptr ? point->column(refs[k].pool) : pool.values();
    const std::size_t bytes = pool.ops().bytes;
    const void **at = arrays.at + k * kRows, **estimate = arrays.estimate + k * kRows;
    for (std::size_t l = 0; l < n; ++l) at[l] = column + dense(l, k) * bytes;
    std::fill(at + n, at + end, at[n - 1]);
    if (!first_estimates) continue;
    std::copy(at, at + end, estimate);
    if (pool.first_estimate_count() == 0) continue;
    for (std::size_t l = 0; l < end; ++l) {
      const std::uint32_t d = dense(std::min(l, n - 1), k);
      if (pool.has_first_estimate(d)) estimate[l] = pool.first_estimate(d), apart = true;
    }
  }
  out.rows = static_cast<int>(n);
  out.at = arrays.at;
  out.jacobian_at = apart ? arrays.estimate : arrays.at;
}

}  // namespace oriel
