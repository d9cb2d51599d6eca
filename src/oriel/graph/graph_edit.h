// GraphEdit: what is to change, as a value. The only way in which a graph changes (beside Graph::adopt).
//
// An edit that a graph lends gives out ids at once; the graph itself is unchanged until `apply`. The same value is what
// marginalization returns, what followers of a graph are sent (change_log.h), and what a journal records. It is
// reusable storage: clear() keeps its memory, so the edits of a steady window allocate nothing.
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "oriel/base/byte_column.h"
#include "oriel/base/owned.h"
#include "oriel/graph/freedom.h"
#include "oriel/graph/ids.h"
#include "oriel/graph/type_ops.h"

namespace oriel {

class Graph;

namespace edit {

// Position of a slot in a column, by slot index; forgets in time proportional to what it holds. Placeholders are not
// marked: they say themselves where they stand.
class SlotMarks {
 public:
  static constexpr std::uint32_t kNone = 0xffffffffu;
  std::uint32_t find(std::uint32_t index) const { return index < at_.size() ? at_[index] : kNone; }
  void set(std::uint32_t index, std::uint32_t position);
  void forget(std::uint32_t index) {
    if (index < at_.size()) at_[index] = kNone;
  }

 private:
  std::vector<std::uint32_t> at_;
};

struct AddedVariable {
  SlotKey key;
  std::uint64_t serial = 0;  // 0: apply gives it one
  std::uint64_t order = 0;   // among all that this edit adds
  bool fixed = false, has_first_estimate = false;
  Freedom freedom{};
};
enum class SetKind : std::uint8_t { value, first_estimate };

// Everything of one variable type.
struct Variables {
  const VariableOps* ops = nullptr;
  std::vector<AddedVariable> added;
  ByteColumn values, first_estimates;  // parallel to added
  std::vector<SlotKey> removed;
  std::vector<std::pair<SlotKey, SetKind>> set;
  ByteColumn set_values;  // parallel to set
  std::vector<std::pair<SlotKey, bool>> fixed;
  std::vector<std::pair<SlotKey, Freedom>> freedoms;  // set; of one that is named twice the last
  SlotMarks added_at, removed_at;

  explicit Variables(const VariableOps* o);
  void clear();
  bool empty() const { return added.empty() && removed.empty() && set.empty() && fixed.empty() && freedoms.empty(); }
  void add(const AddedVariable& a, const void* value, const void* first_estimate);
  void remove(SlotKey key);
  // Position in `added`, or SlotMarks::kNone.
  std::uint32_t find_added(SlotKey key) const;
  bool removes(SlotKey key) const;
};

struct AddedFactor {
  SlotKey key;
  std::uint64_t serial = 0, order = 0;
  Loss loss;
};

// Everything of one factor table.
struct Factors {
  const FactorOps* ops = nullptr;
  std::vector<AddedFactor> added;
  ByteColumn measurements, noises;
  std::vector<SlotKey> variables;  // arity of them a row
  std::vector<SlotKey> removed;
  SlotMarks removed_at;
  std::vector<std::pair<SlotKey, Loss>> losses;  // set; of one that is named twice the last

  explicit Factors(const FactorOps* o);
  void clear();
  bool empty() const { return added.empty() && removed.empty() && losses.empty(); }
  bool removes(SlotKey key) const {
    const std::uint32_t at = removed_at.find(key.index);
    return at != SlotMarks::kNone && removed[at] == key;
  }
};

struct AddedPrior {
  SlotKey key;
  std::uint64_t serial = 0, order = 0;
  std::uint32_t variables = 0, variable_count = 0;  // in Priors::variables
  std::size_t block = 0, block_size = 0;            // in Priors::numbers; layout in factor_table.h
  bool well_formed = true;                          // its parts have the sizes that it says
};
struct Priors {
  std::vector<AddedPrior> added;
  std::vector<VariableKey> variables;
  std::vector<double> numbers;
  std::vector<SlotKey> removed;
  void clear();
  bool empty() const { return added.empty() && removed.empty(); }
  bool removes(SlotKey key) const {  // few are removed at a time
    for (const SlotKey& k : removed)
      if (k == key) return true;
    return false;
  }
};

// What is to be done to a thing of a type that the edit has no column for yet, and knows no graph to ask.
struct Unmet {
  enum class What : std::uint8_t { fix, release, remove_variable, remove_factor, set_loss, set_freedom };
  What what;
  std::uint64_t type = 0;  // of the variable, or the table
  SlotKey key;
  Loss loss = Loss::none();
  Freedom freedom{};
};

}  // namespace edit

// A prior as one writes it down: r = d + R (x ⊟ x̂), see residual/linear_prior.h.
struct LinearPrior {
  std::vector<VariableKey> variables;  // in the order of the columns
  std::vector<double> estimates;       // x̂: the bytes of each value, rounded up to doubles, one after the other
  int rows = 0, cols = 0;
  std::vector<double> d, R;  // rows; rows × cols column-major
};

// Doubles that a value takes in LinearPrior::estimates.
inline std::size_t estimate_doubles(const VariableOps& ops) { return (ops.bytes + 7) / 8; }

class GraphEdit {
 public:
  // An edit that carries ids given elsewhere (a message, a journal); a graph's own edits come from Graph::edit().
  GraphEdit();
  explicit GraphEdit(Graph& graph);
  // An edit by somebody who must not lend ids: a worker beside the graph. What it adds has placeholder ids, good within
  // the edit at once; the graph that it is for gives the true ones in `apply` (decision 8), and `resolved` tells them.
  // `seen` is what the worker knows of it, a replica; without, it puts no prior on what exists, and the graph looks up
  // in `apply` what is fixed, removed or given a loss. Existing things are named by their true ids.
  static GraphEdit proposal(const Graph* seen = nullptr);
  GraphEdit(GraphEdit&&) noexcept;
  GraphEdit& operator=(GraphEdit&&) noexcept;
  ~GraphEdit();

  // A new variable; its id may be used at once, in this edit and (once applied) everywhere.
  template <Variable V>
  VariableId<V> add(const V& value, Label label = {});

  // A new factor. Its noise is Sigma, Sigmas, Information, SqrtInformation or Covariance (residual/noise.h); the ids
  // are those of the residual's Variables, in order.
  template <Residual R, class Noise, class... V>
  FactorId add(const R& residual, const Noise& noise, VariableId<V>... variables) {
    return add(residual, noise, Loss::none(), variables...);
  }
  template <Residual R, class Noise, class... V>
  FactorId add(const R& residual, const Noise& noise, const Loss& loss, VariableId<V>... variables);

  FactorId add(const LinearPrior& prior);

  // The value that the variable will have: what this edit adds or sets, else what the graph holds.
  template <Variable V>
  V value(VariableId<V> id) const;

  template <Variable V>
  void set(VariableId<V> id, const V& value);
  // Another loss for a factor that is in the graph; its id stays.
  void set(FactorId id, const Loss& loss);
  // A fixed variable takes part in factors and is not moved by solvers.
  void fix(VariableKey id, bool fixed = true);
  // Which of its directions solvers may take, in the place of what was set before; Freedom::full() takes it back. Its
  // factors, priors, value and first estimate stay as they are; fixed, it is not moved at all. Refused: components that
  // the type has not, world axes of a type without (manifold.h), and all components at once, which is to be fixed.
  void set(VariableKey id, const Freedom& freedom);
  // Removes the variable and every factor on it; a LinearPrior loses that variable alone (marginalized out). An id
  // that the graph does not know makes the edit one that is refused, here, in `fix` and in
  // `set`.
  void remove(VariableKey id);
  void remove(FactorId id);

  // The id that apply has given to a thing for which this edit had a placeholder; any other id as it is.
  template <Variable V>
  VariableId<V> resolved(VariableId<V> id) const {
    return {resolved(VariableKey(id)).key};
  }
  VariableKey resolved(VariableKey id) const;
  FactorId resolved(FactorId id) const;

  // The edit is only valid for a graph at this version; else it is refused as a conflict (marginalization).
  void require_version(std::uint64_t version) { required_version_ = version; }
  std::uint64_t required_version() const { return required_version_; }

  // It is the whole of a graph: applied, it replaces what is there (Graph::collect, for a follower that fell behind).
  void mark_whole() { whole_ = true; }
  bool whole() const { return whole_; }

  // The graph whose ids it gives out; null if its ids were given elsewhere.
  const Graph* lender() const { return graph_; }

  bool empty() const;
  // Forgets everything, keeps the memory. Ids that were lent and not applied are returned to the graph.
  void clear();

  // ---- what apply, journals and followers read ----
  edit::Variables& variables(const VariableOps* ops);
  edit::Factors& factors(const FactorOps* ops);
  edit::Priors& priors() { return priors_; }
  const edit::Priors& priors() const { return priors_; }
  auto& variable_columns() { return variables_; }
  const auto& variable_columns() const { return variables_; }
  auto& factor_columns() { return factors_; }
  const auto& factor_columns() const { return factors_; }
  auto& labels() { return labels_; }
  const auto& labels() const { return labels_; }
  const edit::Variables* find_variables(std::uint64_t type) const;
  // The first id of a type or table that the graph has never seen, as text; empty if there is none.
  const std::string& unknown() const { return unknown_; }
  std::uint64_t next_order() { return order_++; }
  std::uint64_t order() const { return order_; }
  // By apply: what a proposal names that had no graph to look it up in.
  void meet(const Graph& graph);
  void mark_applied() { applied_ = true; }
  bool applied() const { return applied_; }

 private:
  GraphEdit(const Graph* seen, bool proposes) : seen_(seen), proposes_(proposes) {}
  SlotKey add_variable(const VariableOps* ops, const void* value, Label& label);
  void check_lender() const;
  FactorId add_factor(const FactorOps* ops, const void* measurement, const void* noise, const Loss& loss,
                      const SlotKey* variables);
  void set_value(const VariableOps* ops, SlotKey key, const void* value);
  const void* find_value(VariableKey id) const;
  edit::Variables* column_of(std::uint64_t type);
  void put_off(const edit::Unmet& what);
  edit::Factors* known_column(FactorId id, const char* what);
  edit::Variables* known_column(VariableKey id, const char* what);
  [[noreturn]] void unresolved(VariableKey id) const;

  Graph* graph_ = nullptr;       // gives the ids
  const Graph* seen_ = nullptr;  // where existing things are looked up
  bool proposes_ = false;        // has placeholders instead of ids
  std::vector<Owned<edit::Variables>> variables_;
  std::vector<Owned<edit::Factors>> factors_;
  edit::Priors priors_;
  std::vector<std::pair<VariableKey, std::string>> labels_;
  std::vector<edit::Unmet> unmet_;
  std::string unknown_;
  std::uint64_t order_ = 0, required_version_ = 0;
  bool applied_ = false, whole_ = false;
};

// ---- implementation of the templates ----

template <Variable V>
VariableId<V> GraphEdit::add(const V& value, Label label) {
  return {add_variable(&kVariableOps<V>, &value, label)};
}

namespace detail {
template <class Vars, class... V>
inline constexpr bool kSameVariables = false;
template <class... V>
inline constexpr bool kSameVariables<Types<V...>, V...> = true;
template <class Noise, int N>
inline constexpr bool kNoiseFits = false;
template <int N>
inline constexpr bool kNoiseFits<IsotropicNoise, N> = true;
template <int N>
inline constexpr bool kNoiseFits<DiagonalNoise<N>, N> = true;
template <int N>
inline constexpr bool kNoiseFits<FullNoise<N>, N> = true;
}  // namespace detail

template <Residual R, class Noise, class... V>
FactorId GraphEdit::add(const R& residual, const Noise& noise, const Loss& loss, VariableId<V>... variables) {
  static_assert(ResidualTraits<R>::kArity == sizeof...(V), "as many ids as the residual's Variables are needed");
  static_assert(detail::kSameVariables<typename R::Variables, V...>,
                "the ids must be those of the residual's Variables");
  static_assert(detail::kNoiseFits<Noise, ResidualTraits<R>::kDim>,
                "the noise has another dimension than the residual");
  static_assert(alignof(R) <= 16, "measurements are stored at 16 bytes' alignment");
  const SlotKey keys[] = {variables.key...};
  return add_factor(&kFactorOps<R, Noise>, &residual, &noise, loss, keys);
}

template <Variable V>
V GraphEdit::value(VariableId<V> id) const {
  const void* p = find_value(id);
  if (p == nullptr) [[unlikely]]
    unresolved(id);
  V v;
  std::memcpy(static_cast<void*>(&v), p, sizeof(V));
  return v;
}

template <Variable V>
void GraphEdit::set(VariableId<V> id, const V& value) {
  set_value(&kVariableOps<V>, id.key, &value);
}

}  // namespace oriel
