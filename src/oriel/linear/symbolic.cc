#include "oriel/linear/symbolic.h"

#include <algorithm>

#include "oriel/linear/dense_kernels.h"

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
  make_tree(pattern);
  make_postorder();
  find_supernodes(pattern);
  link_supernodes();
  amalgamate();
  make_fronts();
  sort_rows();
  place_rows();
  link_fronts();
  place_matrix(pattern);
  make_runs();
  cut_subtrees();
  place_updates();
}

void Symbolic::set_dimensions(const BlockPattern& pattern, std::span<const int> order) {
  const int n = pattern.blocks();
  dims_.resize(n), input_offset_.resize(n);
  for (int b = 0; b < n; ++b) dims_[b] = pattern.dim(b), input_offset_[b] = pattern.offset(b);
  total_dim_ = pattern.total_dim();
  order_.assign(order.begin(), order.end());
  position_.resize(n);
  for (int k = 0; k < n; ++k) position_[order_[k]] = k;
}

// Elimination tree over positions, with path compression: J. Liu, "A compact row storage scheme for Cholesky factors
// using elimination trees", ACM TOMS 12 (1986).
void Symbolic::make_tree(const BlockPattern& pattern) {
  const int n = blocks();
  parent_.assign(n, -1);
  ancestor_.assign(n, -1);
  for (int k = 0; k < n; ++k) {
    for (int neighbour : pattern.neighbours(order_[k])) {
      for (int i = position_[neighbour]; i >= 0 && i < k;) {
        const int up = ancestor_[i];
        ancestor_[i] = k;
        if (up < 0) parent_[i] = k;
        i = up;
      }
    }
  }
}

// Renumbers positions so that every subtree is consecutive: an equivalent order, with the same fill.
void Symbolic::make_postorder() {
  const int n = blocks();
  head_.assign(n, -1), next_.assign(n, -1), post_.clear(), stack_.clear();
  for (int k = 0; k < n; ++k) {
    if (parent_[k] < 0) {
      stack_.push_back(k);
    } else {
      next_[k] = head_[parent_[k]];
      head_[parent_[k]] = k;
    }
  }
  while (!stack_.empty()) {  // a preorder, which backwards is a postorder
    const int k = stack_.back();
    stack_.pop_back();
    post_.push_back(k);
    for (int child = head_[k]; child >= 0; child = next_[child]) stack_.push_back(child);
  }
  std::reverse(post_.begin(), post_.end());
  cursor_.resize(n), bucket_.resize(n);
  for (int k = 0; k < n; ++k) cursor_[post_[k]] = k;
  for (int k = 0; k < n; ++k) {
    bucket_[k] = order_[post_[k]];
    ancestor_[k] = parent_[post_[k]] < 0 ? -1 : cursor_[parent_[post_[k]]];
  }
  order_.assign(bucket_.begin(), bucket_.end());  // no swap: each buffer keeps the capacity that it has reached
  parent_.assign(ancestor_.begin(), ancestor_.end());
  for (int k = 0; k < n; ++k) position_[order_[k]] = k;
}

// A column joins the supernode of a child whose rows are its own: head_ lists, for each position, the supernodes whose
// parent column it is.
void Symbolic::find_supernodes(const BlockPattern& pattern) {
  const int n = blocks();
  head_.assign(n, -1), next_.assign(n, -1);
  seen_.assign(n, -1);
  super_of_.resize(n), next_pivot_.assign(n, -1);
  super_rows_.clear(), supers_.clear();
  for (int k = 0; k < n; ++k) {
    gather_rows(pattern, k);
    if (!join_child(k)) {
      const int b = order_[k];
      int n_scalar = dims_[b];
      for (int row : rows_) n_scalar += dims_[row];
      super_of_[k] = static_cast<int>(supers_.size());
      supers_.push_back({b, b, static_cast<int>(super_rows_.size()), static_cast<int>(rows_.size()), n_scalar, dims_[b],
                         -1, -1, -1, false});
      super_rows_.insert(super_rows_.end(), rows_.begin(), rows_.end());
    }
    if (const int up = parent_[k]; up >= 0) {
      const int s = super_of_[k];
      next_[s] = head_[up];
      head_[up] = s;
    }
  }
}

// rows_ = blocks below the diagonal of column `position`, in no order: its neighbours, and the rows of its children.
void Symbolic::gather_rows(const BlockPattern& pattern, int position) {
  rows_.clear();
  const int b = order_[position];
  seen_[b] = position;
  auto take = [&](int row) {
    if (seen_[row] == position) return;
    seen_[row] = position;
    rows_.push_back(row);
  };
  for (int neighbour : pattern.neighbours(b))
    if (position_[neighbour] > position) take(neighbour);
  for (int s = head_[position]; s >= 0; s = next_[s])
    for (int q = 0; q < supers_[s].rows; ++q) take(super_rows_[supers_[s].rows_begin + q]);
}

bool Symbolic::join_child(int position) {
  const int b = order_[position];
  for (int s = head_[position]; s >= 0; s = next_[s]) {
    Supernode& child = supers_[s];
    if (child.rows != static_cast<int>(rows_.size()) + 1) continue;
    const auto rows = super_rows_.begin() + child.rows_begin;
    *std::find(rows, rows + child.rows, b) = rows[child.rows - 1];
    --child.rows;
    child.p += dims_[b];
    next_pivot_[child.last_pivot] = b;
    child.last_pivot = b;
    super_of_[position] = s;
    return true;
  }
  return false;
}

void Symbolic::link_supernodes() {
  for (int s = 0; s < static_cast<int>(supers_.size()); ++s) {
    const int up = parent_[position_[supers_[s].last_pivot]];
    if (up < 0) continue;
    Supernode& parent = supers_[super_of_[up]];
    supers_[s].parent = super_of_[up];
    supers_[s].next_sibling = parent.first_child;
    parent.first_child = s;
  }
}

// Merges fronts into their parents where explicit zeros cost less than a front of its own (relaxed supernodes:
// C. Ashcraft, R. Grimes, "The influence of relaxed supernode partitions on the multifrontal method", ACM TOMS 1989).
void Symbolic::amalgamate() {
  for (int k = 0; k < blocks(); ++k) {  // a supernode's last pivot comes after those of its children
    Supernode& parent = supers_[super_of_[k]];
    if (parent.last_pivot == order_[k]) absorb_children(parent);
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
    if (front_cost(parent.n + child.p, parent.p + child.p) < apart) {
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
  return position_[i] > position_[j] ? column_row(j, i) >= 0 : column_row(i, j) >= 0;
}

BlockAddress Symbolic::address(int i, int j) const {
  const bool transposed = position_[i] < position_[j];
  if (transposed) std::swap(i, j);
  const MatrixColumn& column = columns_[j];
  return {column.offset + (i == j ? 0 : column_row(j, i)), column.ld, transposed};
}

// First row of block `row` in the matrix column of block `column`, -1 if it is not there.
int Symbolic::column_row(int column, int row) const {
  const auto begin = column_rows_.begin() + columns_[column].rows_begin, end = begin + columns_[column].row_blocks;
  const auto found = std::lower_bound(begin, end, position_[row],
                                      [this](int block, int position) { return position_[block] < position; });
  return found == end || *found != row ? -1 : column_offsets_[found - column_rows_.begin()];
}

}  // namespace oriel
