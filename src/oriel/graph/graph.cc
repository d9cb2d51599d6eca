#include "oriel/graph/graph.h"

#include <algorithm>

#include "oriel/graph/edit_commit.h"
#include "oriel/graph/edit_validator.h"
#include "oriel/graph/labels.h"

namespace oriel {

Graph::Graph() = default;
Graph::Graph(Graph&&) noexcept = default;
Graph& Graph::operator=(Graph&&) noexcept = default;
Graph::~Graph() = default;

Result<void> Graph::apply(GraphEdit& edit) noexcept {
  if (edit.applied()) return Error{ErrorCode::conflict, "apply: this edit was applied already; clear() it first"};
  edit.meet(*this);
  if (edit.whole()) return replace(edit);
  if (auto ok = EditValidator(*this, edit, marks_).validate(); !ok) return ok;
  EditCommit(*this, edit).run();
  return {};
}

// By what an edit says that is the whole of another graph. Versions go on rising, so that engines and followers of this
// one notice; pools and tables keep their places, by which engines hold columns.
Result<void> Graph::replace(GraphEdit& whole) noexcept {
  Graph fresh;
  for (const auto& p : pools_) fresh.pool_index(&p->ops());
  for (const auto& t : tables_) fresh.table_index(&t->ops());
  fresh.version_ = version_;
  fresh.adoptions_ = adoptions_;
  if (auto ok = EditValidator(fresh, whole, fresh.marks_).validate(); !ok) return ok;
  EditCommit(fresh, whole).run();
  fresh.structure_version_ = fresh.freedom_version_ = fresh.version_;
  fresh.log_ = std::move(log_);
  fresh.log_.leave_all_behind();
  *this = std::move(fresh);
  return {};
}

Result<void> Graph::adopt(const Solution& solution) noexcept {
  for (const Solution::Column& c : solution.columns)
    for (std::size_t i = 0; i < c.keys.size(); ++i)
      if (!c.ops->finite(c.values.at(i)))
        return Error{ErrorCode::not_finite,
                     "adopt: the value of " + describe({c.ops->key, c.keys[i]}) + " is not finite"};
  ++version_, ++adoptions_;
  for (const Solution::Column& c : solution.columns) {
    VariablePool* pool = pool_of(c.ops->key);
    if (pool == nullptr) continue;
    for (std::size_t i = 0; i < c.keys.size(); ++i) {
      const std::uint32_t dense = pool->slots().find(c.keys[i]);
      if (dense == SlotIndex::kNone || pool->fixed(dense)) continue;
      const VariablePool::Versions& versions = pool->versions(dense);
      if (std::max(versions.added, versions.value) > solution.version) continue;  // another of that key, or set since
      if (!pool->freedom(dense).is_full() && versions.freedom > solution.version) continue;  // held since
      pool->set_value(dense, c.values.at(i));
    }
  }
  return {};
}

std::uint32_t Graph::pool_index(const VariableOps* ops) {
  for (std::uint32_t i = 0; i < pools_.size(); ++i)
    if (pools_[i]->ops().key == ops->key) return i;
  pools_.push_back(make_owned<VariablePool>(ops));
  return static_cast<std::uint32_t>(pools_.size() - 1);
}

std::uint32_t Graph::table_index(const FactorOps* ops) {
  for (std::uint32_t i = 0; i < tables_.size(); ++i)
    if (tables_[i]->ops().key == ops->key) return i;
  check(ops->variables.size() <= 16, "a residual has at most 16 variables");
  for (const VariableOps* v : ops->variables) pool_index(v);
  tables_.push_back(make_owned<FactorTable>(ops));
  return static_cast<std::uint32_t>(tables_.size() - 1);
}

const VariablePool* Graph::find_pool(std::uint64_t type) const {
  for (const auto& p : pools_)
    if (p->ops().key == type) return p.get();
  return nullptr;
}

const VariableOps* Graph::find_ops(std::uint64_t type) const {
  const VariablePool* p = find_pool(type);
  return p == nullptr ? nullptr : &p->ops();
}

const FactorOps* Graph::find_factor_ops(std::uint64_t table) const {
  for (const auto& t : tables_)
    if (t->ops().key == table) return &t->ops();
  return nullptr;
}

const void* Graph::find_value(VariableKey id) const {
  const VariablePool* p = find_pool(id.type);
  const std::uint32_t dense = p == nullptr ? SlotIndex::kNone : p->slots().find(id.key);
  return dense == SlotIndex::kNone ? nullptr : p->value(dense);
}

bool Graph::contains(FactorId id) const {
  if (id.table == PriorTable::kKey) return priors_.slots().find(id.key) != SlotIndex::kNone;
  for (const auto& t : tables_)
    if (t->ops().key == id.table) return t->slots().find(id.key) != SlotIndex::kNone;
  return false;
}

std::size_t Graph::variable_count() const {
  std::size_t n = 0;
  for (const auto& p : pools_) n += p->slots().size();
  return n;
}

std::size_t Graph::factor_count() const {
  std::size_t n = priors_.slots().size();
  for (const auto& t : tables_) n += t->slots().size();
  return n;
}

bool Graph::fixed(VariableKey id) const {
  const VariablePool* p = find_pool(id.type);
  const std::uint32_t dense = p == nullptr ? SlotIndex::kNone : p->slots().find(id.key);
  return dense != SlotIndex::kNone && p->fixed(dense);
}

Freedom Graph::freedom(VariableKey id) const {
  const VariablePool* p = find_pool(id.type);
  const std::uint32_t dense = p == nullptr ? SlotIndex::kNone : p->slots().find(id.key);
  return dense == SlotIndex::kNone ? Freedom::full() : p->freedom(dense);
}

std::string Graph::describe(VariableKey id) const {
  const VariableOps* ops = find_ops(id.type);
  std::string text = ops == nullptr ? "variable of an unknown type" : std::string(ops->name);
  if (const std::string* label = labels_ ? labels_->find(id) : nullptr)
    return text.append(" '").append(*label).append("'");
  if (is_placeholder(id.key))
    return text.append(" (new, number ").append(std::to_string(placeholder_number(id.key) + 1)).append(")");
  text.append(" #").append(std::to_string(id.key.index));
  return text.append(".").append(std::to_string(id.key.generation));
}

void Graph::unresolved(VariableKey id) const {
  std::string what = "Graph::value: ";
  contract_violated(what.append(describe(id)).append(" is not in the graph"));
}

SlotKey Graph::lend(const VariableOps* ops) { return pools_[pool_index(ops)]->slots().lend(); }
SlotKey Graph::lend(const FactorOps* ops) { return tables_[table_index(ops)]->slots().lend(); }

void Graph::give_back(const GraphEdit& edit) {
  for (const auto& c : edit.variable_columns())
    for (const auto& a : c->added) pools_[pool_index(c->ops)]->slots().give_back(a.key);
  for (const auto& c : edit.factor_columns())
    for (const auto& a : c->added) tables_[table_index(c->ops)]->slots().give_back(a.key);
  for (const auto& a : edit.priors().added) priors_.slots().give_back(a.key);
}

namespace {

// First of the rows that came after version `seen`; rows are in the order of their coming.
template <class Added>
std::uint32_t first_after(std::uint32_t extent, std::uint64_t seen, Added&& added) {
  std::uint32_t row = extent;
  while (row > 0 && added(row - 1) > seen) --row;
  return row;
}

void collect_added(const VariablePool& pool, std::uint64_t seen, GraphEdit& out) {
  const std::uint32_t first = first_after(pool.extent(), seen, [&](auto d) { return pool.versions(d).added; });
  for (std::uint32_t d = first; d < pool.extent(); ++d) {
    if (!pool.slots().is_live(d)) continue;
    out.variables(&pool.ops())
        .add({pool.slots().key(d), pool.slots().serial(d), out.next_order(), pool.fixed(d), pool.has_first_estimate(d),
              pool.freedom(d)},
             pool.value(d), pool.first_estimate(d));
  }
}

void collect_added(const FactorTable& table, const std::vector<Owned<VariablePool>>& pools, std::uint64_t seen,
                   GraphEdit& out) {
  const std::uint32_t first = first_after(table.extent(), seen, [&](auto r) { return table.added(r); });
  for (std::uint32_t r = first; r < table.extent(); ++r) {
    if (!table.slots().is_live(r)) continue;
    edit::Factors& c = out.factors(&table.ops());
    c.added.push_back({table.slots().key(r), table.slots().serial(r), out.next_order(), table.loss(r)});
    c.measurements.push_back(table.measurement(r));
    c.noises.push_back(table.noise(r));
    for (const VariableRef& ref : table.variables(r))
      c.variables.push_back(pools[ref.pool]->slots().key_of_slot(ref.slot));
  }
}

void collect_added(const PriorTable& table, const std::vector<Owned<VariablePool>>& pools, std::uint64_t seen,
                   GraphEdit& out) {
  const std::uint32_t first = first_after(table.extent(), seen, [&](auto r) { return table.added(r); });
  for (std::uint32_t r = first; r < table.extent(); ++r) {
    if (!table.slots().is_live(r)) continue;
    edit::Priors& c = out.priors();
    const auto refs = table.variables(r);
    const auto block = table.block(r);
    c.added.push_back({table.slots().key(r), table.slots().serial(r), out.next_order(),
                       static_cast<std::uint32_t>(c.variables.size()), static_cast<std::uint32_t>(refs.size()),
                       c.numbers.size(), block.size()});
    for (const VariableRef& ref : refs)
      c.variables.push_back({pools[ref.pool]->ops().key, pools[ref.pool]->slots().key_of_slot(ref.slot)});
    c.numbers.insert(c.numbers.end(), block.begin(), block.end());
  }
}

}  // namespace

// Of the variables that `out` adds.
void Graph::collect_labels(GraphEdit& out) const {
  if (!labels_) return;
  for (const auto& c : out.variable_columns())
    for (const edit::AddedVariable& a : c->added)
      if (const std::string* label = labels_->find({c->ops->key, a.key}))
        out.labels().emplace_back(VariableKey{c->ops->key, a.key}, *label);
}

void Graph::collect(Subscription s, GraphEdit& out) {
  out.clear();
  if (log_.behind(s)) out.mark_whole();
  const std::uint64_t seen = log_.seen(s);
  for (const ChangeLog::Removal& r : log_.removals(seen)) {
    if (r.added > seen) continue;
    if (!r.factor)
      out.variables(find_ops(r.type)).remove(r.key);
    else if (r.type == PriorTable::kKey)
      out.priors().removed.push_back(r.key);
    else {
      edit::Factors& c = out.factors(find_factor_ops(r.type));
      c.removed_at.set(r.key.index, static_cast<std::uint32_t>(c.removed.size()));
      c.removed.push_back(r.key);
    }
  }
  for (const auto& p : pools_) collect_added(*p, seen, out);
  for (const auto& t : tables_) collect_added(*t, pools_, seen, out);
  collect_added(priors_, pools_, seen, out);
  collect_labels(out);
  for (const ChangeLog::Change& change : log_.changes(seen)) {
    const VariablePool* pool = find_pool(change.id.type);
    const std::uint32_t d = pool->slots().find(change.id.key);
    if (d == SlotIndex::kNone || pool->versions(d).added > seen) continue;
    edit::Variables& c = out.variables(&pool->ops());
    if (pool->versions(d).value == change.version) {
      c.set.emplace_back(change.id.key, edit::SetKind::value);
      c.set_values.push_back(pool->value(d));
    }
    if (pool->versions(d).first_estimate == change.version) {
      c.set.emplace_back(change.id.key, edit::SetKind::first_estimate);
      c.set_values.push_back(pool->first_estimate(d));
    }
    if (pool->versions(d).fixed == change.version) c.fixed.emplace_back(change.id.key, pool->fixed(d));
    if (pool->versions(d).freedom == change.version) c.freedoms.emplace_back(change.id.key, pool->freedom(d));
  }
  collect_losses(seen, out);
  log_.mark_seen(s, version_);
}

// Of factors that the follower knows; what was set twice is named twice, as it is now.
void Graph::collect_losses(std::uint64_t seen, GraphEdit& out) const {
  for (const ChangeLog::LossChange& change : log_.loss_changes(seen))
    for (const auto& t : tables_) {
      if (t->ops().key != change.id.table) continue;
      const std::uint32_t r = t->slots().find(change.id.key);
      if (r != SlotIndex::kNone && t->added(r) <= seen)
        out.factors(&t->ops()).losses.emplace_back(change.id.key, t->loss(r));
    }
}

}  // namespace oriel
