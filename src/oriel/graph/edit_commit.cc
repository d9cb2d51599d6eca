#include "oriel/graph/edit_commit.h"

#include <algorithm>

#include "oriel/graph/labels.h"

namespace oriel {

void EditCommit::run() {
  resolve();
  const bool structural = changes_structure();
  g_.derived_.clear();
  derive_priors();
  give_serials();
  reserve();
  ++g_.version_;
  set_losses();  // while all are there: one may leave with a variable
  remove_factors();
  remove_variables();
  add_variables();
  add_factors();
  add_priors(edit_.priors());
  add_priors(g_.derived_.priors());
  set_values();
  for (auto& p : g_.pools_) p->compact_if_due();
  for (auto& t : g_.tables_) t->compact_if_due();
  g_.priors_.compact_if_due();
  if (structural) g_.structure_version_ = g_.version_;
  g_.log_.settle(g_);
  edit_.mark_applied();
}

// Ids that came with the edit are taken before others are lent, here and for priors that lose a variable.
void EditCommit::claim() {
  auto take = [](SlotKey key, SlotIndex& slots) {
    if (!is_placeholder(key)) slots.claim(key);
  };
  for (auto& c : edit_.variable_columns())
    for (auto& a : c->added) take(a.key, g_.pools_[g_.pool_index(c->ops)]->slots());
  for (auto& c : edit_.factor_columns())
    for (auto& a : c->added) take(a.key, g_.tables_[g_.table_index(c->ops)]->slots());
  for (auto& a : edit_.priors().added) take(a.key, g_.priors_.slots());
}

// Ids for what has placeholders (decision 8), in the order in which the edit adds it.
void EditCommit::resolve() {
  claim();
  bool any = false;
  auto give = [&any](SlotKey& key, SlotIndex& slots) {
    if (!is_placeholder(key)) return;
    key = slots.lend();
    any = true;
  };
  for (auto& c : edit_.variable_columns())
    for (std::size_t i = 0; i < c->added.size(); ++i) {
      if (!is_placeholder(c->added[i].key)) continue;
      give(c->added[i].key, g_.pools_[g_.pool_index(c->ops)]->slots());
      c->added_at.set(c->added[i].key.index, static_cast<std::uint32_t>(i));
    }
  for (auto& c : edit_.factor_columns())
    for (auto& a : c->added)
      if (is_placeholder(a.key)) give(a.key, g_.tables_[g_.table_index(c->ops)]->slots());
  for (auto& a : edit_.priors().added) give(a.key, g_.priors_.slots());
  if (any) resolve_references();
}

void EditCommit::resolve_references() {
  auto resolve = [this](std::uint64_t type, SlotKey& key) { key = edit_.resolved(VariableKey{type, key}).key; };
  for (auto& c : edit_.variable_columns()) {
    for (auto& s : c->set) resolve(c->ops->key, s.first);
    for (auto& f : c->fixed) resolve(c->ops->key, f.first);
    for (auto& f : c->freedoms) resolve(c->ops->key, f.first);
  }
  for (auto& c : edit_.factor_columns()) {
    const auto& types = c->ops->variables;
    for (std::size_t i = 0; i < c->variables.size(); ++i) resolve(types[i % types.size()]->key, c->variables[i]);
  }
  for (VariableKey& id : edit_.priors().variables) id = edit_.resolved(id);
  for (auto& label : edit_.labels()) label.first = edit_.resolved(label.first);
}

bool EditCommit::changes_structure() const {
  for (const auto& c : edit_.variable_columns())
    if (!c->added.empty() || !c->removed.empty() || changes_fixed(*c)) return true;
  for (const auto& c : edit_.factor_columns())
    if (!c->empty()) return true;
  return !edit_.priors().empty();
}

bool EditCommit::changes_fixed(const edit::Variables& c) const {
  const VariablePool* pool = g_.find_pool(c.ops->key);
  return std::any_of(c.fixed.begin(), c.fixed.end(), [&](const auto& f) {
    return pool->fixed(pool->slots().find(f.first)) != f.second;  // nothing is added here, so each is in the graph
  });
}

void EditCommit::give_serials() {
  const std::uint64_t base = g_.next_serial_;
  std::uint64_t last = base + edit_.order();
  auto give = [&](auto& a) {
    if (a.serial == 0) a.serial = base + a.order;
    last = std::max(last, a.serial + 1);
  };
  for (auto& c : edit_.variable_columns())
    for (auto& a : c->added) give(a);
  for (auto& c : edit_.factor_columns())
    for (auto& a : c->added) give(a);
  for (auto& a : edit_.priors().added) give(a);
  for (auto& a : g_.derived_.priors().added) a.serial = last++;
  g_.next_serial_ = last;
}

// A prior on a variable that leaves is replaced by one that has lost that variable alone (V6).
void EditCommit::derive_priors() {
  if (g_.priors_.slots().size() == 0) return;
  std::vector<std::uint32_t>& rows = g_.touched_priors_;
  rows.clear();
  for (const auto& c : edit_.variable_columns())
    for (const SlotKey k : c->removed)
      g_.for_each_factor({c->ops->key, k}, [&](std::uint32_t table, std::uint32_t row) {
        if (table == Graph::kPriorTable) rows.push_back(row);
      });
  std::sort(rows.begin(), rows.end());
  rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
  const auto& removed = edit_.priors().removed;
  for (const std::uint32_t row : rows)
    if (std::find(removed.begin(), removed.end(), g_.priors_.slots().key(row)) == removed.end()) derive_prior(row);
}

bool EditCommit::leaves(const VariableRef& ref) const {
  const VariablePool& pool = *g_.pools_[ref.pool];
  const edit::Variables* c = edit_.find_variables(pool.ops().key);
  return c != nullptr && c->removes(pool.slots().key_of_slot(ref.slot));
}

// The columns of the variables that stay. One of which nothing is known any more is no part of the prior: it would tie
// what has nothing in common (M11).
void EditCommit::take_known(std::uint32_t row, int rows) {
  LinearPrior& rest = g_.derived_prior_;
  const double* estimate = g_.priors_.estimates(row);
  auto column = g_.derived_rows_.cbegin();
  for (const VariableRef& ref : g_.priors_.variables(row)) {
    const VariablePool& pool = *g_.pools_[ref.pool];
    const std::ptrdiff_t size = estimate_doubles(pool.ops());
    if (!leaves(ref)) {
      const auto end = column + static_cast<std::ptrdiff_t>(rows) * pool.ops().dim;
      if (std::any_of(column, end, [](double x) { return x != 0.0; })) {
        rest.variables.push_back({pool.ops().key, pool.slots().key_of_slot(ref.slot)});
        rest.estimates.insert(rest.estimates.end(), estimate, estimate + size);
        rest.R.insert(rest.R.end(), column, end);
      }
      column = end;
    }
    estimate += size;
  }
}

// What a prior says of the variables that stay, once the leaving ones are marginalized out of it alone.
void EditCommit::derive_prior(std::uint32_t row) {
  const LinearPriorView numbers = g_.priors_.numbers(row);
  std::vector<double>& R = g_.derived_rows_;
  std::vector<char>& leaving = g_.derived_leaving_;
  LinearPrior& rest = g_.derived_prior_;
  R.assign(numbers.R, numbers.R + static_cast<std::size_t>(numbers.rows) * numbers.cols);
  leaving.clear();
  for (const VariableRef& ref : g_.priors_.variables(row))
    leaving.insert(leaving.end(), g_.pools_[ref.pool]->ops().dim, leaves(ref));
  rest.variables.clear(), rest.estimates.clear(), rest.R.clear();
  rest.d.assign(numbers.d, numbers.d + numbers.rows);
  const int rows = marginalize_columns(numbers.rows, numbers.cols, leaving, R, rest.d);
  take_known(row, rows);
  g_.derived_.priors().removed.push_back(g_.priors_.slots().key(row));
  if (rows == 0 || rest.variables.empty()) return;
  edit::Priors& p = g_.derived_.priors();
  edit::AddedPrior a{g_.priors_.slots().lend(),
                     0,
                     0,
                     static_cast<std::uint32_t>(p.variables.size()),
                     static_cast<std::uint32_t>(rest.variables.size()),
                     p.numbers.size(),
                     0};
  p.variables.insert(p.variables.end(), rest.variables.begin(), rest.variables.end());
  for (const auto* v : {&rest.estimates, &rest.d, &rest.R}) p.numbers.insert(p.numbers.end(), v->begin(), v->end());
  a.block_size = p.numbers.size() - a.block;
  p.added.push_back(a);
}

void EditCommit::reserve() {
  for (const auto& c : edit_.variable_columns())
    if (!c->added.empty()) g_.pools_[g_.pool_index(c->ops)]->reserve(static_cast<std::uint32_t>(c->added.size()));
  std::size_t entries = edit_.priors().variables.size() + g_.derived_.priors().variables.size();
  for (const auto& c : edit_.factor_columns()) {
    if (c->added.empty()) continue;
    g_.tables_[g_.table_index(c->ops)]->reserve(static_cast<std::uint32_t>(c->added.size()));
    entries += c->variables.size();
  }
  reserve_more(g_.incidences_, entries);
}

void EditCommit::attach(VariablePool& pool, std::uint32_t dense, std::uint32_t& entry, std::uint32_t table,
                        std::uint32_t slot, std::uint32_t arg) {
  if (g_.free_incidences_.empty()) {
    entry = static_cast<std::uint32_t>(g_.incidences_.size());
    g_.incidences_.emplace_back();
  } else {
    entry = g_.free_incidences_.back();
    g_.free_incidences_.pop_back();
  }
  const std::uint32_t head = pool.incidence(dense);
  g_.incidences_[entry] = {head, VariablePool::kNoIncidence, table, slot, arg};
  if (head != VariablePool::kNoIncidence) g_.incidences_[head].previous = entry;
  pool.incidence(dense) = entry;
}

void EditCommit::detach(const VariableRef& ref, std::uint32_t entry) {
  const Graph::Incidence& e = g_.incidences_[entry];
  if (e.previous == VariablePool::kNoIncidence) {
    VariablePool& pool = *g_.pools_[ref.pool];
    pool.incidence(pool.slots().dense(ref.slot)) = e.next;
  } else {
    g_.incidences_[e.previous].next = e.next;
  }
  if (e.next != VariablePool::kNoIncidence) g_.incidences_[e.next].previous = e.previous;
  g_.free_incidences_.push_back(entry);
}

void EditCommit::remove_factor(std::uint32_t table, SlotKey key) {
  FactorTable& t = *g_.tables_[table];
  const std::uint32_t row = t.slots().find(key);
  const auto refs = t.variables(row);
  for (int k = 0; k < t.arity(); ++k) detach(refs[k], t.incidence(row, k));
  g_.log_.note(ChangeLog::Removal{true, t.ops().key, key, t.added(row), g_.version_});
  t.erase(row);
}

void EditCommit::remove_prior(SlotKey key) {
  PriorTable& t = g_.priors_;
  const std::uint32_t row = t.slots().find(key);
  const auto refs = t.variables(row);
  for (std::size_t k = 0; k < refs.size(); ++k) detach(refs[k], t.incidence(row, static_cast<int>(k)));
  g_.log_.note(ChangeLog::Removal{true, PriorTable::kKey, key, t.added(row), g_.version_});
  t.erase(row);
}

void EditCommit::remove_factors() {
  for (const auto& c : edit_.factor_columns())
    for (const SlotKey k : c->removed) remove_factor(g_.table_index(c->ops), k);
  for (const SlotKey k : edit_.priors().removed) remove_prior(k);
  for (const SlotKey k : g_.derived_.priors().removed) remove_prior(k);
}

void EditCommit::remove_variables() {
  for (const auto& c : edit_.variable_columns()) {
    if (c->removed.empty()) continue;
    VariablePool& pool = *g_.pools_[g_.pool_index(c->ops)];
    for (const SlotKey k : c->removed) {
      const std::uint32_t dense = pool.slots().find(k);
      for (std::uint32_t i = pool.incidence(dense); i != VariablePool::kNoIncidence; i = pool.incidence(dense)) {
        const Graph::Incidence& e = g_.incidences_[i];
        remove_factor(e.table, g_.tables_[e.table]->slots().key_of_slot(e.slot));
      }
      g_.log_.note(ChangeLog::Removal{false, c->ops->key, k, pool.versions(dense).added, g_.version_});
      if (g_.labels_) g_.labels_->erase({c->ops->key, k});
      pool.erase(dense);
    }
  }
}

void EditCommit::add_variables() {
  for (const auto& c : edit_.variable_columns()) {
    if (c->added.empty()) continue;
    VariablePool& pool = *g_.pools_[g_.pool_index(c->ops)];
    for (std::size_t i = 0; i < c->added.size(); ++i) {
      const edit::AddedVariable& a = c->added[i];
      const std::uint32_t dense = pool.insert(a.key, a.serial, c->values.at(i), a.fixed, g_.version_);
      if (a.has_first_estimate) pool.set_first_estimate(dense, c->first_estimates.at(i), g_.version_);
      if (!a.freedom.is_full()) set_freedom(pool, dense, a.freedom);
    }
  }
  if (!g_.labels_ && !edit_.labels().empty()) g_.labels_ = make_owned<LabelTable>();
  for (const auto& [id, text] : edit_.labels()) g_.labels_->set(id, text);
}

void EditCommit::add_factors() {
  for (const auto& c : edit_.factor_columns()) {
    if (c->added.empty()) continue;
    const std::uint32_t index = g_.table_index(c->ops);
    FactorTable& table = *g_.tables_[index];
    const std::size_t arity = c->ops->variables.size();
    std::array<std::uint32_t, 16> pools;
    for (std::size_t k = 0; k < arity; ++k) pools[k] = g_.pool_index(c->ops->variables[k]);
    for (std::size_t i = 0; i < c->added.size(); ++i) {
      const edit::AddedFactor& a = c->added[i];
      std::array<VariableRef, 16> refs;
      for (std::size_t k = 0; k < arity; ++k) refs[k] = {pools[k], c->variables[i * arity + k].index};
      const std::uint32_t row =
          table.insert({a.key, a.serial, c->measurements.at(i), c->noises.at(i), a.loss, refs.data()}, g_.version_);
      for (std::size_t k = 0; k < arity; ++k) {
        VariablePool& pool = *g_.pools_[pools[k]];
        attach(pool, pool.slots().dense(refs[k].slot), table.incidence(row, static_cast<int>(k)), index, a.key.index,
               static_cast<std::uint32_t>(k));
      }
    }
  }
}

void EditCommit::add_priors(edit::Priors& c) {
  std::vector<VariableRef>& refs = g_.prior_refs_;
  for (const edit::AddedPrior& a : c.added) {
    refs.clear();
    int cols = 0;
    std::size_t estimates = 0;
    for (std::uint32_t k = 0; k < a.variable_count; ++k) {
      const VariableKey id = c.variables[a.variables + k];
      const VariableOps* ops = g_.find_ops(id.type);
      refs.push_back({g_.pool_index(ops), id.key.index});
      cols += ops->dim;
      estimates += estimate_doubles(*ops);
    }
    const std::uint32_t row = g_.priors_.insert(a.key, a.serial, refs, cols, estimates,
                                                {c.numbers.data() + a.block, a.block_size}, g_.version_);
    for (std::size_t k = 0; k < refs.size(); ++k) {
      VariablePool& pool = *g_.pools_[refs[k].pool];
      attach(pool, pool.slots().dense(refs[k].slot), g_.priors_.incidence(row, static_cast<int>(k)), Graph::kPriorTable,
             a.key.index, static_cast<std::uint32_t>(k));
    }
    set_first_estimates(row);
  }
}

// The first prior that touches a variable fixes where its Jacobians are taken from now on (decision 9).
void EditCommit::set_first_estimates(std::uint32_t row) {
  const double* estimate = g_.priors_.estimates(row);
  for (const VariableRef& ref : g_.priors_.variables(row)) {
    VariablePool& pool = *g_.pools_[ref.pool];
    const std::uint32_t dense = pool.slots().dense(ref.slot);
    if (!pool.has_first_estimate(dense)) {
      note_change(pool, dense);
      pool.set_first_estimate(dense, estimate, g_.version_);
    }
    estimate += estimate_doubles(pool.ops());
  }
}

// Before its versions are raised: one note a variable and edit, however much of it changes.
void EditCommit::note_change(const VariablePool& pool, std::uint32_t dense) {
  const VariablePool::Versions& v = pool.versions(dense);
  if (v.changed_in(g_.version_)) return;
  g_.log_.note(ChangeLog::Change{{pool.ops().key, pool.slots().key(dense)}, g_.version_}, v.added);
}

void EditCommit::set_losses() {
  for (const auto& c : edit_.factor_columns()) {
    if (c->losses.empty()) continue;
    FactorTable& table = *g_.tables_[g_.table_index(c->ops)];
    for (const auto& [key, loss] : c->losses) {
      const std::uint32_t row = table.slots().find(key);
      table.set_loss(row, loss);
      g_.log_.note(ChangeLog::LossChange{{c->ops->key, key}, g_.version_}, table.added(row));
    }
  }
}

void EditCommit::set_values() {
  for (const auto& c : edit_.variable_columns()) {
    if (c->set.empty() && c->fixed.empty() && c->freedoms.empty()) continue;
    VariablePool& pool = *g_.pools_[g_.pool_index(c->ops)];
    for (std::size_t i = 0; i < c->set.size(); ++i) {
      const std::uint32_t dense = pool.slots().find(c->set[i].first);
      note_change(pool, dense);
      if (c->set[i].second == edit::SetKind::first_estimate) {
        pool.set_first_estimate(dense, c->set_values.at(i), g_.version_);
      } else {
        pool.set_value(dense, c->set_values.at(i));
        pool.note_value(dense, g_.version_);
      }
    }
    for (const auto& [key, fixed] : c->fixed) {
      const std::uint32_t dense = pool.slots().find(key);
      if (pool.fixed(dense) == fixed) continue;  // what it was: nobody is told (C6)
      note_change(pool, dense);
      pool.set_fixed(dense, fixed, g_.version_);
    }
    for (const auto& [key, freedom] : c->freedoms) {
      const std::uint32_t dense = pool.slots().find(key);
      if (pool.freedom(dense) == freedom) continue;
      note_change(pool, dense);
      set_freedom(pool, dense, freedom);
    }
  }
}

void EditCommit::set_freedom(VariablePool& pool, std::uint32_t dense, const Freedom& freedom) {
  pool.set_freedom(dense, freedom, g_.version_);
  g_.freedom_version_ = g_.version_;
}

}  // namespace oriel
