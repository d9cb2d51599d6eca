// How a late factor travels: the way, the smoothed values on it, and the reflections.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <tuple>

#include "oriel/linear/dot.h"
#include "oriel/linear/row_pointers.h"
#include "oriel/window/echelon.h"
#include "oriel/window/late_ledger.h"

namespace oriel {
namespace {

bool all_zero(const double* x, std::ptrdiff_t n) {
  return std::all_of(x, x + n, [](double e) { return e == 0.0; });
}

// Of columns that stand apart.
bool silent(const double* x, int rows, std::ptrdiff_t stride, int columns) {
  bool all = true;
  for (int j = 0; j < columns; ++j) all = all && all_zero(x + stride * j, rows);
  return all;
}

// At 16 bytes' alignment, as in a pool.
std::size_t value_doubles(const VariableOps& ops) { return (estimate_doubles(ops) + 1) / 2 * 2; }

}  // namespace

// Every entry that the factors' variables lead to, and every live variable at its end.
LateOutcome LateLedger::walk(const Graph& graph, std::span<const DetachedVariable> state,
                             std::span<const DetachedFactor> factors) {
  way_.clear();
  stops_.clear();
  for (const DetachedVariable& v : state) stops_.push_back({v.id, v.ops, kNew, 0, v.value, v.value, 0, 0, 0});
  for (const DetachedFactor& f : factors)
    for (const VariableKey& id : f.variables)
      if (const LateOutcome cut = visit(graph, id); cut != LateOutcome::folded) return cut;
  for (std::size_t i = 0; i < way_.size(); ++i) {
    const Conditional& c = store_.latest(way_[i]);
    for (std::size_t k = static_cast<std::size_t>(c.leaving); k < c.variables.size(); ++k)
      if (const LateOutcome cut = visit(graph, c.variables[k].id); cut != LateOutcome::folded) return cut;
  }
  lay_out();
  return LateOutcome::folded;
}

LateOutcome LateLedger::visit(const Graph& graph, VariableKey id) {
  for (const Stop& s : stops_)
    if (s.id == id) return LateOutcome::folded;
  const VariablePool* const pool = graph.find_pool(id.type);
  const std::uint32_t dense = pool == nullptr ? SlotIndex::kNone : pool->slots().find(id.key);
  if (dense != SlotIndex::kNone) {
    const void* const value = pool->value(dense);
    const bool estimated = options_.first_estimates && pool->has_first_estimate(dense);
    stops_.push_back({id, &pool->ops(), kLive, pool->ops().dim > 0 ? 0 : -1,
                      estimated ? pool->first_estimate(dense) : value, value, 0, 0, 0});
    return LateOutcome::folded;
  }
  const ConditionalStore::Place* const place = store_.find(id);
  if (place == nullptr) {
    if (store_.was_forgotten(id)) return LateOutcome::forgotten;
    return pool != nullptr && pool->ops().landmark ? LateOutcome::landmark : LateOutcome::removed;
  }
  way_.push_back(place->entry);
  const Conditional& c = store_.latest(place->entry);
  for (int i = 0; i < c.leaving; ++i) {
    const Conditional::Variable& v = c.variables[static_cast<std::size_t>(i)];
    stops_.push_back({v.id, v.ops, place->entry, v.column < 0 ? -1 : 0, c.estimate(v), c.estimate(v), 0, 0, 0});
  }
  return LateOutcome::folded;
}

// Columns in the order of elimination, live variables last; room for the values that are to be found.
void LateLedger::lay_out() {
  for (std::size_t i = 0; i < stops_.size(); ++i) stops_[i].local = static_cast<int>(i);  // in the order of discovery
  auto rank = [this](const Stop& s) {
    const std::int64_t order = s.entry == kNew ? INT64_MIN : s.entry == kLive ? INT64_MAX : store_.order(s.entry);
    return std::tuple(order, s.local);
  };
  std::sort(stops_.begin(), stops_.end(), [&](const Stop& a, const Stop& b) { return rank(a) < rank(b); });
  std::sort(way_.begin(), way_.end(),
            [this](std::int32_t a, std::int32_t b) { return store_.order(a) < store_.order(b); });
  columns_ = 0;
  std::size_t doubles = 0;
  for (Stop& s : stops_) {
    if (s.column >= 0) s.column = columns_, columns_ += s.ops->dim;
    s.smoothed = doubles;
    if (s.entry != kLive) doubles += 2 * value_doubles(*s.ops);
  }
  values_.assign(doubles, 0.0);
  for (Stop& s : stops_) {  // copies, since blocks of the store move when one of them grows
    if (s.entry == kLive) continue;
    double* const value = values_.data() + s.smoothed;
    double* const reference = s.entry == kNew ? value : value + value_doubles(*s.ops);
    std::memcpy(value, s.value, s.ops->bytes);
    std::memcpy(reference, s.reference, s.ops->bytes);
    s.value = value, s.reference = reference;
  }
  by_id_.resize(stops_.size());
  for (std::size_t i = 0; i < stops_.size(); ++i) by_id_[i] = static_cast<std::int32_t>(i);
  auto key = [this](std::int32_t i) {
    const VariableKey& id = stops_[static_cast<std::size_t>(i)].id;
    return std::tuple(id.type, id.key.index, id.key.generation);
  };
  std::sort(by_id_.begin(), by_id_.end(), [&](std::int32_t a, std::int32_t b) { return key(a) < key(b); });
}

LateLedger::Stop& LateLedger::stop_of(VariableKey id) {
  const auto wanted = std::tuple(id.type, id.key.index, id.key.generation);
  const auto at = std::lower_bound(by_id_.begin(), by_id_.end(), wanted, [this](std::int32_t i, const auto& w) {
    const VariableKey& k = stops_[static_cast<std::size_t>(i)].id;
    return std::tuple(k.type, k.key.index, k.key.generation) < w;
  });
  return stops_[static_cast<std::size_t>(*at)];
}

// Back substitution, newest entry first: R δ = -(d + S e), x_L = x̂_L ⊞ δ. What nothing determines stays at x̂.
void LateLedger::smooth() {
  for (std::size_t w = way_.size(); w-- > 0;) {
    const Conditional& c = store_.latest(way_[w]);
    if (c.rows == 0) continue;
    right_.assign(c.column(c.cols), c.column(c.cols) + c.rows);
    for (std::size_t k = static_cast<std::size_t>(c.leaving); k < c.variables.size(); ++k) {
      const Conditional::Variable& v = c.variables[k];
      error_.resize(static_cast<std::size_t>(v.ops->dim));
      v.ops->minus(stop_of(v.id).value, c.estimate(v), error_.data());
      for (int j = 0; j < v.ops->dim; ++j)
        for (int i = 0; i < c.rows; ++i) right_[static_cast<std::size_t>(i)] += c.column(v.column + j)[i] * error_[j];
    }
    solve_upper_minus(c.numbers.data(), c.rows, c.rows, right_.data());
    for (int i = 0; i < c.leaving; ++i) {
      const Conditional::Variable& v = c.variables[static_cast<std::size_t>(i)];
      const std::int32_t offset = v.column;
      v.ops->plus(1, c.estimate(v), right_.data(), &offset, values_.data() + stop_of(v.id).smoothed);
    }
  }
}

void LateLedger::begin_rows(int rows) {
  row_count_ = rows;
  rows_.assign(static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns_ + 1), 0.0);
  bound_.assign(static_cast<std::size_t>(columns_), 0.0);
}

// Rows of one factor from `first` on: r + J (x ⊟ x_now) = (r - J (x_now ⊟ x̂)) + J (x ⊟ x̂).
LateOutcome LateLedger::evaluate(const DetachedFactor& f, int first) {
  constexpr std::size_t kLanes = Pack::kLanes;
  RowPointerArrays arrays;
  int cols = 0;
  for (std::size_t l = 0; l < kLanes; ++l)
    arrays.measurement[l] = f.measurement, arrays.noise[l] = f.noise, arrays.loss[l] = &f.loss;
  for (std::size_t k = 0; k < f.variables.size(); ++k) {
    const Stop& s = stop_of(f.variables[k]);
    std::fill_n(arrays.at + k * Batch::kRows, kLanes, s.value);
    std::fill_n(arrays.estimate + k * Batch::kRows, kLanes, options_.first_estimates ? s.reference : s.value);
    cols += s.ops->dim;
  }
  RowPointers pointers;
  pointers.rows = 1;
  pointers.robust = f.loss.kind != LossKind::none;
  pointers.measurement = arrays.measurement, pointers.noise = arrays.noise, pointers.loss = arrays.loss;
  pointers.at = arrays.at, pointers.jacobian_at = arrays.estimate;
  Batch batch;
  r_.reserve(std::int64_t{Batch::kRows} * f.ops->dim);
  j_.reserve(std::int64_t{Batch::kRows} * f.ops->dim * cols);
  batch.r = r_.data(), batch.J = j_.data();
  f.ops->linearize(pointers, batch);
  if ((batch.valid & 1) == 0) return LateOutcome::invalid;
  const double t = options_.outlier_threshold;
  if (t > 0.0 && is_outlier(batch, 0, f.loss, t)) return LateOutcome::outlier;
  take_rows(f, batch, first);
  return LateOutcome::folded;
}

void LateLedger::take_rows(const DetachedFactor& f, const Batch& batch, int first) {
  double* const d = row_column(columns_) + first;
  for (int i = 0; i < batch.dim; ++i) d[i] = batch.r[i * Batch::kRows];
  const double* J = batch.J;
  for (const VariableKey& id : f.variables) {
    const Stop& s = stop_of(id);
    const int dim = s.ops->dim;
    error_.resize(static_cast<std::size_t>(dim));
    if (dim > 0) s.ops->minus(s.value, s.reference, error_.data());
    for (int c = 0; c < dim; ++c)
      for (int i = 0; i < batch.dim; ++i, J += Batch::kRows) {
        if (s.column < 0) continue;
        row_column(s.column + c)[first + i] += *J;
        bound_[s.column + c] += *J * *J;
        d[i] -= *J * error_[static_cast<std::size_t>(c)];
      }
  }
}

// Whether one of the first late rows touches a variable.
bool LateLedger::touches(const Stop& s, int rows) {
  for (int c = 0; c < s.ops->dim; ++c)
    if (!all_zero(row_column(s.column + c), rows)) return true;
  return false;
}

// The variables that an entry's conditional or the late rows touch: leaving ones first. False if the late rows touch
// none of these.
bool LateLedger::activate(const Conditional& c) {
  active_.clear();
  ++stamp_;
  bool touched = false;
  int local = 0;
  auto append = [&](Stop& s) {
    s.active = stamp_, s.local = local, local += s.ops->dim;
    active_.push_back(static_cast<std::int32_t>(&s - stops_.data()));
  };
  for (std::size_t k = 0; k < c.variables.size(); ++k) {
    Stop& s = stop_of(c.variables[k].id);
    const bool leaves = k < static_cast<std::size_t>(c.leaving);
    touched = touched || (leaves && touches(s, row_count_));
    append(s);
  }
  for (Stop& s : stops_)
    if (s.column >= 0 && s.active != stamp_ && touches(s, row_count_)) append(s);
  whole_.assign(static_cast<std::size_t>(local), 0.0);
  return touched;
}

// Its rows above the late ones, in the columns of the active variables, all about the way's x̂; and how large whatever
// went into each column is.
void LateLedger::stack(const Conditional& c) {
  const int n = c.rows, m = row_count_;
  const std::ptrdiff_t stride = std::ptrdiff_t{n} + m, columns = std::ssize(whole_);
  stacked_.assign(static_cast<std::size_t>(stride * (columns + 1)), 0.0);
  double* const d = stacked_.data() + stride * columns;
  std::copy_n(c.column(c.cols), n, d);
  std::copy_n(row_column(columns_), m, d + n);
  for (const Conditional::Variable& v : c.variables) {
    const Stop& s = stop_of(v.id);
    double* const to = stacked_.data() + stride * s.local;
    for (int j = 0; j < v.ops->dim; ++j) std::copy_n(c.column(v.column + j), n, to + stride * j);
    if (std::memcmp(s.reference, c.estimate(v), v.ops->bytes) == 0) continue;
    error_.resize(static_cast<std::size_t>(v.ops->dim));
    v.ops->minus(s.reference, c.estimate(v), error_.data());  // x ⊟ x̂_c = (x ⊟ x̂) + (x̂ ⊟ x̂_c)
    for (int j = 0; j < v.ops->dim; ++j)
      for (int i = 0; i < n; ++i) d[i] += c.column(v.column + j)[i] * error_[j];
  }
  for (const std::int32_t i : active_) {
    const Stop& s = stops_[static_cast<std::size_t>(i)];
    for (int j = 0; j < s.ops->dim; ++j) {
      const int column = s.column + j, local = s.local + j;
      double* const to = stacked_.data() + stride * local;
      std::copy_n(row_column(column), m, to + n);
      if (local >= n) bound_[column] += dot(to, to, n);
      whole_[local] = std::sqrt(bound_[column]);
    }
  }
}

// The late rows past one entry: its conditional comes to know of them, and they of what it is conditioned on.
bool LateLedger::push(std::int32_t entry) {
  const Conditional& old = store_.latest(entry);
  if (old.rows == 0 || !activate(old)) return false;
  stack(old);
  const int n = old.rows, m = row_count_, columns = static_cast<int>(whole_.size());
  const std::ptrdiff_t stride = std::ptrdiff_t{n} + m;
  eliminate_rows(stacked_.data(), n, m, columns + 1, whole_.data());
  for (int local = n; local < columns; ++local)
    forget_rounding(stacked_.data() + stride * local, n + m, whole_[static_cast<std::size_t>(local)]);
  const std::int32_t at = store_.acquire(options_.conditionals);
  Conditional& c = store_.at(at);
  c.rows = n, c.leaving = old.leaving;
  for (const std::int32_t i : active_) {
    const Stop& s = stops_[static_cast<std::size_t>(i)];
    const double* from = stacked_.data() + stride * s.local;
    const bool known = s.local < n || !silent(from, n, stride, s.ops->dim);
    if (known) c.add(s.id, *s.ops, s.reference, c.cols);
    for (int j = 0; j < s.ops->dim; ++j, from += stride) {
      if (known) c.numbers.insert(c.numbers.end(), from, from + n), ++c.cols;
      std::copy_n(from + n, m, row_column(s.column + j));
    }
  }
  const double* const d = stacked_.data() + stride * columns;
  c.numbers.insert(c.numbers.end(), d, d + n);
  std::copy_n(d + n, m, row_column(columns_));
  store_.update(entry, at);
  return true;
}

void LateLedger::write_prior(const Graph& graph, GraphEdit& edit) {
  edit.require_version(graph.version());
  prior_.variables.clear();
  prior_.estimates.clear();
  prior_.R.clear();
  prior_.rows = row_count_, prior_.cols = 0;
  for (const Stop& s : stops_) {
    if (s.entry != kLive || s.column < 0 || !touches(s, row_count_)) continue;
    prior_.variables.push_back(s.id);
    const std::size_t at = prior_.estimates.size();
    prior_.estimates.resize(at + estimate_doubles(*s.ops), 0.0);
    std::memcpy(prior_.estimates.data() + at, s.reference, s.ops->bytes);
    for (int j = 0; j < s.ops->dim; ++j, ++prior_.cols)
      prior_.R.insert(prior_.R.end(), row_column(s.column + j), row_column(s.column + j) + row_count_);
  }
  prior_.d.assign(row_column(columns_), row_column(columns_) + row_count_);
  if (prior_.cols > 0) edit.add(prior_);
}

}  // namespace oriel
