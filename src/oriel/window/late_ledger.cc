#include "oriel/window/late_ledger.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "oriel/linear/dot.h"
#include "oriel/window/echelon.h"

namespace oriel {

std::string_view name_of(LateOutcome outcome) {
  constexpr std::string_view kNames[kLateOutcomes] = {"folded",   "live",    "forgotten", "removed",
                                                      "landmark", "invalid", "outlier",   "undetermined"};
  return kNames[static_cast<int>(outcome)];
}

LateOutcome LateLedger::counted(LateOutcome outcome) {
  ++counts_[static_cast<int>(outcome)];
  return outcome;
}

LateOutcome LateLedger::fold(const Graph& graph, const DetachedFactor& factor, GraphEdit& edit) {
  if (const LateOutcome cut = walk(graph, {}, {&factor, 1}); cut != LateOutcome::folded) return counted(cut);
  if (way_.empty()) return counted(LateOutcome::live);
  smooth();
  begin_rows(factor.ops->dim);
  if (const LateOutcome bad = evaluate(factor, 0); bad != LateOutcome::folded) return counted(bad);
  for (const std::int32_t entry : way_) updated_ += push(entry) ? 1 : 0;
  write_prior(graph, edit);
  return counted(LateOutcome::folded);
}

// p(s | neighbours): Gauss–Newton steps of s alone put it where its halves want it, then the first rows of their
// echelon form are its conditional.
LateOutcome LateLedger::add_state(const Graph& graph, std::span<const DetachedVariable> state,
                                  std::span<const DetachedFactor> halves) {
  constexpr int kSteps = 4;
  if (const LateOutcome cut = walk(graph, state, halves); cut != LateOutcome::folded) return counted(cut);
  smooth();
  int rows = 0, dim = 0;
  for (const DetachedFactor& f : halves) rows += f.ops->dim;
  for (const DetachedVariable& v : state) dim += v.ops->dim;
  empty_.assign(static_cast<std::size_t>(columns_), 0);
  for (int step = 0;; ++step) {
    begin_rows(rows);
    int first = 0;
    for (const DetachedFactor& f : halves) {
      if (const LateOutcome bad = evaluate(f, first); bad != LateOutcome::folded) return counted(bad);
      first += f.ops->dim;
    }
    const StackedColumns a{rows_.data(), static_cast<std::size_t>(row_count_), row_count_};
    std::fill(empty_.begin(), empty_.end(), 0);
    if (reduce_to_echelon(a, 0, dim, columns_ + 1, 0, empty_.data()) < dim) return counted(LateOutcome::undetermined);
    if (step == kSteps) break;
    move_state(state.size(), dim);
  }
  keep_state(state.size(), dim);
  return counted(LateOutcome::folded);
}

// s := s ⊞ δ, R δ = -(d + S e) of the rows that are in echelon form.
void LateLedger::move_state(std::size_t variables, int dim) {
  std::vector<double>& right = right_;
  right.assign(row_column(columns_), row_column(columns_) + dim);
  for (const Stop& s : stops_) {
    if (s.column < dim) continue;
    error_.resize(static_cast<std::size_t>(s.ops->dim));
    s.ops->minus(s.value, s.reference, error_.data());
    for (int c = 0; c < s.ops->dim; ++c)
      for (int i = 0; i < dim; ++i) right[i] += row_column(s.column + c)[i] * error_[c];
  }
  solve_upper_minus(rows_.data(), row_count_, dim, right.data());
  for (std::size_t i = 0; i < variables; ++i) {
    Stop& s = stops_[i];
    const std::int32_t offset = s.column;
    s.ops->plus(1, s.value, right.data(), &offset, values_.data() + s.smoothed);
  }
}

void LateLedger::keep_state(std::size_t variables, int dim) {
  const std::int32_t at = store_.acquire(options_.conditionals);
  Conditional& c = store_.at(at);
  c.leaving = static_cast<int>(variables);
  c.rows = dim;
  for (const Stop& s : stops_) {
    if (s.column < 0) continue;
    const bool silent = s.column >= dim && !touches(s, dim);
    if (silent) continue;
    c.add(s.id, *s.ops, s.reference, c.cols);
    for (int i = 0; i < s.ops->dim; ++i, ++c.cols)
      c.numbers.insert(c.numbers.end(), row_column(s.column + i), row_column(s.column + i) + dim);
  }
  c.numbers.insert(c.numbers.end(), row_column(columns_), row_column(columns_) + dim);
  store_.add_oldest(at);
}

bool LateLedger::smoothed(const Graph& graph, VariableKey id, void* to) {
  const DetachedFactor probe{nullptr, nullptr, nullptr, {}, {&id, 1}};
  if (walk(graph, {}, {&probe, 1}) != LateOutcome::folded) return false;
  smooth();
  const Stop& s = stop_of(id);
  std::memcpy(to, s.value, s.ops->bytes);
  return true;
}

// ---- what marginalization gives ----

namespace {

struct Estimates {
  const void *reference, *value;
};
Estimates estimates_of(const Graph& graph, const MarginalVariable& v, bool first_estimates) {
  const VariablePool& pool = *graph.pools()[v.pool];
  const void* const value = pool.value(v.dense);
  return {first_estimates && pool.has_first_estimate(v.dense) ? pool.first_estimate(v.dense) : value, value};
}

// [0; R], columns of one variable: above is the triangle that all rows are brought into.
void append_columns(Conditional& c, const VariableOps& ops, VariableKey id, const void* reference, const double* R,
                    int rows) {
  c.add(id, ops, reference, c.cols);
  c.cols += ops.dim;
  for (int i = 0; i < ops.dim; ++i, R += rows) {
    c.numbers.insert(c.numbers.end(), static_cast<std::size_t>(c.rows), 0.0);
    c.numbers.insert(c.numbers.end(), R, R + rows);
  }
}

// x ⊟ x0 = (x ⊟ x̂) - (x0 ⊟ x̂).
void shift_right(const VariableOps& ops, const void* value, const void* reference, const double* R, int rows,
                 std::vector<double>& d, std::vector<double>& error) {
  error.resize(static_cast<std::size_t>(ops.dim));
  ops.minus(value, reference, error.data());
  for (int i = 0; i < ops.dim; ++i, R += rows)
    for (int k = 0; k < rows; ++k) d[k] -= R[k] * error[i];
}

}  // namespace

void LateLedger::stage(const Graph& graph, const MarginalScope& scope, const MarginalComponent& component,
                       const SquareRootRows& root) {
  if (component.leaving_dim == 0) return;
  const int rows = root.conditional_rows, n = component.leaving_dim;
  const std::int32_t at = store_.acquire(options_.conditionals);
  Conditional& c = store_.at(at);
  c.rows = n;
  std::vector<double>& d = right_;
  d.assign(root.conditional_d.begin(), root.conditional_d.end());
  for (std::uint32_t o = component.variables_begin; o < component.variables_end; ++o) {
    const MarginalVariable& v = scope.variables()[scope.ordered()[o]];
    if (v.eliminated) continue;
    const double* const R = root.conditional_R.data() + static_cast<std::ptrdiff_t>(v.column) * rows;
    const bool leaves = v.column < n;
    const auto size = static_cast<std::ptrdiff_t>(v.dim) * rows;
    if (!leaves && std::all_of(R, R + size, [](double x) { return x == 0.0; })) continue;
    c.leaving += leaves ? 1 : 0;
    const Estimates x = estimates_of(graph, v, options_.first_estimates);
    append_columns(c, graph.pools()[v.pool]->ops(), v.id, x.reference, R, rows);
    if (x.reference != x.value) shift_right(graph.pools()[v.pool]->ops(), x.value, x.reference, R, rows, d, error_);
  }
  c.numbers.insert(c.numbers.end(), static_cast<std::size_t>(n), 0.0);
  c.numbers.insert(c.numbers.end(), d.begin(), d.end());
  make_triangular(c, rows);
  store_.add_newest(at);
}

// Of [0; rows]: their triangle alone. Where they are one already, it is moved up.
void LateLedger::make_triangular(Conditional& c, int rows) {
  const int n = c.rows, stride = n + rows;
  bool is_triangular = rows == n;
  for (int j = 0; j < n && is_triangular; ++j) {
    const double* const column = c.numbers.data() + static_cast<std::ptrdiff_t>(j) * stride + n;
    is_triangular = std::all_of(column + j + 1, column + rows, [](double x) { return x == 0.0; });
  }
  if (!is_triangular) {
    std::vector<double>& whole = stacked_;
    whole.resize(static_cast<std::size_t>(n));
    for (int j = 0; j < n; ++j) {
      const double* const column = c.numbers.data() + static_cast<std::ptrdiff_t>(j) * stride + n;
      whole[j] = std::sqrt(dot(column, column, rows));
    }
    eliminate_rows(c.numbers.data(), n, rows, c.cols + 1, whole.data());
  }
  for (int j = 0; j <= c.cols; ++j) {
    const double* const from = c.numbers.data() + static_cast<std::ptrdiff_t>(j) * stride + (is_triangular ? n : 0);
    std::memmove(c.numbers.data() + static_cast<std::ptrdiff_t>(j) * n, from,
                 sizeof(double) * static_cast<std::size_t>(n));
  }
  c.numbers.resize(static_cast<std::size_t>(n) * static_cast<std::size_t>(c.cols + 1));
}

void LateLedger::stage_known(const Graph& graph, const MarginalScope& scope) {
  std::int32_t at = -1;
  for (const MarginalVariable& v : scope.variables()) {
    if (v.role != MarginalVariable::Role::leaving || !v.fixed) continue;
    if (at < 0) at = store_.acquire(options_.conditionals);
    const VariablePool& pool = *graph.pools()[v.pool];
    store_.at(at).add(v.id, pool.ops(), pool.value(v.dense), -1);
    ++store_.at(at).leaving;
  }
  if (at >= 0) store_.add_newest(at);
}

}  // namespace oriel
