#include "oriel/linear/multifrontal.h"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <cstring>
#include <numeric>
#include <string>
#include <utility>

#include "oriel/linear/dense_kernels.h"

namespace oriel {
namespace {

// Fronts of the top of the tree share their tiles among the workers from this size on [flop].
constexpr double kParallelFront = 4e6;

Error make_error(ErrorCode code, std::string message) {
  Error error;
  error.code = code;
  error.message = std::move(message);
  return error;
}

Result<void> check_input(const BlockPattern& pattern, const FactorOptions& options, std::span<const int> given,
                         std::vector<int>& seen) {
  for (int b = 0; b < pattern.blocks(); ++b)
    if (pattern.dim(b) < 1)
      return make_error(
          ErrorCode::size_mismatch,
          "block " + std::to_string(b) + ": expected a dimension of at least 1, got " + std::to_string(pattern.dim(b)));
  if (options.ordering != OrderingMethod::given) return {};
  if (static_cast<int>(given.size()) != pattern.blocks())
    return make_error(ErrorCode::size_mismatch, "elimination order: expected " + std::to_string(pattern.blocks()) +
                                                    " blocks, got " + std::to_string(given.size()));
  seen.assign(given.size(), 0);
  for (int b : given) {
    if (b < 0 || b >= pattern.blocks() || seen[b]++ != 0)
      return make_error(ErrorCode::bad_input,
                        "elimination order: expected each block once, got block " + std::to_string(b));
  }
  return {};
}

// to += from, where both are lower triangles by columns: columns [run.row + skip...) of a child's update matrix.
struct ChildColumns {
  const double* data;  // element (row, column), both counted in the child: data[row + column·ld]
  std::int64_t ld;
  std::span<const Run> runs;
};

// Adds columns of child run q into `to`: element (r, c) of the parent is to[r + c·ld].
void add_columns(const ChildColumns& child, std::size_t q, double* to, std::int64_t ld) {
  const Run& columns = child.runs[q];
  for (int c = 0; c < columns.length; ++c) {
    const double* from = child.data + (columns.row + c) * child.ld;
    double* column = to + (columns.other + c) * ld;
    dense::add(column + columns.other + c, from + columns.row + c, columns.length - c);
    for (std::size_t k = q + 1; k < child.runs.size(); ++k)
      dense::add(column + child.runs[k].other, from + child.runs[k].row, child.runs[k].length);
  }
}

}  // namespace

Result<void> Multifrontal::analyze(const BlockPattern& pattern, const FactorOptions& options,
                                   std::span<const int> given) {
  if (auto ok = check_input(pattern, options, given, ordering_); !ok) return ok;
  relative_pivot_ = options.relative_pivot;
  order_blocks(pattern, options, given);
  const auto total = static_cast<std::size_t>(symbolic_.total_dim());
  diagonal_.assign(total, 0.0), threshold_.assign(total, 0.0), inverse_diagonal_.assign(total, 0.0);
  vector_.assign(total, 0.0);
  report_ = {};
  return {};
}

void Multifrontal::order_blocks(const BlockPattern& pattern, const FactorOptions& options, std::span<const int> given) {
  if (options.ordering == OrderingMethod::given) return symbolic_.analyze(pattern, given);
  if (options.ordering == OrderingMethod::nested_dissection && nested_dissection(pattern, ordering_))
    return symbolic_.analyze(pattern, ordering_);
  minimum_degree_.order(pattern, ordering_);
  symbolic_.analyze(pattern, ordering_);
  if (options.ordering != OrderingMethod::automatic || symbolic_.flops() < options.dissection_flops) return;
  if (!nested_dissection(pattern, other_ordering_)) return;
  other_symbolic_.analyze(pattern, other_ordering_);
  if (other_symbolic_.flops() < symbolic_.flops()) std::swap(symbolic_, other_symbolic_);
}

void Multifrontal::reserve(int workers) {
  factor_.reserve(symbolic_.factor_size());
  shared_arena_.reserve(symbolic_.shared_arena_size());
  local_.reserve(dense::round_up_8(symbolic_.largest_front()));
  if (static_cast<int>(task_arenas_.size()) < workers) task_arenas_.resize(workers);
  for (AlignedBuffer& arena : task_arenas_) arena.reserve(symbolic_.task_arena_size());
}

const FactorReport& Multifrontal::factor(const double* h, const double* damping, TaskPool* pool) {
  reserve(pool == nullptr ? 1 : pool->workers());
  const auto subtrees = symbolic_.subtrees();
  parallel_for(pool, static_cast<int>(subtrees.size()), [&](int task, int worker) {
    for (int i = subtrees[task].first; i <= subtrees[task].last; ++i) factor_front(i, h, damping, worker, nullptr);
  });
  const auto fronts = symbolic_.fronts();
  for (int i = 0; i < static_cast<int>(fronts.size()); ++i)
    if (fronts[i].task < 0) factor_front(i, h, damping, 0, pool);
  make_report();
  return report_;
}

void Multifrontal::factor_front(int front, const double* h, const double* damping, int worker, TaskPool* pool) {
  const Front& f = symbolic_.fronts()[front];
  copy_pivots(f, h, damping);
  for (int child : symbolic_.children(front)) assemble_pivots(f, child, worker);
  double* const panel = factor_.data() + f.offset;
  if (static_cast<double>(f.n) * f.n * f.p < kParallelFront) pool = nullptr;
  dense::factor_panel(panel, f.ld, f.n, f.p, threshold_.data() + f.first_scalar,
                      inverse_diagonal_.data() + f.first_scalar, pool);
  if (f.n == f.p) return;
  double* const update = update_of(front, worker);
  dense::form_update(panel, f.ld, f.n, f.p, update, f.update_ld, pool);
  for (int child : symbolic_.children(front)) assemble_update(f, child, worker, update);
}

void Multifrontal::copy_pivots(const Front& f, const double* h, const double* damping) {
  double* const panel = factor_.data() + f.offset;
  std::memset(panel, 0, sizeof(double) * f.ld * f.p);
  for (int k = f.first_position, j = 0; k < f.first_position + f.pivot_blocks; ++k) {
    const int block = symbolic_.order()[k];
    const Symbolic::MatrixColumn& column = symbolic_.matrix_column(block);
    const auto runs = symbolic_.runs(column);
    const double* add = damping == nullptr ? nullptr : damping + symbolic_.input_offset(block);
    for (int c = 0; c < symbolic_.dim(block); ++c, ++j) {
      const double* from = h + column.offset + static_cast<std::int64_t>(c) * column.ld;
      double* const to = panel + static_cast<std::int64_t>(j) * f.ld;
      for (const Run& run : runs) dense::copy(to + run.other, from + run.row, run.length);
      if (add != nullptr) to[j] += add[c];
      diagonal_[f.first_scalar + j] = to[j];
      // DBL_MIN: a diagonal of 0 is undetermined, and 1/sqrt of what is above stays finite.
      threshold_[f.first_scalar + j] = std::max(relative_pivot_ * to[j], DBL_MIN);
    }
  }
}

double* Multifrontal::update_of(int front, int worker) {
  const Front& f = symbolic_.fronts()[front];
  const bool shared = f.task < 0 || symbolic_.subtrees()[f.task].last == front;
  return (shared ? shared_arena_.data() : task_arenas_[worker].data()) + f.update_offset;
}

// The columns of a child's update matrix that are pivots here. Runs are ascending: pivots come first.
void Multifrontal::assemble_pivots(const Front& f, int child, int worker) {
  const Front& c = symbolic_.fronts()[child];
  const double* from = update_of(child, worker);
  const ChildColumns columns{from - dense::round_down_8(c.p) - static_cast<std::int64_t>(c.p) * c.update_ld,
                             c.update_ld, symbolic_.runs(c)};
  double* const panel = factor_.data() + f.offset;
  for (std::size_t q = 0; q < columns.runs.size() && columns.runs[q].other < f.p; ++q)
    add_columns(columns, q, panel, f.ld);
}

// The other columns.
void Multifrontal::assemble_update(const Front& f, int child, int worker, double* update) {
  const Front& c = symbolic_.fronts()[child];
  const double* from = update_of(child, worker);
  const ChildColumns columns{from - dense::round_down_8(c.p) - static_cast<std::int64_t>(c.p) * c.update_ld,
                             c.update_ld, symbolic_.runs(c)};
  double* const to = update - dense::round_down_8(f.p) - static_cast<std::int64_t>(f.p) * f.update_ld;
  for (std::size_t q = columns.runs.size(); q-- > 0 && columns.runs[q].other >= f.p;)
    add_columns(columns, q, to, f.update_ld);
}

void Multifrontal::make_report() {
  report_ = {};
  int not_finite = -1, smallest = -1;
  for (int j = 0; j < symbolic_.total_dim(); ++j) {
    const double inverse = inverse_diagonal_[j];
    const double ratio = 1.0 / (inverse * inverse * diagonal_[j]);
    if (inverse > 0.0 && std::isfinite(diagonal_[j])) [[likely]] {
      if (ratio < report_.smallest_ratio) report_.smallest_ratio = ratio, smallest = j;
      continue;
    }
    const Front& f = *std::prev(std::upper_bound(symbolic_.fronts().begin(), symbolic_.fronts().end(), j,
                                                 [](int s, const Front& g) { return s < g.first_scalar; }));
    const std::int64_t column = j - f.first_scalar;
    if (!std::isfinite(factor_.data()[f.offset + column + column * f.ld]) || !std::isfinite(diagonal_[j])) {
      if (not_finite < 0) not_finite = j;
    } else {
      const auto k = static_cast<std::size_t>(report_.undetermined_count++);
      if (k < report_.undetermined.size()) report_.undetermined[k] = locate(j);
    }
  }
  if (smallest >= 0) report_.smallest = locate(smallest);
  if (report_.undetermined_count > 0) report_.status = FactorReport::Status::undetermined;
  if (not_finite >= 0) report_.status = FactorReport::Status::not_finite, report_.not_finite = locate(not_finite);
}

FactorReport::Scalar Multifrontal::locate(int scalar) const {
  const auto order = symbolic_.order();
  const auto found = std::upper_bound(order.begin(), order.end(), scalar,
                                      [this](int s, int block) { return s < symbolic_.scalar(block); });
  const int block = *std::prev(found);
  return {block, scalar - symbolic_.scalar(block)};
}

void Multifrontal::to_elimination_order(const double* b, double* y) const {
  for (int block : symbolic_.order())
    std::copy_n(b + symbolic_.input_offset(block), symbolic_.dim(block), y + symbolic_.scalar(block));
}

void Multifrontal::from_elimination_order(const double* y, double* x) const {
  for (int block : symbolic_.order())
    std::copy_n(y + symbolic_.scalar(block), symbolic_.dim(block), x + symbolic_.input_offset(block));
}

void Multifrontal::solve(const double* b, double* x) {
  to_elimination_order(b, vector_.data());
  solve_lower(vector_.data());
  solve_upper(vector_.data());
  from_elimination_order(vector_.data(), x);
}

// local_ = the values of y at a front's rows, zeros in the padding.
void Multifrontal::load(const Front& f, const double* y) {
  double* const v = local_.data();
  std::copy_n(y + f.first_scalar, f.p, v);
  for (const Run& span : symbolic_.spans(f)) std::copy_n(y + span.other, span.length, v + span.row);
  std::fill(v + f.n, v + dense::round_up_8(f.n), 0.0);
}

void Multifrontal::solve_lower(double* y) {
  double* const v = local_.data();
  for (const Front& f : symbolic_.fronts()) {
    load(f, y);
    dense::solve_panel_lower(factor_.data() + f.offset, f.ld, f.n, f.p, inverse_diagonal_.data() + f.first_scalar, v);
    std::copy_n(v, f.p, y + f.first_scalar);
    for (const Run& span : symbolic_.spans(f)) std::copy_n(v + span.row, span.length, y + span.other);
  }
}

void Multifrontal::solve_upper(double* y) {
  double* const v = local_.data();
  const auto fronts = symbolic_.fronts();
  for (auto i = fronts.size(); i-- > 0;) {
    const Front& f = fronts[i];
    load(f, y);
    dense::solve_panel_upper(factor_.data() + f.offset, f.ld, f.n, f.p, inverse_diagonal_.data() + f.first_scalar, v);
    std::copy_n(v, f.p, y + f.first_scalar);
  }
}

}  // namespace oriel
