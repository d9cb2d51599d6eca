#include "oriel/linear/multifrontal.h"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <cstring>
#include <numeric>
#include <string>
#include <utility>

#include "oriel/base/slot_map.h"
#include "oriel/linear/dense_kernels.h"
#include "oriel/linear/resize.h"

namespace oriel {
namespace {

// Fronts of the top of the tree share their tiles among the workers from this size on [flop].
constexpr double kParallelFront = 2e6;
constexpr int kColumns = 24;  // that a worker assembles at a time

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

// The update matrix of a child, a lower triangle, with its rows in the parent.
struct Child {
  const double* data;  // element (row, column), both counted in the child: data[row + column·ld]
  std::int64_t ld;
  std::span<const Run> runs;  // ascending
};

// Adds what a child has for columns [begin, end) of the parent: element (r, c) of the parent is to[r + c·ld].
void add_columns(const Child& child, double* to, std::int64_t ld, int begin, int end) {
  for (std::size_t q = 0; q < child.runs.size() && child.runs[q].other < end; ++q) {
    const Run& columns = child.runs[q];
    for (int c = std::max(0, begin - columns.other); c < std::min(columns.length, end - columns.other); ++c) {
      const double* from = child.data + (columns.row + c) * child.ld;
      double* column = to + (columns.other + c) * ld;
      dense::add(column + columns.other + c, from + columns.row + c, columns.length - c);
      for (std::size_t k = q + 1; k < child.runs.size(); ++k)
        dense::add(column + child.runs[k].other, from + child.runs[k].row, child.runs[k].length);
    }
  }
}

// f(begin, end) for all of [0, count): in pieces where there is a pool.
template <class F>
void for_columns(TaskPool* pool, int count, F f) {
  if (pool == nullptr) return f(0, count);
  parallel_for(pool, (count + kColumns - 1) / kColumns,
               [&](int task, int) { f(task * kColumns, std::min((task + 1) * kColumns, count)); });
}

}  // namespace

Result<void> Multifrontal::analyze(const BlockPattern& pattern, const FactorOptions& options,
                                   std::span<const int> given) {
  if (auto ok = check_input(pattern, options, given, ordering_); !ok) return ok;
  relative_pivot_ = options.relative_pivot;
  if (!is_known(pattern, options, given)) {
    order_blocks(pattern, options, given);
    analyzed_.remember(pattern);
    analyzed_ordering_ = options.ordering;
    analyzed_dissection_flops_ = options.dissection_flops;
    analyzed_first_late_ = options.first_late;
    analyzed_order_.clear();
    reserve_more(analyzed_order_, given.size());
    analyzed_order_.insert(analyzed_order_.end(), given.begin(), given.end());
    ++analyses_;
  }
  prepare_vectors();
  return {};
}

void Multifrontal::follow(const BlockPattern& pattern, const FactorOptions& options, std::span<const int> order,
                          std::span<const int> changed) {
  relative_pivot_ = options.relative_pivot;
  if (symbolic_.update(pattern, order, changed))
    ++updates_;
  else
    symbolic_.analyze(pattern, order), ++analyses_;
  analyzed_ordering_ = OrderingMethod::given;
  analyzed_.reset({});  // it is told what changed, and has nothing to compare with
  analyzed_order_.assign(1, -1);
  prepare_vectors();
}

// Every value of a vector is written before it is read.
void Multifrontal::prepare_vectors() {
  const auto total = static_cast<std::size_t>(symbolic_.total_dim());
  for (std::vector<double>* v : {&diagonal_, &threshold_, &inverse_diagonal_, &vector_}) resize_with_room(*v, total);
  report_ = {};
}

bool Multifrontal::is_known(const BlockPattern& pattern, const FactorOptions& options,
                            std::span<const int> given) const {
  return analyses_ > 0 && options.ordering == analyzed_ordering_ &&
         options.dissection_flops == analyzed_dissection_flops_ && options.first_late == analyzed_first_late_ &&
         std::equal(given.begin(), given.end(), analyzed_order_.begin(), analyzed_order_.end()) &&
         pattern.same_as(analyzed_);
}

void Multifrontal::order_blocks(const BlockPattern& pattern, const FactorOptions& options, std::span<const int> given) {
  if (options.ordering == OrderingMethod::given) return symbolic_.analyze(pattern, given);
  if (options.ordering == OrderingMethod::nested_dissection && nested_dissection(pattern, ordering_))
    return symbolic_.analyze(pattern, ordering_);
  minimum_degree_.order(pattern, ordering_, options.first_late);
  symbolic_.analyze(pattern, ordering_);
  if (options.ordering != OrderingMethod::automatic || symbolic_.flops() < options.dissection_flops) return;
  if (!nested_dissection(pattern, other_ordering_)) return;
  other_symbolic_.analyze(pattern, other_ordering_);
  if (other_symbolic_.flops() < symbolic_.flops()) std::swap(symbolic_, other_symbolic_);
}

void Multifrontal::reserve(int workers) {
  factor_.reserve(symbolic_.factor_size());
  shared_arena_.reserve(symbolic_.shared_arena_size());
  if (static_cast<int>(task_arenas_.size()) < workers) task_arenas_.resize(workers);
  for (AlignedBuffer& arena : task_arenas_) arena.reserve(symbolic_.task_arena_size());
  if (static_cast<int>(local_.size()) < workers) local_.resize(workers), worker_vector_.resize(workers);
  for (AlignedBuffer& local : local_) local.reserve(dense::round_up_8(symbolic_.largest_front()));
  if (!symbolic_.subtrees().empty())
    for (AlignedBuffer& vector : worker_vector_) vector.reserve(symbolic_.total_dim());
  subtree_part_.resize(static_cast<std::size_t>(symbolic_.subtree_part_size()));
}

const FactorReport& Multifrontal::factor(const double* h, const double* damping, TaskPool* pool) {
  reserve(pool == nullptr ? 1 : pool->workers());
  const auto subtrees = symbolic_.subtrees();
  parallel_for(pool, static_cast<int>(subtrees.size()), [&](int task, int worker) {
    for (const int i : symbolic_.fronts_of(subtrees[task])) factor_front(i, h, damping, worker, nullptr);
  });
  const auto fronts = symbolic_.fronts();
  for (const int i : symbolic_.sequence())
    if (fronts[i].task < 0) factor_front(i, h, damping, 0, pool);
  make_report();
  return report_;
}

void Multifrontal::factor_front(int front, const double* h, const double* damping, int worker, TaskPool* pool) {
  const Front& f = symbolic_.fronts()[front];
  if (static_cast<double>(f.n) * f.n * f.p < kParallelFront) pool = nullptr;
  double* const panel = factor_.data() + f.offset;
  copy_pivots(f, h, damping);
  for_columns(pool, f.p, [&](int begin, int end) { assemble(front, worker, panel, f.ld, begin, end); });
  dense::factor_panel(panel, f.ld, f.n, f.p, threshold_.data() + f.first_scalar,
                      inverse_diagonal_.data() + f.first_scalar, pool);
  if (f.n == f.p) return;
  double* const update = update_of(front, worker);
  dense::form_update(panel, f.ld, f.n, f.p, update, f.update_ld, pool);
  double* const to = update - dense::round_down_8(f.p) - static_cast<std::int64_t>(f.p) * f.update_ld;
  for_columns(pool, f.n - f.p,
              [&](int begin, int end) { assemble(front, worker, to, f.update_ld, f.p + begin, f.p + end); });
}

void Multifrontal::copy_pivots(const Front& f, const double* h, const double* damping) {
  double* const panel = factor_.data() + f.offset;
  std::memset(panel, 0, sizeof(double) * f.ld * f.p);
  int j = 0;
  for (const int block : symbolic_.pivots(f)) {
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
  const bool shared = f.task < 0 || f.task == front;
  return (shared ? shared_arena_.data() : task_arenas_[worker].data()) + f.update_offset;
}

// Adds what the children have for columns [begin, end).
void Multifrontal::assemble(int front, int worker, double* to, std::int64_t ld, int begin, int end) {
  for (int index : symbolic_.children(front)) {
    const Front& c = symbolic_.fronts()[index];
    const double* from = update_of(index, worker);
    const Child child{from - dense::round_down_8(c.p) - static_cast<std::int64_t>(c.p) * c.update_ld, c.update_ld,
                      symbolic_.runs(c)};
    add_columns(child, to, ld, begin, end);
  }
}

void Multifrontal::make_report() {
  report_ = {};
  int not_finite = -1, smallest = -1, not_finite_front = -1, smallest_front = -1;
  for (const int i : symbolic_.sequence()) {
    const Front& f = symbolic_.fronts()[i];
    for (int j = f.first_scalar; j < f.first_scalar + f.p; ++j) {
      const double inverse = inverse_diagonal_[j];
      const double ratio = 1.0 / (inverse * inverse * diagonal_[j]);
      if (inverse > 0.0 && std::isfinite(diagonal_[j])) [[likely]] {
        if (ratio < report_.smallest_ratio) report_.smallest_ratio = ratio, smallest = j, smallest_front = i;
        continue;
      }
      const std::int64_t column = j - f.first_scalar;
      if (!std::isfinite(factor_.data()[f.offset + column + column * f.ld]) || !std::isfinite(diagonal_[j])) {
        if (not_finite < 0) not_finite = j, not_finite_front = i;
      } else {
        const auto k = static_cast<std::size_t>(report_.undetermined_count++);
        if (k < report_.undetermined.size()) report_.undetermined[k] = locate(f, j);
      }
    }
  }
  if (smallest >= 0) report_.smallest = locate(symbolic_.fronts()[smallest_front], smallest);
  if (report_.undetermined_count > 0) report_.status = FactorReport::Status::undetermined;
  if (not_finite >= 0) {
    report_.status = FactorReport::Status::not_finite;
    report_.not_finite = locate(symbolic_.fronts()[not_finite_front], not_finite);
  }
}

FactorReport::Scalar Multifrontal::locate(const Front& front, int scalar) const {
  const auto pivots = symbolic_.pivots(front);
  const auto found = std::upper_bound(pivots.begin(), pivots.end(), scalar,
                                      [this](int s, int block) { return s < symbolic_.scalar(block); });
  const int block = *std::prev(found);
  return {block, scalar - symbolic_.scalar(block)};
}

void Multifrontal::to_elimination_order(const double* b, double* y) const {
  for (int block = 0; block < symbolic_.blocks(); ++block)
    std::copy_n(b + symbolic_.input_offset(block), symbolic_.dim(block), y + symbolic_.scalar(block));
}

void Multifrontal::from_elimination_order(const double* y, double* x) const {
  for (int block = 0; block < symbolic_.blocks(); ++block)
    std::copy_n(y + symbolic_.scalar(block), symbolic_.dim(block), x + symbolic_.input_offset(block));
}

void Multifrontal::solve(const double* b, double* x, TaskPool* pool) {
  to_elimination_order(b, vector_.data());
  solve_lower(vector_.data(), pool);
  solve_upper(vector_.data(), pool);
  from_elimination_order(vector_.data(), x);
}

}  // namespace oriel
