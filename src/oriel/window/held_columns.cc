#include "oriel/window/held_columns.h"

#include <algorithm>

namespace oriel {

void HeldColumns::begin(const Graph& graph, const MarginalScope& scope) {
  held_.clear(), axes_.clear();
  const auto& variables = scope.variables();
  for (std::size_t i = 0; i < variables.size(); ++i) {
    const MarginalVariable& v = variables[i];
    if (!v.restricted) continue;
    const VariablePool& pool = *graph.pools()[v.pool];
    const auto dim = static_cast<std::size_t>(v.dim);
    held_.push_back({static_cast<std::int32_t>(i), v.dim, pool.freedom(v.dense), axes_.size()});
    if (turned_.size() < dim) turned_.resize(dim);
    if (held_.back().freedom.axes == Freedom::Axes::body) continue;
    axes_.resize(axes_.size() + dim * dim);
    pool.ops().world_axes(pool.value(v.dense), axes_.data() + held_.back().axes);
  }
}

const HeldColumns::Held* HeldColumns::find(std::int32_t variable) const {
  const auto h = std::lower_bound(held_.begin(), held_.end(), variable,
                                  [](const Held& a, std::int32_t v) { return a.variable < v; });
  return h != held_.end() && h->variable == variable ? &*h : nullptr;
}

// A row x of J becomes x Bᵀ without its held scalars: as a column, B x.
void HeldColumns::restrict_row(const Held& h, double* x, std::size_t stride) {
  const auto n = static_cast<std::size_t>(h.dim);
  if (h.freedom.axes == Freedom::Axes::world) {
    const double* B = axes_.data() + h.axes;
    for (std::size_t i = 0; i < n; ++i) {
      double sum = 0.0;
      for (std::size_t k = 0; k < n; ++k) sum += B[k * n + i] * x[k * stride];
      turned_[i] = sum;
    }
    for (std::size_t i = 0; i < n; ++i) x[i * stride] = turned_[i];
  }
  for (std::size_t i = 0; i < n; ++i)
    if (h.freedom.holds(static_cast<int>(i))) x[i * stride] = 0.0;
}

void HeldColumns::restrict(const AbsorbedBatch& absorbed, Batch& batch) {
  for (int l = 0; l < batch.rows; ++l)
    for (int a = 0; a < absorbed.arguments; ++a) {
      const Held* h = find(absorbed.variable[l * AbsorbedBatch::kLargestArity + a]);
      if (h == nullptr) continue;
      const std::size_t stride = static_cast<std::size_t>(batch.dim) * Batch::kRows;
      double* const J = batch.J + static_cast<std::size_t>(absorbed.argument[a].column) * stride + l;
      for (int i = 0; i < batch.dim; ++i) restrict_row(*h, J + static_cast<std::size_t>(i) * Batch::kRows, stride);
    }
}

void HeldColumns::restrict(const MarginalScope& scope, std::span<const std::int32_t> variables, int rows,
                           std::vector<double>& R) {
  std::size_t column = 0;
  for (const std::int32_t at : variables) {
    if (const Held* h = find(at))
      for (int i = 0; i < rows; ++i)
        restrict_row(*h, R.data() + column * static_cast<std::size_t>(rows) + i, static_cast<std::size_t>(rows));
    column += static_cast<std::size_t>(scope.variables()[static_cast<std::size_t>(at)].dim);
  }
}

int HeldColumns::rows(const MarginalScope& scope, const MarginalComponent& component) const {
  int n = 0;
  for (const Held& h : held_)
    if (&scope.components()[static_cast<std::size_t>(
            scope.variables()[static_cast<std::size_t>(h.variable)].component)] == &component)
      for (int i = 0; i < h.dim; ++i) n += h.freedom.holds(i);
  return n;
}

// One row and one column for each held scalar.
AbsorbedPrior HeldColumns::known(const MarginalScope& scope, const MarginalComponent& component) {
  targets_.clear();
  for (const Held& h : held_) {
    const MarginalVariable& v = scope.variables()[static_cast<std::size_t>(h.variable)];
    if (&scope.components()[static_cast<std::size_t>(v.component)] != &component) continue;
    for (int i = 0; i < h.dim; ++i)
      if (h.freedom.holds(i)) targets_.push_back(v.column + i);
  }
  const std::size_t n = targets_.size();
  ones_.assign(n * n, 0.0), zeros_.assign(n, 0.0);
  for (std::size_t i = 0; i < n; ++i) ones_[i * n + i] = 1.0;
  return {static_cast<int>(n), static_cast<int>(n), ones_.data(), zeros_.data(), targets_.data()};
}

}  // namespace oriel
