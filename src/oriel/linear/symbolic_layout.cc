// The second half of the symbolic analysis: where everything stands in memory.
#include <algorithm>
#include <iterator>
#include <utility>

#include "oriel/linear/dense_kernels.h"
#include "oriel/linear/symbolic.h"

namespace oriel {
namespace {

// Subtrees are cut at this share of all flops, and only where there is enough work to be worth a task. Functions of
// the structure, never of the number of threads.
constexpr double kLargestTask = 1.0 / 12, kSmallestTask = 1.0 / 512;
constexpr double kWorthTasks = 4e6;  // [flop]

// Flops of p steps of Cholesky on n rows, lower triangle: Σ (n - j)², multiplications and additions.
double front_flops(const Front& f) {
  const double n = f.n, m = f.n - f.p;
  return (n * (n + 1) * (2 * n + 1) - m * (m + 1) * (2 * m + 1)) / 6.0;
}

std::int64_t update_size(const Front& f) { return static_cast<std::int64_t>(f.update_ld) * (f.n - f.p); }

}  // namespace

void Symbolic::clear_layout() {
  fronts_.clear(), pivots_.clear(), row_blocks_.clear(), row_offsets_.clear();
  children_.clear(), runs_.clear(), matrix_runs_.clear(), column_rows_.clear(), column_offsets_.clear();
  total_dim_ = 0, factor_size_ = 0, storage_size_ = 0, live_storage_ = 0;
}

// Of the supernodes that no front stands for yet; children before parents.
void Symbolic::make_fronts() {
  stack_.clear(), post_.clear();
  for (int s = 0; s < static_cast<int>(supers_.size()); ++s)
    if (!supers_[s].absorbed && supers_[s].kept_front < 0 && parent_[supers_[s].last_pivot] < 0) stack_.push_back(s);
  while (!stack_.empty()) {
    const int s = stack_.back();
    stack_.pop_back();
    post_.push_back(s);
    for (int c = supers_[s].first_child; c >= 0; c = supers_[c].next_sibling)
      if (supers_[c].kept_front < 0) stack_.push_back(c);
  }
  for (auto s = post_.rbegin(); s != post_.rend(); ++s) add_front(supers_[*s]);
}

void Symbolic::add_front(const Supernode& supernode) {
  Front f;
  f.n = supernode.n, f.p = supernode.p;
  f.ld = dense::leading_dimension(f.n);
  f.update_ld = dense::update_leading_dimension(f.n, f.p);
  f.first_pivot = static_cast<int>(pivots_.size());
  f.first_scalar = total_dim_;
  f.row_blocks = supernode.rows;
  f.rows_begin = supernode.rows_begin;  // of super_rows_, until the rows are sorted
  for (int b = supernode.first_pivot; b >= 0; b = b == supernode.last_pivot ? -1 : next_pivot_[b]) {
    front_of_block_[b] = static_cast<int>(fronts_.size());
    block_scalar_[b] = total_dim_;
    total_dim_ += dims_[b];
    pivots_.push_back(b);
  }
  f.pivot_blocks = static_cast<int>(pivots_.size()) - f.first_pivot;
  fronts_.push_back(f);
}

// The rows of all fronts by rank, in linear time: turn "rows of a front" into "fronts of a row", and walk the rows in
// order.
void Symbolic::sort_rows() {
  const int n = blocks();
  bucket_begin_.assign(n + 1, 0);
  for (const Front& f : fronts_)
    for (int q = 0; q < f.row_blocks; ++q) ++bucket_begin_[rank_[super_rows_[f.rows_begin + q]] + 1];
  for (int k = 0; k < n; ++k) bucket_begin_[k + 1] += bucket_begin_[k];
  bucket_.resize(bucket_begin_[n]);
  cursor_.assign(bucket_begin_.begin(), bucket_begin_.end());
  int total = 0;
  for (int i = 0; i < static_cast<int>(fronts_.size()); ++i) {
    Front& f = fronts_[i];
    for (int q = 0; q < f.row_blocks; ++q) bucket_[cursor_[rank_[super_rows_[f.rows_begin + q]]]++] = i;
    f.rows_begin = total;
    total += f.row_blocks;
    f.row_blocks = 0;
  }
  row_blocks_.resize(total);
  for (int k = 0; k < n; ++k) {
    for (int q = bucket_begin_[k]; q < bucket_begin_[k + 1]; ++q) {
      Front& f = fronts_[bucket_[q]];
      row_blocks_[f.rows_begin + f.row_blocks++] = order_[k];
    }
  }
}

void Symbolic::place_rows(std::size_t first) {
  row_offsets_.resize(row_blocks_.size());
  for (std::size_t i = first; i < fronts_.size(); ++i) {
    Front& f = fronts_[i];
    int row = f.p;
    for (int q = f.rows_begin; q < f.rows_begin + f.row_blocks; ++q) {
      row_offsets_[q] = row;
      row += dims_[row_blocks_[q]];
    }
    f.offset = factor_size_;
    factor_size_ += static_cast<std::int64_t>(f.ld) * f.p;
  }
}

// Whole numbers below 2^53, or halves of them: the sums are exact in any order.
void Symbolic::sum_up() {
  largest_front_ = 0, flops_ = 0, fill_ = 0, live_factor_ = 0;
  for (const Front& f : fronts_) {
    if (!f.live) continue;
    largest_front_ = std::max(largest_front_, f.n);
    flops_ += front_flops(f);
    fill_ += 0.5 * f.p * (f.p + 1.0) + static_cast<double>(f.p) * (f.n - f.p);
    live_factor_ += static_cast<std::int64_t>(f.ld) * f.p;
  }
}

// Children by the rank of their last pivot: whatever their places, they are added to their parent in one order.
void Symbolic::link_fronts() {
  for (Front& f : fronts_) {
    f.parent = f.row_blocks == 0 ? -1 : front_of_block_[row_blocks_[f.rows_begin]];
    if (f.parent >= 0) ++fronts_[f.parent].children;
  }
  int total = 0;
  for (Front& f : fronts_) f.children_begin = total, total += std::exchange(f.children, 0);
  children_.resize(total);
  roots_.clear();
  for (const int b : order_) {
    const int i = front_of_block_[b];
    const Front& f = fronts_[i];
    if (pivots_[f.first_pivot + f.pivot_blocks - 1] != b) continue;
    if (f.parent < 0)
      roots_.push_back(i);
    else
      children_[fronts_[f.parent].children_begin + fronts_[f.parent].children++] = i;
  }
}

void Symbolic::make_sequence() {
  stack_.assign(roots_.begin(), roots_.end());
  sequence_.clear();
  while (!stack_.empty()) {  // a preorder, which backwards is a postorder
    const int i = stack_.back();
    stack_.pop_back();
    sequence_.push_back(i);
    const auto children = this->children(i);
    stack_.insert(stack_.end(), children.begin(), children.end());
  }
  std::reverse(sequence_.begin(), sequence_.end());
}

// Rows of every matrix column by rank, in linear time: walk the rows in order.
void Symbolic::place_matrix(const BlockPattern& pattern) {
  const int n = blocks();
  columns_.assign(n, {});
  for (int b = 0; b < n; ++b)
    for (int neighbour : pattern.neighbours(b)) columns_[b].row_blocks += rank_[neighbour] > rank_[b];
  int rows = 0;
  for (const int i : sequence_)
    for (const int b : pivots(fronts_[i])) {
      columns_[b].rows_begin = rows;
      columns_[b].ld = dims_[b];
      rows += std::exchange(columns_[b].row_blocks, 0);
    }
  column_rows_.resize(rows), column_offsets_.resize(rows);
  for (int row : order_) {
    for (int b : pattern.neighbours(row)) {
      if (rank_[b] > rank_[row]) continue;
      MatrixColumn& column = columns_[b];
      column_rows_[column.rows_begin + column.row_blocks] = row;
      column_offsets_[column.rows_begin + column.row_blocks++] = column.ld;
      column.ld += dims_[row];
    }
  }
  for (const int i : sequence_)
    for (const int b : pivots(fronts_[i])) {
      columns_[b].offset = storage_size_;
      storage_size_ += static_cast<std::int64_t>(columns_[b].ld) * dims_[b];
    }
  live_storage_ = storage_size_;
}

void Symbolic::make_runs() {
  for (const int i : sequence_) {
    load_local_rows(fronts_[i]);
    for (int child : children(i)) make_runs(fronts_[child]);
    make_matrix_runs(fronts_[i]);
  }
}

// local_row_ = the first rows of a front's blocks in it.
void Symbolic::load_local_rows(const Front& f) {
  for (const int b : pivots(f)) local_row_[b] = block_scalar_[b] - f.first_scalar;
  for (int q = f.rows_begin; q < f.rows_begin + f.row_blocks; ++q) local_row_[row_blocks_[q]] = row_offsets_[q];
}

// For the matrix columns of a front's pivots; local_row_ holds the rows of that front.
void Symbolic::make_matrix_runs(const Front& f) {
  for (const int b : pivots(f)) {
    MatrixColumn& column = columns_[b];
    column.runs_begin = static_cast<int>(matrix_runs_.size());
    matrix_runs_.push_back({0, local_row_[b], dims_[b]});
    for (int q = column.rows_begin; q < column.rows_begin + column.row_blocks; ++q) {
      const int block = column_rows_[q];
      Run& last = matrix_runs_.back();
      if (last.other + last.length == local_row_[block])
        last.length += dims_[block];
      else
        matrix_runs_.push_back({column_offsets_[q], local_row_[block], dims_[block]});
    }
    column.runs = static_cast<int>(matrix_runs_.size()) - column.runs_begin;
  }
}

// Towards the parent, whose rows local_row_ holds.
void Symbolic::make_runs(Front& f) {
  f.runs_begin = static_cast<int>(runs_.size());
  const int boundary = fronts_[f.parent].p;
  for (int q = f.rows_begin; q < f.rows_begin + f.row_blocks; ++q) {
    const int b = row_blocks_[q], row = row_offsets_[q], parent_row = local_row_[b];
    if (q != f.rows_begin && runs_.back().other + runs_.back().length == parent_row && parent_row != boundary)
      runs_.back().length += dims_[b];
    else
      runs_.push_back({row, parent_row, dims_[b]});
  }
  f.runs = static_cast<int>(runs_.size()) - f.runs_begin;
}

void Symbolic::make_spans() {
  spans_.clear();
  for (Front& f : fronts_)
    if (f.live) make_spans(f);
}

// Towards vectors.
void Symbolic::make_spans(Front& f) {
  f.spans_begin = static_cast<int>(spans_.size());
  int end = -1;
  for (int q = f.rows_begin; q < f.rows_begin + f.row_blocks; ++q) {
    const int b = row_blocks_[q], scalar = block_scalar_[b];
    if (scalar == end)
      spans_.back().length += dims_[b];
    else
      spans_.push_back({row_offsets_[q], scalar, dims_[b]});
    end = scalar + dims_[b];
  }
  f.spans = static_cast<int>(spans_.size()) - f.spans_begin;
}

void Symbolic::cut_subtrees() {
  subtrees_.clear();
  subtree_part_size_ = 0;
  for (Front& f : fronts_) f.task = -1;
  if (flops_ < kWorthTasks) return;
  const int count = static_cast<int>(sequence_.size());
  subtree_flops_.assign(fronts_.size(), 0.0);
  cursor_.assign(fronts_.size(), 1);  // fronts in the subtree
  for (const int i : sequence_) {
    subtree_flops_[i] += front_flops(fronts_[i]);
    if (const int up = fronts_[i].parent; up >= 0) {
      subtree_flops_[up] += subtree_flops_[i];
      cursor_[up] += cursor_[i];
    }
  }
  for (int k = 0; k < count; ++k) {
    const int i = sequence_[k], up = fronts_[i].parent;
    const bool small_enough = subtree_flops_[i] <= kLargestTask * flops_;
    const bool maximal = up < 0 || subtree_flops_[up] > kLargestTask * flops_;
    if (!small_enough || !maximal || subtree_flops_[i] < kSmallestTask * flops_) continue;
    subtrees_.push_back({k - cursor_[i] + 1, k});
  }
  std::sort(subtrees_.begin(), subtrees_.end(), [&](const Subtree& a, const Subtree& b) {
    const double x = subtree_flops_[sequence_[a.last]], y = subtree_flops_[sequence_[b.last]];
    return x != y ? x > y : a.first < b.first;
  });
  for (Subtree& tree : subtrees_) {
    for (const int i : fronts_of(tree)) fronts_[i].task = static_cast<int>(&tree - subtrees_.data());
    const Front& root = fronts_[sequence_[tree.last]];
    tree.part = subtree_part_size_;
    subtree_part_size_ += root.n - root.p;
  }
}

// An update matrix lives from its front until its parent has taken it. In a postorder that is a stack; with fronts of
// even and odd depth on a stack each, a front's own matrix never lies upon those of its children, and all places are
// known beforehand. The root of a subtree outlives its task: it has a place in the shared arena.
void Symbolic::place_updates() {
  const int count = static_cast<int>(sequence_.size());
  depth_.resize(fronts_.size());
  for (int k = count - 1; k >= 0; --k) {
    const int i = sequence_[k];
    depth_[i] = fronts_[i].parent < 0 ? 0 : depth_[fronts_[i].parent] + 1;
  }
  task_arena_size_ = 0;
  for (int t = 0; t < static_cast<int>(subtrees_.size()); ++t)
    task_arena_size_ = std::max(task_arena_size_, place_updates(subtrees_[t].first, subtrees_[t].last - 1, t, 0));
  if (subtrees_.empty())
    shared_arena_size_ = place_updates(0, count - 1, -1, 0);
  else
    place_shared_updates();
}

// Of the roots of subtrees, which are there before the top of the tree begins, and of the top: the first gap that is
// wide enough, where a stack would keep the places of roots that were taken long ago.
void Symbolic::place_shared_updates() {
  std::vector<Gap>& gaps = gaps_;  // ascending, none next to another; the top has some ten fronts
  gaps.clear();
  shared_arena_size_ = 0;
  for (const Subtree& tree : subtrees_) {
    Front& root = fronts_[sequence_[tree.last]];
    root.update_offset = shared_arena_size_;
    shared_arena_size_ += update_size(root);
  }
  auto take = [&](std::int64_t size) {
    for (Gap& g : gaps)
      if (g.end - g.begin >= size) return std::exchange(g.begin, g.begin + size);
    if (!gaps.empty() && gaps.back().end == shared_arena_size_) {  // the last gap, and more
      const std::int64_t begin = gaps.back().begin;
      gaps.pop_back();
      shared_arena_size_ = begin + size;
      return begin;
    }
    return std::exchange(shared_arena_size_, shared_arena_size_ + size);
  };
  auto give = [&](Gap gap) {
    auto next = std::find_if(gaps.begin(), gaps.end(), [&](const Gap& g) { return g.begin >= gap.end; });
    if (next != gaps.end() && next->begin == gap.end) gap.end = next->end, next = gaps.erase(next);
    if (next != gaps.begin() && std::prev(next)->end == gap.begin)
      std::prev(next)->end = gap.end;
    else
      gaps.insert(next, gap);
  };
  for (const int i : sequence_) {
    if (fronts_[i].task >= 0) continue;
    fronts_[i].update_offset = take(update_size(fronts_[i]));
    for (const int child : children(i))
      give({fronts_[child].update_offset, fronts_[child].update_offset + update_size(fronts_[child])});
  }
}

// Places the fronts of one task at [first, last] of the sequence from `base` on; returns the end.
std::int64_t Symbolic::place_updates(int first, int last, int task, std::int64_t base) {
  std::int64_t top[2] = {0, 0}, high[2] = {0, 0};
  for (int k = first; k <= last; ++k) {
    const int i = sequence_[k];
    Front& f = fronts_[i];
    if (f.task != task) continue;
    const int parity = depth_[i] & 1;
    f.update_offset = base + top[parity];
    top[parity] += update_size(f);
    high[parity] = std::max(high[parity], top[parity]);
    for (int child : children(i))
      if (fronts_[child].task == task) top[1 - parity] -= update_size(fronts_[child]);
  }
  for (int k = first; k <= last; ++k)
    if (Front& f = fronts_[sequence_[k]]; f.task == task && (depth_[sequence_[k]] & 1) != 0) f.update_offset += high[0];
  return base + high[0] + high[1];
}

}  // namespace oriel
