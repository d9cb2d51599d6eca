// The second part of the symbolic analysis: where everything stands in memory.
#include <algorithm>
#include <iterator>
#include <utility>

#include "oriel/linear/dense_kernels.h"
#include "oriel/linear/resize.h"
#include "oriel/linear/symbolic.h"

namespace oriel {

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
  resize_with_room(row_blocks_, static_cast<std::size_t>(total));
  for (int k = 0; k < n; ++k) {
    for (int q = bucket_begin_[k]; q < bucket_begin_[k + 1]; ++q) {
      Front& f = fronts_[bucket_[q]];
      row_blocks_[f.rows_begin + f.row_blocks++] = order_[k];
    }
  }
}

void Symbolic::place_rows(std::size_t first) {
  resize_with_room(row_offsets_, row_blocks_.size());
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

// Children by the rank of their last pivot: whatever their places, they are added to their parent in one order.
void Symbolic::link_fronts() {
  for (Front& f : fronts_) {
    f.parent = f.row_blocks == 0 ? -1 : front_of_block_[row_blocks_[f.rows_begin]];
    if (f.parent >= 0) ++fronts_[f.parent].children;
  }
  int total = 0;
  for (Front& f : fronts_) f.children_begin = total, total += std::exchange(f.children, 0);
  resize_with_room(children_, static_cast<std::size_t>(total));
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

// Rows of every matrix column by rank, in linear time: walk the rows in order.
void Symbolic::place_matrix(const BlockPattern& pattern) {
  const int n = blocks();
  std::fill(columns_.begin(), columns_.end(), MatrixColumn{});
  for (int b = 0; b < n; ++b)
    for (int neighbour : pattern.neighbours(b)) columns_[b].row_blocks += rank_[neighbour] > rank_[b];
  int rows = 0;
  for (const int i : sequence_)
    for (const int b : pivots(fronts_[i])) {
      columns_[b].rows_begin = rows;
      columns_[b].ld = dims_[b];
      rows += std::exchange(columns_[b].row_blocks, 0);
    }
  resize_with_room(column_rows_, static_cast<std::size_t>(rows));
  resize_with_room(column_offsets_, static_cast<std::size_t>(rows));
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

}  // namespace oriel
