// The symbolic analysis of a pattern that differs a little from the last one. A column's rows are its neighbours and
// the rows of its children, so that a change reaches the columns that it touches and those above them; and whether a
// front is merged into another one depends on both. A front that nothing reaches stays, unless its parent, made anew,
// would take it in: then its columns are made anew as well.
#include <algorithm>
#include <utility>

#include "oriel/linear/symbolic.h"

namespace oriel {
namespace {

constexpr std::size_t kLargestShare = 4;   // of all fronts, up to which it pays to keep the others: a quarter
constexpr std::int64_t kLargestHoles = 2;  // of what lives, up to which holes are borne: a half

bool has_many_holes(std::int64_t all, std::int64_t live) { return all - live > live / kLargestHoles + 1024; }

}  // namespace

bool Symbolic::update(const BlockPattern& pattern, std::span<const int> order, std::span<const int> changed) {
  const int before = blocks(), after = pattern.blocks();
  if (sequence_.empty() || !is_sparse() || !mark_changed(changed, after)) return false;
  for (const int i : marked_)
    for (const int b : pivots(fronts_[i]))
      live_storage_ -= static_cast<std::int64_t>(std::exchange(columns_[b].ld, 0)) * dims_[b];
  set_dimensions_of_few(pattern, order);
  do {
    kept_changed_ = false;
    if (!gather_columns(before)) return false;
    find_supernodes(pattern, nodes_);
    link_supernodes(nodes_);
    amalgamate(nodes_);
  } while (kept_changed_);
  drop_marked();
  const std::size_t first = fronts_.size();
  make_fronts();
  sort_few_rows(first);
  place_rows(first);
  sum_up_few(first);
  link_few_fronts(first);
  make_schedule(first);
  if (has_many_holes(factor_size_, live_factor_)) close_factor();
  place_columns(pattern, before);
  for (std::size_t i = first; i < fronts_.size(); ++i) {
    load_local_rows(fronts_[i]);
    for (const int child : children(static_cast<int>(i))) make_runs(fronts_[child]);
    make_matrix_runs(fronts_[i]);
  }
  make_few_spans(first);
  return true;
}

// From the first that differs on, of blocks and of the order.
void Symbolic::set_dimensions_of_few(const BlockPattern& pattern, std::span<const int> order) {
  const int n = pattern.blocks(), both = std::min(n, blocks());
  int b = 0, k = 0;
  while (b < both && dims_[b] == pattern.dim(b)) ++b;
  while (k < both && order_[k] == order[static_cast<std::size_t>(k)]) ++k;
  resize_columns(n);
  for (; b < n; ++b) dims_[b] = pattern.dim(b), input_offset_[b] = pattern.offset(b);
  for (; k < n; ++k) order_[k] = order[static_cast<std::size_t>(k)], rank_[order_[k]] = k;
}

bool Symbolic::is_sparse() const {
  auto has_grown = [](std::size_t now, std::size_t then) { return now > 2 * then + 1024; };
  if (has_grown(children_.size(), analyzed_.children) || has_grown(runs_.size(), analyzed_.runs) ||
      has_grown(matrix_runs_.size(), analyzed_.matrix_runs) || has_grown(column_rows_.size(), analyzed_.column_rows))
    return false;
  return !has_many_holes(storage_size_, live_storage_) &&
         !has_many_holes(static_cast<std::int64_t>(fronts_.size()), static_cast<std::int64_t>(sequence_.size()));
}

// The factor without holes: nothing stands in it between two factorizations. (What is made anew is the top of the tree
// each time, which is most of it.)
void Symbolic::close_factor() {
  factor_size_ = 0;
  for (const int i : sequence_) {
    fronts_[i].offset = factor_size_;
    factor_size_ += static_cast<std::int64_t>(fronts_[i].ld) * fronts_[i].p;
  }
}

// The fronts of these columns, and all above them. False where they are too many.
bool Symbolic::mark_changed(std::span<const int> changed, int after) {
  marked_.clear();
  is_marked_.assign(fronts_.size(), 0);
  auto reach = [&](int block) {
    for (int i = front_of_block_[block]; i >= 0 && is_marked_[i] == 0; i = fronts_[i].parent) mark(i);
  };
  for (const int b : changed)
    if (b < blocks()) reach(b);
  for (int b = after; b < blocks(); ++b) reach(b);
  return kLargestShare * marked_.size() <= sequence_.size();
}

void Symbolic::mark(int front) {
  if (is_marked_[front] != 0) return;
  is_marked_[front] = 1;
  marked_.push_back(front);
}

// nodes_ = columns that are made anew, and the last pivots of fronts that stay below them; by rank.
bool Symbolic::gather_columns(int before) {
  nodes_.clear();
  is_root_.assign(dims_.size(), 0);
  for (const int i : marked_) {
    for (const int b : pivots(fronts_[i]))
      if (b < blocks()) nodes_.push_back(b);
    for (const int child : children(i))
      if (is_marked_[child] == 0) {
        nodes_.push_back(pivots(fronts_[child]).back());
        is_root_[nodes_.back()] = 1;
      }
  }
  for (int b = before; b < blocks(); ++b) nodes_.push_back(b);
  std::sort(nodes_.begin(), nodes_.end(), [this](int a, int b) { return rank_[a] < rank_[b]; });
  return kLargestShare * marked_.size() <= sequence_.size();
}

void Symbolic::drop_marked() {
  for (const int i : marked_) fronts_[i].live = false;
}

// The new fronts, and those that stay below them, get their parents; the new ones their children.
void Symbolic::link_few_fronts(std::size_t first) {
  auto rank = [this](int i) { return rank_[pivots(fronts_[i]).back()]; };
  auto by_rank = [&](int a, int b) { return rank(a) < rank(b); };
  std::vector<int>& linked = post_;
  linked.clear();
  for (const int b : nodes_)
    if (is_root_[b] != 0) linked.push_back(front_of_block_[b]);
  for (std::size_t i = first; i < fronts_.size(); ++i) linked.push_back(static_cast<int>(i));
  std::sort(linked.begin(), linked.end(), by_rank);
  std::erase_if(roots_, [this](int i) { return !fronts_[i].live; });
  const std::size_t old_roots = roots_.size();
  for (const int i : linked) {
    Front& f = fronts_[i];
    f.parent = f.row_blocks == 0 ? -1 : front_of_block_[row_blocks_[f.rows_begin]];
    if (f.parent >= 0)
      ++fronts_[f.parent].children;
    else
      roots_.push_back(i);
  }
  std::inplace_merge(roots_.begin(), roots_.begin() + static_cast<std::ptrdiff_t>(old_roots), roots_.end(), by_rank);
  for (std::size_t i = first; i < fronts_.size(); ++i) {
    fronts_[i].children_begin = static_cast<int>(children_.size());
    children_.resize(children_.size() + static_cast<std::size_t>(std::exchange(fronts_[i].children, 0)));
  }
  for (const int i : linked)
    if (const int up = fronts_[i].parent; up >= 0) children_[fronts_[up].children_begin + fronts_[up].children++] = i;
}

// Of the fronts that have a row among pivots that stand elsewhere now. What was made anew is closed upwards: such a
// front has one for its last row, and where it stayed, its parent has that row as well.
void Symbolic::make_few_spans(std::size_t first) {
  if (spans_.size() > 2 * row_blocks_.size()) return make_spans();
  std::vector<char>& is_moved = is_marked_;
  is_moved.assign(dims_.size(), 0);
  for (const int b : nodes_) is_moved[b] = is_root_[b] == 0;
  for (std::size_t i = first; i < fronts_.size(); ++i) make_spans(fronts_[i]);
  stack_.clear();
  for (const int b : nodes_)
    if (is_root_[b] != 0) stack_.push_back(front_of_block_[b]);
  while (!stack_.empty()) {
    const int i = stack_.back();
    stack_.pop_back();
    Front& f = fronts_[i];
    if (f.row_blocks == 0 || is_moved[row_blocks_[f.rows_begin + f.row_blocks - 1]] == 0) continue;
    make_spans(f);
    const auto children = this->children(i);
    stack_.insert(stack_.end(), children.begin(), children.end());
  }
}

// Few of many: each sorted by itself.
void Symbolic::sort_few_rows(std::size_t first) {
  for (std::size_t i = first; i < fronts_.size(); ++i) {
    Front& f = fronts_[i];
    const auto from = super_rows_.begin() + f.rows_begin;
    f.rows_begin = static_cast<int>(row_blocks_.size());
    row_blocks_.insert(row_blocks_.end(), from, from + f.row_blocks);
    std::sort(row_blocks_.begin() + f.rows_begin, row_blocks_.end(),
              [this](int a, int b) { return rank_[a] < rank_[b]; });
  }
}

// Matrix columns of all that is made anew, behind the others.
void Symbolic::place_columns(const BlockPattern& pattern, int before) {
  for (const int b : nodes_) {
    if (is_root_[b] != 0) continue;
    MatrixColumn& column = columns_[b];
    if (b >= before) column = {};
    live_storage_ -= static_cast<std::int64_t>(column.ld) * dims_[b];
    column.rows_begin = static_cast<int>(column_rows_.size());
    for (const int neighbour : pattern.neighbours(b))
      if (rank_[neighbour] > rank_[b]) column_rows_.push_back(neighbour);
    column.row_blocks = static_cast<int>(column_rows_.size()) - column.rows_begin;
    const auto rows = column_rows_.begin() + column.rows_begin;
    std::sort(rows, column_rows_.end(), [this](int x, int y) { return rank_[x] < rank_[y]; });
    column.ld = dims_[b];
    for (auto row = rows; row != column_rows_.end(); ++row) {
      column_offsets_.push_back(column.ld);
      column.ld += dims_[*row];
    }
    column.offset = storage_size_;
    storage_size_ += static_cast<std::int64_t>(column.ld) * dims_[b];
    live_storage_ += static_cast<std::int64_t>(column.ld) * dims_[b];
  }
}

}  // namespace oriel
