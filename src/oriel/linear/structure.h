// LinearStructure: from a graph to the linear problem's layout, a pure function of the live graph (decision 5). Which
// variables are kept and which are eliminated as landmarks, in which order rows are evaluated, and where every block of
// every factor is added. Rebuilt linearly inside its capacity when the graph's structure changes.
#pragma once
#include <cstdint>
#include <vector>

#include "oriel/graph/graph.h"
#include "oriel/linear/followed_structure.h"
#include "oriel/linear/multifrontal.h"

namespace oriel {

// Where the product of two columns of a factor's Jacobian is added. packed: the lower half of a diagonal block, column
// after column, and then the gradient of its variable (structure_slices.cc).
struct PairAddress {
  enum class Kind : std::uint8_t { none, stored, transposed, diagonal_twice, packed };
  std::int64_t offset = 0;
  std::int32_t ld = 0;
  Kind kind = Kind::none;
};

// [doubles] of the lower half of a packed block, before the gradient: whole vectors of eight.
constexpr int packed_half(int dim) { return (dim * (dim + 1) / 2 + 7) / 8 * 8; }

// One table of factors, as the linearization runs through it.
struct TablePlan {
  struct Argument {
    int arg = 0;     // of the residual
    int dim = 0;     // > 0: constants have no columns
    int column = 0;  // of the Jacobian
    std::uint32_t pool = 0;
    bool landmark_type = false;
  };
  // Rows [first, first + count) of one batch, multiples of eight, with the same kept variables; padded by repetitions.
  struct Run {
    std::uint32_t first = 0, count = 0;
  };
  // Batches [first, last), which no other slice of the plan shares a landmark with. Before it adds anything it clears
  // its partial sums and, where it is the first to say anything of landmarks, their blocks; ranges [begin, end) in H
  // and in the landmark store.
  struct Slice {
    std::uint32_t first = 0, last = 0;
    std::int64_t partial_begin = 0, partial_end = 0, clear_begin = 0, clear_end = 0;
  };
  // What a slice has to say of a block that others speak of, too: it is added to the block when all slices are done.
  struct PartialSum {
    std::int64_t from = 0, to = 0;  // in H
    std::int32_t ld = 0, rows = 0, columns = 0;
    std::int32_t gradient = -1;  // where that of a diagonal block's variable stands in a step; -1: not a diagonal block
  };
  const FactorTable* table = nullptr;
  std::vector<Argument> arguments;  // those with columns
  // Live rows in the order of serials, in runs, or in slices; batches are cut by 64.
  std::vector<std::uint32_t> rows;
  std::vector<std::uint64_t> active;    // a batch each: the rows that count; the others are padding
  std::vector<Run> runs;                // empty: no runs
  std::vector<Slice> slices;            // empty: no slices, rows are added in turn
  std::vector<PartialSum> partials;     // in the order of slices
  int landmark_argument = -1;           // the one that is a landmark, in a table none of whose landmarks is kept
  std::vector<std::uint32_t> dense;     // rows × arity: where the values stand
  std::vector<Target> targets;          // rows × arguments
  std::vector<PairAddress> pairs;       // rows × arguments (arguments + 1) / 2: kept with kept, (a, b ≤ a); in runs
                                        // for their first rows
  std::vector<std::int32_t> landmark;   // rows: the landmark that the row touches, or -1
  std::vector<std::int32_t> panel_row;  // rows × arguments: row of a kept argument in its landmark's W
};

// An eliminated variable: V (dim × dim), g (dim) and W (rows × dim, column-major) stand one after the other.
struct LandmarkBlock {
  // rows: scalars of the kept variables that share a factor with it; in a panel, of all that see any landmark.
  std::int32_t dim = 0, rows = 0;
  std::int32_t offset = 0;                           // in a step
  std::int64_t data = 0;                             // in the landmark store: V, then g, then W
  std::int32_t first_neighbour = 0, neighbours = 0;  // slice of neighbours()
  std::int64_t first_pair = 0;                       // slice of pair addresses: neighbours (i, j ≤ i), row by row
  std::uint32_t pool = 0, dense = 0;

  std::int64_t v() const { return data; }
  std::int64_t g() const { return data + dim * dim; }
  std::int64_t w() const { return data + dim * dim + dim; }
};

// A row of the prior table: its dense block is added to H once a structure.
struct PriorPlan {
  std::uint32_t row = 0;
  std::vector<Target> targets;
  std::vector<std::int32_t> columns;  // first column of each variable
  std::vector<std::uint32_t> pool, dense;
};

// Which blocks of H more than one slice of a plan adds to, and where the slice at hand has its partial sum. By the
// place of the block in H; diagonal blocks by their variable.
class SharedBlocks {
 public:
  struct Entry {
    std::int64_t block = -1, partial = 0;
    std::int32_t slice = -1, partial_slice = -1;
    bool shared = false;
  };
  void reset(std::size_t variables, std::size_t most);  // room for so many blocks off the diagonal
  Entry& find(std::int64_t block);
  Entry& diagonal(std::int32_t variable) { return diagonal_[static_cast<std::size_t>(variable)]; }

 private:
  std::vector<Entry> entries_;  // open addressing; a power of two
  std::vector<Entry> diagonal_;
};

class LinearStructure {
 public:
  // An error only if the numbers of a block overflow; never in practice. `order` is state (linear/ordering.h): given
  // the same one, the same bits, whatever was built before.
  Result<void> build(const Graph& graph, const FactorOptions& options, EliminationOrder& order);
  Result<void> build(const Graph& graph, const FactorOptions& options) {
    EliminationOrder none;
    return build(graph, options, none);
  }

  // Pools of the graph when it was built: one that came since holds nothing, but has its place in every column.
  std::size_t pool_count() const { return targets_.size(); }
  // Grows with every build: what is cached about a structure is cached for one version.
  std::uint64_t version() const { return version_; }
  const std::vector<TablePlan>& plans() const { return plans_; }
  std::size_t plan_count() const { return plan_count_; }
  const std::vector<PriorPlan>& priors() const { return priors_; }
  std::size_t prior_count() const { return prior_count_; }
  const std::vector<KeptBlock>& kept() const { return kept_; }
  const std::vector<LandmarkBlock>& landmarks() const { return landmarks_; }
  const std::vector<std::int32_t>& neighbours() const { return neighbours_; }
  const std::vector<BlockAddress>& landmark_pairs() const { return landmark_pairs_; }
  // Whether every landmark's W has a row for all kept scalars from first_seen() on: columns of one tall matrix, which
  // pays where most landmarks are seen by most kept variables, as in a window.
  bool landmark_panel() const { return landmark_panel_; }
  // Whether the reduced system is formed. Where it is not, H has the blocks of kept variables that share a factor, and
  // those that only share landmarks have none.
  bool forms_reduced() const { return forms_reduced_; }
  // Whether LinearSolver::automatic had a choice to make, or would have had.
  bool is_large() const { return is_large_; }
  int first_seen() const { return first_seen_; }      // kept block from which on all see landmarks
  int first_scalar() const { return first_scalar_; }  // of that block, in a step
  int panel_rows() const { return kept_dim_ - first_scalar_; }
  double landmark_flops() const { return landmark_flops_; }  // of S = H - W V⁻¹ Wᵀ
  int kept_dim() const { return kept_dim_; }
  int dim() const { return dim_; }  // of a step: kept and landmarks
  std::int64_t landmark_store() const { return landmark_store_; }
  // [doubles] of H with the partial sums behind it.
  std::int64_t hessian_size() const { return hessian_size_; }
  // Whether slices clear the landmark store.
  bool slices_clear_landmarks() const { return slices_clear_landmarks_; }
  std::size_t row_count() const { return row_count_; }
  Multifrontal& factorization() { return factorization_; }
  const Multifrontal& factorization() const { return factorization_; }
  // Offset in a step by dense position, -1 for what does not move.
  const std::vector<std::int32_t>& offsets(std::size_t pool) const { return offsets_[pool]; }
  const Target& target(std::size_t pool, std::uint32_t dense) const { return targets_[pool][dense]; }
  BlockAddress address(int i, int j) const;
  const BlockPattern& pattern() const { return pattern_; }  // of the kept blocks
  // The variable to which scalar `s` of a step belongs: (pool, dense, scalar within it).
  void locate(int s, std::uint32_t& pool, std::uint32_t& dense, int& within) const;

 private:
  void order_types(const Graph& graph);
  void number_variables(const Graph& graph);
  void demote_landmarks(const Graph& graph);
  void demote_few_landmarks();
  void collect_rows(const Graph& graph);
  void collect_rows(const Graph& graph, TablePlan& plan, std::size_t from);
  void collect_kept(const Graph& graph);
  void plan_table(TablePlan& plan, std::size_t from);
  void plan_row(TablePlan& plan, std::size_t row);
  void set_active(TablePlan& plan);
  int find_landmark_argument(const TablePlan& plan) const;
  bool count_runs(const TablePlan& plan);
  void group_rows(TablePlan& plan);
  void add_runs(TablePlan& plan, std::uint32_t first, std::uint32_t count);
  static bool is_long_enough_for_slices(const TablePlan& plan);
  void slice_rows(TablePlan& plan);
  bool sort_rows(const TablePlan& plan);
  void cut_rows(TablePlan& plan);
  void place_slices();
  void clear_by_slices(TablePlan& plan);
  void find_shared(const TablePlan& plan);
  void find_split_keys(const TablePlan& plan);
  SharedBlocks::Entry* shared_entry(const TablePlan& plan, std::size_t row, std::size_t pair, std::size_t slice);
  void place_partials(TablePlan& plan);
  void place_partials_of_row(TablePlan& plan, std::size_t row, int slice);
  void number_kept(const Graph& graph);
  void plan_priors(const Graph& graph);
  void find_neighbours();
  void find_few_neighbours(int seen);
  void choose_panel();
  void place_landmarks();
  void place_panel_rows(TablePlan& plan);
  void connect_rows();
  void connect_neighbours();
  bool may_form_reduced() const;
  double iterative_seconds() const;
  void find_pattern();
  Result<void> factorize(const FactorOptions& options);
  void tabulate();
  Result<void> analyze(const FactorOptions& options);
  bool may_cut(const Graph& graph) const;
  void find_cuts(const Graph& graph);
  void remember_tails();
  void note_seen(const Graph& graph);
  void look_at_all_rows(const Graph& graph);
  void find_changed_blocks(const Graph& graph, const FactorOptions& options);
  void plan_followed(const Graph& graph);
  void find_elsewhere(const Graph& graph);
  void plan_again(const Graph& graph, TablePlan& plan, std::size_t row);
  void find_changed_rows(std::size_t table);
  void note_priors();
  void touch(int block);
  void touch(const Target* targets, std::size_t arguments);
  template <class F>
  void for_each_row(const Graph& graph, VariableKey id, F function);
  VariableKey key_of(const Graph& graph, const KeptBlock& block) const;
  void follow_pattern(const Graph& graph);
  void connect_changed(const Target& x, const Target& y);
  Result<void> analyze_large(const Graph& graph, const FactorOptions& options, EliminationOrder& order);
  Result<void> use_order(const FactorOptions& options);
  bool arrange(const FactorOptions& options, const EliminationOrder& order);
  void leave_out_gone();
  void find_places(const EliminationOrder& order);
  void append_new();
  void note_order(EliminationOrder& order);
  void mark_moved();
  void connect(int i, int j);
  void place_pairs(const Graph& graph);
  void place_moved_pairs(const Graph& graph);
  void place_pairs_of_row(TablePlan& plan, std::size_t row);
  void place_landmark_pairs();

  std::vector<TablePlan> plans_;
  std::vector<PriorPlan> priors_;
  std::size_t plan_count_ = 0, prior_count_ = 0, row_count_ = 0;
  std::vector<KeptBlock> kept_;
  std::vector<LandmarkBlock> landmarks_;
  std::vector<std::int32_t> neighbours_;
  std::vector<BlockAddress> landmark_pairs_;
  std::vector<std::vector<Target>> targets_;             // by pool and dense position
  std::vector<std::vector<std::int32_t>> offsets_;       // the same, offsets alone
  std::vector<std::uint32_t> pool_order_, table_order_;  // by name
  std::uint64_t version_ = 0;
  int kept_dim_ = 0, dim_ = 0, first_seen_ = 0, first_scalar_ = 0;
  bool landmark_panel_ = false, forms_reduced_ = true, is_large_ = false, slices_clear_landmarks_ = false;
  bool has_landmark_types_ = false;  // whether any variable is of one
  double landmark_flops_ = 0.0;
  std::int64_t landmark_store_ = 0, hessian_size_ = 0;
  Multifrontal factorization_;

  FollowedStructure followed_;

  // Scratch of build.
  std::vector<std::uint32_t> run_key_, run_begin_, grouped_rows_, grouped_dense_, sorted_;
  SharedBlocks shared_;
  std::vector<std::pair<std::int32_t, std::int32_t>>
      split_keys_;  // by slice: shared with the one before, with the next
  BlockPattern pattern_;
  std::vector<int> dims_, order_;
  std::vector<std::pair<std::int32_t, std::int32_t>> sightings_, sorted_sightings_;
  std::vector<std::int32_t> count_;
  std::vector<std::uint64_t> seen_by_;  // by landmark: bits of the kept blocks from first_seen_ on, where those are few
  std::vector<char> connected_;         // blocks × blocks, where that is small
  std::vector<BlockAddress> small_table_;  // the same, addresses
};

}  // namespace oriel
