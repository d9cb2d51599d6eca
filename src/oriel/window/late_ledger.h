// Late data: a factor on states that have been marginalized becomes what it would have said about those that live.
//
// Marginalization splits p(leaving, staying) = p(leaving | staying) p(staying). The second factor is the prior that the
// graph gets; the first one is dropped as a rule. The ledger keeps it: the rows that leave the square-root elimination,
// about the points of linearization x̂ (first estimates where there are any),
//   0 = d + R (x_L ⊟ x̂_L) + S (x_S ⊟ x̂_S),   R upper triangular.
// A late factor is linearized where back substitution through these rows puts the old states, given the live values
// (Jacobians at x̂; the robust weight is fixed from then on). It is then pushed along the elimination: stacked below the
// rows of the oldest state that it touches, the columns of x_L are brought to zero by reflections. The upper rows are
// the conditional that knows of it, the lower ones touch newer states alone; and so on until only live ones are left:
// that is a LinearPrior. For linear problems live states then have the means and covariances that they would have had.
//
// A time that never had a state, between a and b: the halves of its motion factor, on (a, s, b), are reduced to
// p(s | a, b). What they say about a and b is in the graph's prior already, if motion noise splits; it is discarded.
// s is then in the ledger as if it had left before all others. A third state between a and s is tied to s, not to b.
//
// Refused and counted, with the graph, the edit and the ledger as they were: a path through a variable older than the
// horizon (forgotten), one that was removed or dropped or left with directions held (removed), or a landmark that left
// by the landmark policy (landmark; one that was asked to leave is kept like any other); a factor that is not valid, or
// an outlier, at the smoothed estimate; a new state that its halves do not determine. Nonlinear problems: the old
// states' other factors are not linearized again, so what is folded is right to first order about the smoothed
// estimate.
//
// Memory: all blocks have room for the largest so far, so a steady window without late data asks for none.
#pragma once
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "oriel/graph/graph.h"
#include "oriel/linear/aligned_buffer.h"
#include "oriel/window/absorbed_batch.h"
#include "oriel/window/conditional_store.h"
#include "oriel/window/detached_factor.h"

namespace oriel {

struct LateLedgerOptions {
  int conditionals = 200;  // at most: marginalizations as a rule; the oldest is forgotten first
  Duration horizon{0};     // older than the newest by more than this: forgotten; 0: no limit but the number
  bool first_estimates = true;
  double outlier_threshold = 0.0;  // [sigmas], as in MarginalizeOptions; 0: none
};

enum class LateOutcome : std::uint8_t {
  folded,
  live,          // nothing of it was marginalized: it belongs into the graph
  forgotten,     // older than the horizon
  removed,       // removed, dropped, left with directions held, or never there
  landmark,      // a landmark that left by policy
  invalid,       // not valid, or not finite, at the smoothed estimate
  outlier,       // above the outlier threshold
  undetermined,  // the halves of a motion factor do not determine the new state
};
inline constexpr int kLateOutcomes = 8;
std::string_view name_of(LateOutcome outcome);

class LateLedger {
 public:
  explicit LateLedger(const LateLedgerOptions& options = {}) : options_(options) {}

  // Folds a late factor: `edit` (lent by this graph) gets a prior on live variables, or nothing where the factor says
  // nothing about them, and names the version of the graph that was seen. Several may be folded into one edit. Staged.
  // (Many small priors are made one by Marginalizer::absorb, which takes priors as well.)
  LateOutcome fold(const Graph& graph, const DetachedFactor& factor, GraphEdit& edit);

  // An id for a variable that never was in the graph.
  template <Variable V>
  VariableId<V> lend() {
    return {placeholder_key(lent_++)};
  }
  // A state between others: variables with ids from lend() and first guesses, and the factors that tie them to their
  // neighbours. After `folded`, late factors may name its ids. Staged.
  LateOutcome add_state(const Graph& graph, std::span<const DetachedVariable> state,
                        std::span<const DetachedFactor> halves);

  // What is staged holds from now on: the edit beside it was applied. `stamp` is the time of the states that came in
  // since the last commit; then what is too old is forgotten.
  void commit(Time stamp = {}) { store_.commit(stamp, options_.conditionals, options_.horizon); }
  // The edit was not applied.
  void discard() { store_.discard(); }
  void clear() { store_.clear(); }

  bool holds(VariableKey id) const { return store_.find(id) != nullptr; }
  // The variable of this type whose commit had exactly this stamp; where there is none, a key that `holds` denies.
  VariableKey find(Time stamp, std::uint64_t type) const { return store_.find(stamp, type); }
  // Where the live values put a variable; `to` has room for its bytes. False if the path is cut.
  bool smoothed(const Graph& graph, VariableKey id, void* to);

  std::size_t size() const { return store_.size(); }
  std::int64_t count(LateOutcome outcome) const { return counts_[static_cast<int>(outcome)]; }
  std::int64_t updated_conditionals() const { return updated_; }
  const LateLedgerOptions& options() const { return options_; }

  // For Marginalizer: what leaves with a component, given what stays; and those leaving that were taken as known.
  void stage(const Graph& graph, const MarginalScope& scope, const MarginalComponent& component,
             const SquareRootRows& root);
  void stage_known(const Graph& graph, const MarginalScope& scope);

 private:
  static constexpr std::int32_t kLive = -1, kNew = -2;
  // A variable on the way of a late factor.
  struct Stop {
    VariableKey id;
    const VariableOps* ops = nullptr;
    std::int32_t entry = kLive;       // kNew: of a state that is being added
    int column = -1;                  // of the way; -1: a constant, or known
    const void* reference = nullptr;  // x̂
    const void* value = nullptr;      // where it is now
    std::size_t smoothed = 0;         // place of that value in values_, unless it is live
    std::uint32_t active = 0;         // stamp of the entry that is being passed
    int local = 0;                    // column among those that are active
  };
  LateOutcome counted(LateOutcome outcome);
  LateOutcome walk(const Graph& graph, std::span<const DetachedVariable> state, std::span<const DetachedFactor> rows);
  LateOutcome visit(const Graph& graph, VariableKey id);
  void lay_out();
  Stop& stop_of(VariableKey id);
  void smooth();
  void begin_rows(int rows);
  LateOutcome evaluate(const DetachedFactor& factor, int first);
  void take_rows(const DetachedFactor& factor, const Batch& batch, int first);
  bool touches(const Stop& stop, int rows);
  bool push(std::int32_t entry);
  bool activate(const Conditional& c);
  void stack(const Conditional& c);
  void write_prior(const Graph& graph, GraphEdit& edit);
  void move_state(std::size_t variables, int dim);
  void keep_state(std::size_t variables, int dim);
  void make_triangular(Conditional& c, int rows);
  double* row_column(int c) { return rows_.data() + static_cast<std::ptrdiff_t>(c) * row_count_; }

  LateLedgerOptions options_;
  ConditionalStore store_;
  std::int64_t counts_[kLateOutcomes] = {}, updated_ = 0;
  std::uint32_t lent_ = 0, stamp_ = 0;

  // Of the fold at hand: the way, oldest entry first; its variables, by column; late rows over these, column-major.
  std::vector<std::int32_t> way_, by_id_, active_;
  std::vector<Stop> stops_;
  int columns_ = 0, row_count_ = 0;
  std::vector<double> values_, right_, rows_, bound_, stacked_, whole_, error_;
  std::vector<char> empty_;
  AlignedBuffer r_, j_;
  LinearPrior prior_;
};

}  // namespace oriel
