// What a marginalization is about: which variables leave, which factors are used up by that, and whom they touch. No
// numbers yet. Everything here is a function of the live graph, not of how its lists happen to be linked: variables and
// tables are walked by type name and serial, so a replica comes to the same sums in the same order (decision 5).
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "oriel/base/result.h"
#include "oriel/graph/graph.h"

namespace oriel {

// What becomes of a landmark that both leaving and staying variables see (decision 10).
enum class LandmarkPolicy {
  keep,   // it stays and joins the prior: exact
  close,  // it leaves too and all its factors are used up: the prior is on every pose that saw it
  drop,   // it leaves with its factors, which are not absorbed
};

// What becomes of a variable that is asked to leave, by type.
enum class Departure : std::uint8_t {
  marginalize,  // it leaves; what its factors say about the rest is kept
  condition,    // it leaves, and is taken as known at its value: what its factors say about the rest given that
  fix,          // it stays, fixed at its value; what leaves beside it takes it as known
  drop,         // it leaves with its factors, which are not absorbed; what a prior says of it is marginalized
};

// What a variable of some type that stays keeps of a new prior.
enum class Tie : std::uint8_t {
  all,   // all of it
  own,   // its own marginal, no correlation with the rest: variances as they were, but not conservative
  none,  // nothing: it is marginalized out of the prior, so what is left says less, never more
};

struct TypePolicy {
  std::uint64_t type = 0;  // key of the variables' type
  Departure departure = Departure::marginalize;
  Tie tie = Tie::all;
};
// That of a type; the default where it is not in the list.
inline TypePolicy policy_of(std::span<const TypePolicy> types, std::uint64_t type) {
  for (const TypePolicy& p : types)
    if (p.type == type) return p;
  return {};
}
template <Variable V>
constexpr TypePolicy policy_for(Departure departure, Tie tie = Tie::all) {
  return {kVariableOps<V>.key, departure, tie};
}

// A variable that leaves, or that a used-up factor touches.
struct MarginalVariable {
  enum class Role : std::uint8_t { staying, leaving, dropped };
  VariableKey id;
  std::uint32_t pool = 0, dense = 0;
  int dim = 0;
  Role role = Role::staying;
  bool fixed = false;       // known: no columns, its value is taken as it is
  bool held = false;        // to be fixed from now on
  bool restricted = false;  // leaves, and some of its directions are known (graph/freedom.h)
  bool landmark = false;    // by type
  bool in_prior = false;    // an absorbed prior has columns of it
  bool eliminated = false;  // a leaving landmark that is eliminated on its own, before the rest
  bool seen = false;        // shares a factor with an eliminated landmark
  std::int32_t found = 0;   // place in the order of discovery
  std::int32_t component = -1;
  // Of its first scalar: among the component's columns, leaving ones first; of an eliminated landmark, among those.
  std::int32_t column = -1;
  std::int32_t chunk = 0, chunk_slot = 0, chunk_column = 0;  // of an eliminated landmark

  bool has_columns() const { return !fixed && role != Role::dropped; }
};

// What a row or a prior touches, constants apart, in its own order: a slice of a list of places in variables().
struct MarginalArguments {
  std::uint32_t first = 0, count = 0;
};

struct MarginalRow {
  std::uint64_t major = 0, minor = 0;  // what it is sorted by
  std::uint32_t table = 0, row = 0;
  std::int32_t component = -1, chunk = 0;
  MarginalArguments arguments;
};

struct MarginalPrior {
  std::uint32_t row = 0;
  std::int32_t component = -1;
  MarginalArguments arguments;
};

// Variables that absorbed factors connect. Each has a prior of its own, so disjoint ones stay separate (M11).
struct MarginalComponent {
  int landmark_dim = 0, leaving_dim = 0, staying_dim = 0;
  int seen_begin = 0, seen_end = 0;                      // columns of variables that see eliminated landmarks
  std::uint32_t variables_begin = 0, variables_end = 0;  // in ordered()
  std::uint32_t rows_begin = 0, rows_end = 0, priors_begin = 0, priors_end = 0;
  int dim() const { return leaving_dim + staying_dim; }
};

// A live row of a table, or of the priors (table: Graph::kPriorTable).
struct AbsorbedFactor {
  std::uint32_t table = 0, row = 0;
};

class MarginalScope {
 public:
  static constexpr int kChunk = 64;  // landmarks that are eliminated together

  // Refused, with the variable named: an unknown or stale id, the same twice, a constant. The graph is not changed.
  // Landmarks that are asked to leave are eliminated like any other variable, not on their own, if `keep_asked...`.
  Result<void> collect(const Graph& graph, std::span<const VariableKey> leaving, LandmarkPolicy policy,
                       std::span<const TypePolicy> types = {}, bool keep_asked_landmarks = false);
  // Nothing leaves but these factors, live rows of tables, and priors: one component, unless all they touch is known.
  void collect_factors(const Graph& graph, std::span<const AbsorbedFactor> factors);

  const std::vector<MarginalVariable>& variables() const { return variables_; }
  const std::vector<MarginalRow>& rows() const { return rows_; }
  const std::vector<MarginalPrior>& priors() const { return priors_; }
  const std::vector<MarginalComponent>& components() const { return components_; }
  // Variables with columns: component by component, eliminated landmarks first, then in the order of columns.
  const std::vector<std::uint32_t>& ordered() const { return ordered_; }
  std::span<const std::int32_t> arguments(MarginalArguments list) const {
    return {arguments_.data() + list.first, list.count};
  }

  int dropped_variables = 0;  // by Departure::drop
  int closed_landmarks = 0, leaving_landmarks = 0, kept_landmarks = 0, dropped_landmarks = 0, dropped_factors = 0;

 private:
  struct Mark {
    std::uint32_t stamp = 0;
    std::int32_t at = 0;
  };
  void reset(const Graph& graph);
  // Place in variables(), or -1.
  std::int32_t find(std::uint32_t pool, std::uint32_t dense) const;
  MarginalArguments add_all(const Graph& graph, std::span<const VariableRef> refs);
  Result<void> add_leaving(const Graph& graph, VariableKey id, std::span<const TypePolicy> types);
  void drop_asked(const Graph& graph, std::int32_t at);
  void arrange(const Graph& graph);
  std::int32_t add(const Graph& graph, std::uint32_t pool, std::uint32_t dense);
  void judge_landmarks(const Graph& graph, std::int32_t at, LandmarkPolicy policy);
  template <class F>
  void for_each_landmark(const Graph& graph, std::int32_t at, F&& f) const;
  void judge_landmark(const Graph& graph, std::int32_t at, LandmarkPolicy policy);
  bool seen_by_leaving_alone(const Graph& graph, std::int32_t at) const;
  bool is_orphan(const Graph& graph, VariableKey id) const;
  void drop(const Graph& graph, std::int32_t at);
  bool claim(std::vector<std::uint32_t>& stamps, std::uint32_t row);
  void absorb_factors(const Graph& graph, std::int32_t at);
  void absorb_row(const Graph& graph, std::uint32_t table, std::uint32_t row);
  void absorb_prior(const Graph& graph, std::uint32_t row);
  void rank_types(const Graph& graph);
  void sort_variables();
  void choose_landmarks();
  void find_components();
  void place_columns();
  void sort_rows();
  void slice_components();
  std::int32_t root(std::int32_t v);
  void connect(std::int32_t a, std::int32_t b);

  std::vector<MarginalVariable> variables_;
  std::vector<MarginalRow> rows_;
  std::vector<MarginalPrior> priors_;
  std::vector<MarginalComponent> components_;
  std::vector<std::uint32_t> ordered_;
  std::vector<std::int32_t> arguments_;

  bool keep_asked_landmarks_ = false;
  std::int32_t asked_ = 0;  // variables() begins with those that the caller named, until it is sorted
  std::uint32_t stamp_ = 0;
  std::vector<std::vector<Mark>> marks_;                // by pool and dense position
  std::vector<std::vector<std::uint32_t>> row_stamps_;  // by table and row
  std::vector<std::uint32_t> prior_stamps_;
  std::vector<std::uint32_t> pool_rank_, table_rank_, types_;
  std::vector<std::int32_t> parent_;
  std::vector<std::uint64_t> keys_;
};

}  // namespace oriel
