// Symbolic analysis of a block Cholesky factorization: from a pattern and an elimination order to fronts, their tree,
// and all addresses. Everything that follows only reads it.
//
//   blocks → rows of each column → supernodes → amalgamation → fronts → their tree, and a postorder of it
//
// A front is a dense lower trapezoid: its pivot columns, and all rows that they reach (J. Liu, "The multifrontal method
// for sparse matrix solution: theory and practice", SIAM Review 34, 1992).
//
// Where a little changes, `update` makes anew only the fronts that the change reaches: those whose columns it touches,
// and all above them. What it leaves differs from what `analyze` would make in where things stand (fronts that are gone
// leave holes), and in nothing that a factorization's bits could tell: the same fronts, rows, children and sequence.
#pragma once
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "oriel/linear/block_pattern.h"

namespace oriel {

// The unfactored matrix holds the connected blocks alone, one column-major slab for each block column: the diagonal
// block on top, then the blocks of rows that are eliminated later. (Laid out as the factor it would be several times
// larger, most of it zeros that every linearization would write and every factorization read.)
//
// Where block (i, j) of the matrix stands: element (r, c), r a row of block i and c a row of block j, is
// data[offset + c·ld + r], or data[offset + r·ld + c] if the block is stored as its transpose.
struct BlockAddress {
  std::int64_t offset = 0;
  std::int32_t ld = 0;
  bool transposed = false;
};

struct Front {
  int n = 0, p = 0;                       // scalar rows, scalar pivots (the first p rows)
  int ld = 0, update_ld = 0;              // leading dimensions of pivot columns and update matrix
  std::int64_t offset = 0;                // of the pivot columns, in the factor
  std::int64_t update_offset = 0;         // of the update matrix, in its arena
  int first_pivot = 0, pivot_blocks = 0;  // pivot blocks: a slice of pivots()
  int rows_begin = 0, row_blocks = 0;     // blocks of the other rows: a slice of row_blocks()
  int first_scalar = 0;                   // of the pivots, in elimination order
  int parent = -1;
  int children_begin = 0, children = 0;  // a slice of children()
  int runs_begin = 0, runs = 0;          // of the other rows, towards the parent: a slice of runs()
  int spans_begin = 0, spans = 0;        // of the other rows, towards vectors: a slice of spans()
  int task = -1;                         // root of the subtree that holds it; -1: the top of the tree
  bool live = true;                      // false: a hole that an update left
};

// Consecutive rows of a front that are consecutive elsewhere, too: in the parent, on one side of its boundary between
// pivots and other rows (a run); in a vector in elimination order (a span); or rows of a matrix column that are
// consecutive in its front.
struct Run {
  int row = 0;    // first row
  int other = 0;  // the same row elsewhere
  int length = 0;
};

class Symbolic {
 public:
  // `order` is a permutation of the pattern's blocks: order[k] is eliminated k-th, or in an equivalent order.
  void analyze(const BlockPattern& pattern, std::span<const int> order);
  // The same for a pattern of which the last one differs in the neighbours of `changed` blocks; in blocks at its end,
  // which are gone (their neighbours are among `changed`); and in blocks behind its end, which are new. `order` is the
  // last one without what is gone, and what is new behind it. False, and nothing is changed, where it would not pay.
  bool update(const BlockPattern& pattern, std::span<const int> order, std::span<const int> changed);

  std::span<const Front> fronts() const { return fronts_; }  // in no order, with holes
  // The fronts that live: a postorder of the tree, children by the place of their last pivot in the order.
  std::span<const int> sequence() const { return sequence_; }
  std::span<const int> pivots(const Front& f) const {
    return {pivots_.data() + f.first_pivot, static_cast<std::size_t>(f.pivot_blocks)};
  }
  std::span<const int> order() const { return order_; }  // as it was given
  // After an update: f(block) for each column of the matrix that was laid out anew; the others stand where they
  // stood.
  template <class F>
  void for_each_moved(F f) const {
    for (const int b : nodes_)
      if (is_root_[b] == 0) f(b);
  }
  std::span<const int> row_blocks(const Front& f) const {
    return {row_blocks_.data() + f.rows_begin, static_cast<std::size_t>(f.row_blocks)};
  }
  std::span<const Run> runs(const Front& f) const {
    return {runs_.data() + f.runs_begin, static_cast<std::size_t>(f.runs)};
  }
  std::span<const Run> spans(const Front& f) const {
    return {spans_.data() + f.spans_begin, static_cast<std::size_t>(f.spans)};
  }
  std::span<const int> children(int front) const {
    const Front& f = fronts_[front];
    return {children_.data() + f.children_begin, static_cast<std::size_t>(f.children)};
  }
  // Subtrees that are factored apart, one task each, the one of most work first: places [first, last] in the sequence.
  struct Subtree {
    int first, last;
    int part = 0;  // rows of the last front that are no pivots, of the subtrees before this one
  };
  // The fronts of a subtree, the root last.
  std::span<const int> fronts_of(const Subtree& tree) const {
    return {sequence_.data() + tree.first, static_cast<std::size_t>(tree.last - tree.first + 1)};
  }
  int subtree_part_size() const { return subtree_part_size_; }  // of all subtrees
  std::span<const Subtree> subtrees() const { return subtrees_; }

  int blocks() const { return static_cast<int>(dims_.size()); }
  // [scalars] of a vector in elimination order: each front has its pivots side by side, holes included.
  int total_dim() const { return total_dim_; }
  int dim(int block) const { return dims_[block]; }
  int input_offset(int block) const { return input_offset_[block]; }
  int scalar(int block) const { return block_scalar_[block]; }           // first scalar of a block in elimination order
  std::int64_t storage_size() const { return storage_size_; }            // [doubles] of the matrix
  std::int64_t factor_size() const { return factor_size_; }              // [doubles] of the factor
  std::int64_t task_arena_size() const { return task_arena_size_; }      // [doubles] update matrices of one subtree
  std::int64_t shared_arena_size() const { return shared_arena_size_; }  // [doubles] those of the top
  int largest_front() const { return largest_front_; }
  double flops() const { return flops_; }  // of one factorization, explicit zeros included
  double fill() const { return fill_; }    // doubles in the factor, padding excluded

  // A block column of the matrix: where it starts, and its rows in the front, run by run.
  struct MatrixColumn {
    std::int64_t offset = 0;
    int ld = 0;
    int rows_begin = 0, row_blocks = 0;  // blocks below the diagonal, by elimination order
    int runs_begin = 0, runs = 0;
  };
  const MatrixColumn& matrix_column(int block) const { return columns_[block]; }
  std::span<const Run> runs(const MatrixColumn& column) const {
    return {matrix_runs_.data() + column.runs_begin, static_cast<std::size_t>(column.runs)};
  }

  // Whether block (i, j) has a place: i == j, or the two were connected.
  bool has(int i, int j) const;
  // Place of block (i, j); only where has(i, j).
  BlockAddress address(int i, int j) const;

 private:
  // A column of blocks or several with the same rows, before fronts are laid out.
  struct Supernode {
    int first_pivot, last_pivot;  // blocks, linked by next_pivot_
    int rows_begin, rows;         // slice of super_rows_: blocks below the pivots
    int n, p;                     // scalars
    int first_child, next_sibling;
    int kept_front;  // the front that this is and stays; -1: one of columns that are made anew
    bool absorbed;
  };
  // symbolic.cc: from the pattern to supernodes.
  void set_dimensions(const BlockPattern& pattern, std::span<const int> order);
  void resize_columns(int n);
  void find_supernodes(const BlockPattern& pattern, std::span<const int> columns);
  void add_column(const BlockPattern& pattern, int block);
  void add_kept(int front);
  void hang(int supernode, int up);
  void gather_rows(const BlockPattern& pattern, int block);
  bool join_child(int block);
  void link_supernodes(std::span<const int> columns);
  void amalgamate(std::span<const int> columns);
  void absorb_children(Supernode& parent);
  // symbolic_update.cc: which fronts a change reaches.
  bool mark_changed(std::span<const int> changed, int after);
  void mark(int front);
  bool gather_columns(int before);
  void set_dimensions_of_few(const BlockPattern& pattern, std::span<const int> order);
  void drop_marked();
  void sort_few_rows(std::size_t first);
  void place_columns(const BlockPattern& pattern, int before);
  bool is_sparse() const;
  void close_factor();
  // symbolic_layout.cc: from supernodes to addresses.
  void clear_layout();
  void make_fronts();
  void add_front(const Supernode& supernode);
  void sort_rows();
  void place_rows(std::size_t first);
  void link_fronts();
  void link_few_fronts(std::size_t first);
  void make_runs();
  void make_runs(Front& front);
  void make_spans();
  void make_few_spans(std::size_t first);
  void make_spans(Front& front);
  void place_matrix(const BlockPattern& pattern);
  void load_local_rows(const Front& front);
  void make_matrix_runs(const Front& front);
  // symbolic_schedule.cc: what is factored when, and beside what.
  void add_up(const Front& front, double sign);
  void sum_up();
  void sum_up_few(std::size_t first);
  void make_schedule(std::size_t first);
  void make_sequence(std::size_t first);
  void sum_subtrees(std::size_t first);
  void find_subtrees();
  template <class F>
  void for_each_of_top(F f);
  void place_updates();
  std::int64_t place_updates(int first, int last);
  void place_shared_updates();
  int column_row(int column, int row) const;

  int total_dim_ = 0, largest_front_ = 0, subtree_part_size_ = 0;
  std::int64_t storage_size_ = 0, factor_size_ = 0, task_arena_size_ = 0, shared_arena_size_ = 0;
  double flops_ = 0, fill_ = 0;
  std::vector<int> dims_, input_offset_, order_, rank_, block_scalar_, front_of_block_;
  std::vector<Front> fronts_;
  std::vector<int> sequence_, pivots_;
  std::vector<int> row_blocks_, row_offsets_;  // rows of each front: blocks by rank, their first row
  std::vector<int> children_, roots_;
  std::vector<Run> runs_, spans_, matrix_runs_;
  std::vector<MatrixColumn> columns_;
  std::vector<int> column_rows_, column_offsets_;  // row blocks of each matrix column, their first row in it
  std::vector<Subtree> subtrees_;
  // By front: its place in the sequence; of its subtree the fronts, the flops, and the arena where that is a task.
  std::vector<int> place_, subtree_size_;
  std::vector<double> subtree_flops_;
  std::vector<std::int64_t> arena_size_;
  std::int64_t live_storage_ = 0, live_factor_ = 0;  // [doubles] without holes
  struct Sizes {
    std::size_t children = 0, runs = 0, matrix_runs = 0, column_rows = 0;
  } analyzed_;  // when all was made anew, to which updates add

  // Scratch of analyze and update.
  std::vector<int> parent_, head_, next_, stack_, seen_, rows_, super_rows_, super_of_, next_pivot_;
  std::vector<int> bucket_begin_, bucket_, cursor_, depth_, local_row_, post_;
  std::vector<int> nodes_, marked_;  // columns made anew and last pivots of fronts that stay, by rank; fronts
  std::vector<char> is_marked_, is_root_;
  std::vector<int> old_sequence_;
  std::vector<Subtree> old_subtrees_;
  std::vector<char> is_cut_;  // by front: 1, the root of a subtree; 2, as it was before
  std::vector<std::pair<int, int>> subtree_ranges_;
  struct Gap {
    std::int64_t begin, end;
  };
  std::vector<Gap> gaps_;
  std::vector<Supernode> supers_;
  bool kept_changed_ = false;  // a front that was to stay would not: it is marked, and the columns are gathered again
};

}  // namespace oriel
