#include "oriel/linear/symbolic.h"

#include <algorithm>

#include "oriel/linear/dense_kernels.h"
#include "oriel/linear/resize.h"

namespace oriel {
namespace {

// Estimated time of a front [ns], all of it: what the front costs whatever its size, its pivots one after the other,
// its arithmetic, and the assembly of its update matrix into the parent. Only differences matter: two fronts are merged
// where the sum falls. Constants fitted to measurements of the kernels (AVX-512, 3.5 GHz); they are part of the
// program, never measured while it runs, so that the fronts are a function of the pattern.
double front_cost(double n, double p) {
  const double m = n - p;
  const double panel = p * p * (n - p * (2.0 / 3.0));
  const double update = m * m * p;
  return 150.0 + 12.0 * p + panel / 30.0 + update / 50.0 + 0.5 * n * p + 0.3 * m * m + 4.0 * m;
}

}  // namespace

void Symbolic::analyze(const BlockPattern& pattern, std::span<const int> order) {
  set_dimensions(pattern, order);
  clear_layout();
  is_root_.assign(order_.size(), 0);
  find_supernodes(pattern, order_);
  link_supernodes(order_);
  amalgamate(order_);
  make_fronts();
  sort_rows();
  place_rows(0);
  sum_up();
  link_fronts();
  make_schedule(0);
  place_matrix(pattern);
  make_runs();
  make_spans();
  keep_room(fronts_), keep_room(pivots_), keep_room(runs_), keep_room(matrix_runs_), keep_room(spans_);
  keep_room(children_), keep_room(sequence_), keep_room(nodes_), keep_room(supers_), keep_room(super_rows_);
  old_sequence_.reserve(sequence_.capacity());
  is_marked_.reserve(dims_.capacity());
  analyzed_ = {children_.size(), runs_.size(), matrix_runs_.size(), column_rows_.size()};
}

void Symbolic::set_dimensions(const BlockPattern& pattern, std::span<const int> order) {
  const int n = pattern.blocks();
  resize_columns(n);
  for (int b = 0; b < n; ++b) dims_[b] = pattern.dim(b), input_offset_[b] = pattern.offset(b);
  std::copy(order.begin(), order.end(), order_.begin());
  for (int k = 0; k < n; ++k) rank_[order_[k]] = k;
}

void Symbolic::resize_columns(int n) {
  const auto blocks = static_cast<std::size_t>(n);
  for (std::vector<int>* v : {&dims_, &input_offset_, &order_, &rank_, &front_of_block_, &block_scalar_, &local_row_,
                              &parent_, &super_of_, &next_pivot_, &head_, &seen_})
    resize_with_room(*v, blocks);
  resize_with_room(columns_, blocks);
  resize_with_room(is_root_, blocks);
}

// A column joins the supernode of a child whose rows are its own: head_ lists, for each block, the supernodes whose
// parent column it is. `columns` by rank; those in is_root_ stand for the fronts, kept as they are, that end with them.
void Symbolic::find_supernodes(const BlockPattern& pattern, std::span<const int> columns) {
  const int n = blocks();
  head_.assign(n, -1), seen_.assign(n, -1);
  next_.resize(columns.size());
  super_rows_.clear(), supers_.clear();
  for (const int b : columns) {
    if (is_root_[b] != 0)
      add_kept(front_of_block_[b]);
    else
      add_column(pattern, b);
  }
}

void Symbolic::add_column(const BlockPattern& pattern, int b) {
  gather_rows(pattern, b);
  int up = -1;  // the elimination tree: the first of its rows
  for (const int row : rows_)
    if (up < 0 || rank_[row] < rank_[up]) up = row;
  parent_[b] = up;
  next_pivot_[b] = -1;
  if (!join_child(b)) {
    int n = dims_[b];
    for (const int row : rows_) n += dims_[row];
    super_of_[b] = static_cast<int>(supers_.size());
    supers_.push_back(
        {b, b, static_cast<int>(super_rows_.size()), static_cast<int>(rows_.size()), n, dims_[b], -1, -1, -1, false});
    super_rows_.insert(super_rows_.end(), rows_.begin(), rows_.end());
  }
  hang(super_of_[b], up);
}

void Symbolic::add_kept(int front) {
  const Front& f = fronts_[front];
  const auto pivots = this->pivots(f), rows = row_blocks(f);
  const int last = pivots.back();
  super_of_[last] = static_cast<int>(supers_.size());
  supers_.push_back(
      {pivots.front(), last, static_cast<int>(super_rows_.size()), f.row_blocks, f.n, f.p, -1, -1, front, false});
  super_rows_.insert(super_rows_.end(), rows.begin(), rows.end());
  parent_[last] = rows.empty() ? -1 : rows.front();
  hang(super_of_[last], parent_[last]);
}

void Symbolic::hang(int supernode, int up) {
  if (up < 0) return;
  next_[supernode] = head_[up];
  head_[up] = supernode;
}

// rows_ = blocks below the diagonal of a column, in no order: its neighbours, and the rows of its children.
void Symbolic::gather_rows(const BlockPattern& pattern, int b) {
  rows_.clear();
  seen_[b] = b;
  auto take = [&](int row) {
    if (seen_[row] == b) return;
    seen_[row] = b;
    rows_.push_back(row);
  };
  for (int neighbour : pattern.neighbours(b))
    if (rank_[neighbour] > rank_[b]) take(neighbour);
  for (int s = head_[b]; s >= 0; s = next_[s])
    for (int q = 0; q < supers_[s].rows; ++q) take(super_rows_[supers_[s].rows_begin + q]);
}

bool Symbolic::join_child(int b) {
  for (int s = head_[b]; s >= 0; s = next_[s]) {
    Supernode& child = supers_[s];
    if (child.rows != static_cast<int>(rows_.size()) + 1) continue;
    if (child.kept_front >= 0) {  // it does not stay as it is
      mark(child.kept_front), kept_changed_ = true;
      return false;
    }
    const auto rows = super_rows_.begin() + child.rows_begin;
    *std::find(rows, rows + child.rows, b) = rows[child.rows - 1];
    --child.rows;
    child.p += dims_[b];
    next_pivot_[child.last_pivot] = b;
    child.last_pivot = b;
    super_of_[b] = s;
    return true;
  }
  return false;
}

void Symbolic::link_supernodes(std::span<const int> columns) {
  for (const int b : columns) {
    Supernode& s = supers_[super_of_[b]];
    if (s.last_pivot != b || parent_[b] < 0) continue;
    Supernode& parent = supers_[super_of_[parent_[b]]];
    s.next_sibling = parent.first_child;
    parent.first_child = super_of_[b];
  }
}

// Merges fronts into their parents where explicit zeros cost less than a front of its own (relaxed supernodes:
// C. Ashcraft, R. Grimes, "The influence of relaxed supernode partitions on the multifrontal method", ACM TOMS 1989).
void Symbolic::amalgamate(std::span<const int> columns) {
  for (const int b : columns) {  // a supernode's last pivot comes after those of its children
    Supernode& parent = supers_[super_of_[b]];
    if (parent.last_pivot == b && parent.kept_front < 0) absorb_children(parent);
  }
}

// The rows of a child are among the pivots and rows of its parent: the merged front has the parent's rows and one more
// for each pivot of the child.
void Symbolic::absorb_children(Supernode& parent) {
  int kept = -1;
  for (int c = parent.first_child; c >= 0;) {
    Supernode& child = supers_[c];
    const int sibling = child.next_sibling;
    const double apart = front_cost(child.n, child.p) + front_cost(parent.n, parent.p);
    const bool merge = front_cost(parent.n + child.p, parent.p + child.p) < apart;
    if (merge && child.kept_front >= 0) mark(child.kept_front), kept_changed_ = true;
    if (merge && child.kept_front < 0) {
      child.absorbed = true;
      next_pivot_[child.last_pivot] = parent.first_pivot;
      parent.first_pivot = child.first_pivot;
      parent.n += child.p;
      parent.p += child.p;
      for (int g = child.first_child; g >= 0;) {
        const int next = supers_[g].next_sibling;
        supers_[g].next_sibling = kept;
        kept = g;
        g = next;
      }
    } else {
      child.next_sibling = kept;
      kept = c;
    }
    c = sibling;
  }
  parent.first_child = kept;
}

bool Symbolic::has(int i, int j) const {
  if (i == j) return true;
  return rank_[i] > rank_[j] ? column_row(j, i) >= 0 : column_row(i, j) >= 0;
}

BlockAddress Symbolic::address(int i, int j) const {
  const bool transposed = rank_[i] < rank_[j];
  if (transposed) std::swap(i, j);
  const MatrixColumn& column = columns_[j];
  return {column.offset + (i == j ? 0 : column_row(j, i)), column.ld, transposed};
}

// First row of block `row` in the matrix column of block `column`, -1 if it is not there.
int Symbolic::column_row(int column, int row) const {
  const auto begin = column_rows_.begin() + columns_[column].rows_begin, end = begin + columns_[column].row_blocks;
  const auto found =
      std::lower_bound(begin, end, rank_[row], [this](int block, int rank) { return rank_[block] < rank; });
  return found == end || *found != row ? -1 : column_offsets_[found - column_rows_.begin()];
}

}  // namespace oriel
