// Graph: variables, the factors that connect them, and nothing of how they are solved.
//
// It changes by values alone: apply(GraphEdit) and adopt(Solution). An edit is validated, space is reserved, then it is
// committed without failure: whole or not at all. One writer; readers in between.
#pragma once
#include <string>
#include <vector>

#include "oriel/base/identity.h"
#include "oriel/base/owned.h"
#include "oriel/base/result.h"
#include "oriel/graph/change_log.h"
#include "oriel/graph/factor_table.h"
#include "oriel/graph/graph_edit.h"
#include "oriel/graph/variable_pool.h"

namespace oriel {

class LabelTable;  // labels.h

// Values that an engine found, and the version of the graph that it started from.
struct Solution {
  struct Column {
    const VariableOps* ops = nullptr;
    std::vector<SlotKey> keys;
    ByteColumn values;
  };
  std::uint64_t version = 0;
  std::vector<Column> columns;
};

class Graph {
 public:
  static constexpr std::uint32_t kPriorTable = 0xfffffffeu;  // stands for the table of priors in an Incidence

  // One entry of the list of factors at a variable.
  struct Incidence {
    std::uint32_t next = VariablePool::kNoIncidence, previous = VariablePool::kNoIncidence;
    std::uint32_t table = 0;  // place in tables(), or kPriorTable
    std::uint32_t slot = 0;   // of the factor
    std::uint32_t arg = 0;    // which of its variables
  };

  Graph();  // this and what follows in the library, so that not every user's program compiles it anew
  Graph(const Graph&) = delete;  // ids name one graph; a copy is made by a follower that is sent the whole of it
  Graph& operator=(const Graph&) = delete;
  Graph(Graph&&) noexcept;
  Graph& operator=(Graph&&) noexcept;
  ~Graph();

  GraphEdit edit() { return GraphEdit(*this); }

  // What the edit has placeholders for is given ids here, in the edit as well (GraphEdit::resolved); a refused edit
  // keeps its placeholders. Refused, with the item named: unknown or stale ids, the same id twice, values or
  // measurements that are not finite, noise that is no noise, priors of the wrong size, a version that is not the
  // graph's. Then nothing has changed.
  Result<void> apply(GraphEdit& edit) noexcept;

  // Takes over values; leaves out what is fixed, gone, or was added, set or restricted by the user after the solution's
  // version. Refused whole if any value is not finite. Raises no flag for followers (C5).
  Result<void> adopt(const Solution& solution) noexcept;

  template <Variable V>
  bool contains(VariableId<V> id) const {
    return find_value(id) != nullptr;
  }
  bool contains(FactorId id) const;
  template <Variable V>
  const V* find(VariableId<V> id) const {
    return static_cast<const V*>(find_value(id));
  }
  // Fails loudly, naming the id, if it does not resolve.
  template <Variable V>
  const V& value(VariableId<V> id) const {
    const void* p = find_value(id);
    if (p == nullptr) [[unlikely]]
      unresolved(id);
    return *static_cast<const V*>(p);
  }

  std::size_t variable_count() const;  // constants included
  std::size_t factor_count() const;    // priors included
  template <Variable V>
  std::size_t count() const {
    const VariablePool* p = find_pool(kVariableOps<V>.key);
    return p == nullptr ? 0 : p->slots().size();
  }
  // In the order of serials: f(id, value).
  template <Variable V, class F>
  void for_each(F&& f) const {
    const VariablePool* p = find_pool(kVariableOps<V>.key);
    for (std::uint32_t d = 0; p != nullptr && d < p->extent(); ++d)
      if (p->slots().is_live(d)) f(VariableId<V>{p->slots().key(d)}, *static_cast<const V*>(p->value(d)));
  }
  // All factors at a variable: f(table place or kPriorTable, row).
  template <class F>
  void for_each_factor(VariableKey id, F&& f) const;

  // Grows with every change; structure_version only when variables, factors or fixed flags change.
  std::uint64_t version() const { return version_; }
  std::uint64_t structure_version() const { return structure_version_; }
  // Grows with every solution that is adopted: what a follower by edits alone does not hear of.
  std::uint64_t adoptions() const { return adoptions_; }
  bool fixed(VariableKey id) const;
  // Grows when a freedom changes, which is no change of structure.
  std::uint64_t freedom_version() const { return freedom_version_; }
  Freedom freedom(VariableKey id) const;  // full where there is no such variable

  // ---- followers ----
  Subscription subscribe() { return log_.subscribe(); }
  void unsubscribe(Subscription s) { log_.unsubscribe(s); }
  // Writes the net of what the follower has not seen into `out` (cleared first), with ids and serials, and marks it
  // as seen. Applied to a graph that followed so far, it makes that graph equal to this one (but for what engines have
  // found since, C5). A follower that had fallen behind (log().behind) is given the whole graph: out.whole() says that
  // whoever follows forgets what he has; apply and the wire do so by themselves.
  void collect(Subscription s, GraphEdit& out);
  const ChangeLog& log() const { return log_; }
  void bound_log(const ChangeLog::Bound& bound) { log_.set_bound(bound); }

  // ---- what engines and reports read ----
  // For those who compare what they have seen with what there is (SlotIndex::changes): that it was this graph. Moves
  // with the graph.
  const Identity& identity() const { return identity_; }
  const std::vector<Owned<VariablePool>>& pools() const { return pools_; }
  const std::vector<Owned<FactorTable>>& tables() const { return tables_; }
  const PriorTable& priors() const { return priors_; }
  const VariablePool* find_pool(std::uint64_t type) const;
  const void* find_value(VariableKey id) const;
  const VariableOps* find_ops(std::uint64_t type) const;
  const FactorOps* find_factor_ops(std::uint64_t table) const;
  // "pose3/1 'start'" or "pose3/1 #4.1", for people.
  std::string describe(VariableKey id) const;

  // ---- the source of ids, for edits ----
  SlotKey lend(const VariableOps* ops);
  SlotKey lend(const FactorOps* ops);
  SlotKey lend_prior() { return priors_.slots().lend(); }
  void give_back(const GraphEdit& edit);

 private:
  friend class EditValidator;
  friend class EditCommit;

  [[noreturn]] void unresolved(VariableKey id) const;
  Result<void> replace(GraphEdit& whole) noexcept;
  std::uint32_t pool_index(const VariableOps* ops);
  std::uint32_t table_index(const FactorOps* ops);
  void collect_labels(GraphEdit& out) const;
  void collect_losses(std::uint64_t seen, GraphEdit& out) const;
  VariablePool* pool_of(std::uint64_t type) { return const_cast<VariablePool*>(find_pool(type)); }

  Identity identity_ = Identity::make();
  std::vector<Owned<VariablePool>> pools_;
  std::vector<Owned<FactorTable>> tables_;
  PriorTable priors_;
  std::vector<Incidence> incidences_;
  std::vector<std::uint32_t> free_incidences_;
  Owned<LabelTable> labels_;  // null until there is one
  ChangeLog log_;
  // Scratch of apply: priors that lose a variable, and what is left of one.
  std::vector<std::uint32_t> touched_priors_;
  std::vector<double> derived_rows_;
  std::vector<char> derived_leaving_;
  LinearPrior derived_prior_;
  std::vector<VariableRef> prior_refs_;  // scratch of apply
  edit::SlotMarks marks_;                // scratch of apply
  GraphEdit derived_;                    // scratch of apply: priors that lose variables
  std::uint64_t version_ = 0, structure_version_ = 0, freedom_version_ = 0, adoptions_ = 0, next_serial_ = 1;
};

template <class F>
void Graph::for_each_factor(VariableKey id, F&& f) const {
  const VariablePool* pool = find_pool(id.type);
  const std::uint32_t dense = pool == nullptr ? SlotIndex::kNone : pool->slots().find(id.key);
  if (dense == SlotIndex::kNone) return;
  for (std::uint32_t i = pool->incidence(dense); i != VariablePool::kNoIncidence; i = incidences_[i].next) {
    const Incidence& e = incidences_[i];
    f(e.table, e.table == kPriorTable ? priors_.slots().dense(e.slot) : tables_[e.table]->slots().dense(e.slot));
  }
}

}  // namespace oriel
