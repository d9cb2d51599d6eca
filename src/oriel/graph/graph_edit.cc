#include "oriel/graph/graph_edit.h"

#include <algorithm>

#include "oriel/graph/graph.h"

namespace oriel {
namespace edit {

void SlotMarks::set(std::uint32_t index, std::uint32_t position) {
  if (index >= kFirstPlaceholder) return;
  if (index >= at_.size()) at_.resize(index + 1 + at_.size() / 2, kNone);
  at_[index] = position;
}

Variables::Variables(const VariableOps* o)
    : ops(o), values(o->bytes), first_estimates(o->bytes), set_values(o->bytes) {}

Factors::Factors(const FactorOps* o) : ops(o), measurements(o->measurement_bytes), noises(o->noise_bytes) {}

void Variables::add(const AddedVariable& a, const void* value, const void* first_estimate) {
  added_at.set(a.key.index, static_cast<std::uint32_t>(added.size()));
  added.push_back(a);
  values.push_back(value);
  first_estimates.push_back(first_estimate);
}

void Variables::remove(SlotKey key) {
  removed_at.set(key.index, static_cast<std::uint32_t>(removed.size()));
  removed.push_back(key);
}

std::uint32_t Variables::find_added(SlotKey key) const {
  const std::uint32_t at = is_placeholder(key) ? placeholder_number(key) : added_at.find(key.index);
  return at < added.size() && added[at].key == key ? at : SlotMarks::kNone;
}

bool Variables::removes(SlotKey key) const {
  const std::uint32_t at = removed_at.find(key.index);
  return at != SlotMarks::kNone && removed[at] == key;
}

void Variables::clear() {
  for (const AddedVariable& a : added) added_at.forget(a.key.index);
  for (const SlotKey& k : removed) removed_at.forget(k.index);
  added.clear();
  values.clear();
  first_estimates.clear();
  removed.clear();
  set.clear();
  set_values.clear();
  fixed.clear();
  freedoms.clear();
}

void Factors::clear() {
  for (const SlotKey& k : removed) removed_at.forget(k.index);
  added.clear();
  measurements.clear();
  noises.clear();
  variables.clear();
  removed.clear();
  losses.clear();
}

void Priors::clear() {
  added.clear();
  variables.clear();
  numbers.clear();
  removed.clear();
}

}  // namespace edit

GraphEdit::GraphEdit() = default;
GraphEdit::GraphEdit(Graph& graph) : graph_(&graph), seen_(&graph) {}
GraphEdit GraphEdit::proposal(const Graph* seen) { return {seen, true}; }
GraphEdit::GraphEdit(GraphEdit&&) noexcept = default;
GraphEdit& GraphEdit::operator=(GraphEdit&&) noexcept = default;
GraphEdit::~GraphEdit() = default;

edit::Variables& GraphEdit::variables(const VariableOps* ops) {
  if (edit::Variables* c = column_of(ops->key)) return *c;
  return *variables_.emplace_back(make_owned<edit::Variables>(ops));
}

edit::Variables* GraphEdit::column_of(std::uint64_t type) {
  for (auto& c : variables_)
    if (c->ops->key == type) return c.get();
  return nullptr;
}

const edit::Variables* GraphEdit::find_variables(std::uint64_t type) const {
  return const_cast<GraphEdit*>(this)->column_of(type);
}

edit::Factors& GraphEdit::factors(const FactorOps* ops) {
  for (auto& c : factors_)
    if (c->ops->key == ops->key) return *c;
  return *factors_.emplace_back(make_owned<edit::Factors>(ops));
}

void GraphEdit::check_lender() const {
  check(graph_ != nullptr || proposes_, "GraphEdit::add: this edit was not lent by a graph (Graph::edit)");
}

SlotKey GraphEdit::add_variable(const VariableOps* ops, const void* value, Label& label) {
  check_lender();
  edit::Variables& column = variables(ops);
  const SlotKey key = proposes_ ? placeholder_key(static_cast<std::uint32_t>(column.added.size())) : graph_->lend(ops);
  column.add({key, 0, next_order(), false, false, {}}, value, value);
  if (!label.text.empty()) labels_.emplace_back(VariableKey{ops->key, key}, std::move(label.text));
  return key;
}

void GraphEdit::set_value(const VariableOps* ops, SlotKey key, const void* value) {
  edit::Variables& column = variables(ops);
  column.set.emplace_back(key, edit::SetKind::value);
  column.set_values.push_back(value);
}

FactorId GraphEdit::add_factor(const FactorOps* ops, const void* measurement, const void* noise, const Loss& loss,
                               const SlotKey* variables) {
  check_lender();
  edit::Factors& column = factors(ops);
  const SlotKey key = proposes_ ? placeholder_key(static_cast<std::uint32_t>(column.added.size())) : graph_->lend(ops);
  column.added.push_back({key, 0, next_order(), loss});
  column.measurements.push_back(measurement);
  column.noises.push_back(noise);
  column.variables.insert(column.variables.end(), variables, variables + ops->variables.size());
  return {ops->key, key};
}

FactorId GraphEdit::add(const LinearPrior& prior) {
  check_lender();
  const SlotKey key =
      proposes_ ? placeholder_key(static_cast<std::uint32_t>(priors_.added.size())) : graph_->lend_prior();
  edit::AddedPrior a{key,
                     0,
                     next_order(),
                     static_cast<std::uint32_t>(priors_.variables.size()),
                     static_cast<std::uint32_t>(prior.variables.size()),
                     priors_.numbers.size(),
                     0};
  auto append = [this](const std::vector<double>& v) {
    priors_.numbers.insert(priors_.numbers.end(), v.begin(), v.end());
  };
  priors_.variables.insert(priors_.variables.end(), prior.variables.begin(), prior.variables.end());
  append(prior.estimates);
  append(prior.d);
  append(prior.R);
  a.block_size = priors_.numbers.size() - a.block;
  const auto rows = static_cast<std::size_t>(std::max(prior.rows, 0)),
             cols = static_cast<std::size_t>(std::max(prior.cols, 0));
  std::size_t dims = 0;
  for (const VariableKey& id : prior.variables) {
    const edit::Variables* column = find_variables(id.type);
    const VariableOps* ops = column != nullptr ? column->ops : seen_ != nullptr ? seen_->find_ops(id.type) : nullptr;
    dims += ops != nullptr ? static_cast<std::size_t>(ops->dim) : 0;
  }
  a.well_formed = cols == dims && prior.d.size() == rows && prior.R.size() == rows * cols;
  priors_.added.push_back(a);
  return {PriorTable::kKey, key};
}

const void* GraphEdit::find_value(VariableKey id) const {
  if (const edit::Variables* c = find_variables(id.type)) {
    for (std::size_t i = c->set.size(); i-- > 0;)
      if (c->set[i].first == id.key && c->set[i].second == edit::SetKind::value) return c->set_values.at(i);
    const std::uint32_t at = c->find_added(id.key);
    if (at != edit::SlotMarks::kNone) return c->values.at(at);
  }
  return seen_ != nullptr ? seen_->find_value(id) : nullptr;
}

void GraphEdit::unresolved(VariableKey id) const {
  std::string what = "GraphEdit::value: ";
  if (seen_ != nullptr)
    what.append(seen_->describe(id));
  else
    what.append("variable #").append(std::to_string(id.key.index));
  contract_violated(what.append(" is neither in the edit nor in the graph"));
}

// The column of a variable's type; null, and noted for apply to refuse, if the graph has never seen that type.
edit::Variables* GraphEdit::known_column(VariableKey id, const char* what) {
  if (edit::Variables* c = column_of(id.type)) return c;
  if (const VariableOps* ops = seen_ != nullptr ? seen_->find_ops(id.type) : nullptr) return &variables(ops);
  if (unknown_.empty())
    unknown_ = std::string(what) + ": variable #" + std::to_string(id.key.index) + "." +
               std::to_string(id.key.generation) + " of a type that the graph does not know";
  return nullptr;
}

void GraphEdit::fix(VariableKey id, bool fixed) {
  if (edit::Variables* c = known_column(id, "fix"))
    c->fixed.emplace_back(id.key, fixed);
  else
    put_off({fixed ? edit::Unmet::What::fix : edit::Unmet::What::release, id.type, id.key});
}

void GraphEdit::set(VariableKey id, const Freedom& freedom) {
  if (edit::Variables* c = known_column(id, "set"))
    c->freedoms.emplace_back(id.key, freedom);
  else
    put_off({edit::Unmet::What::set_freedom, id.type, id.key, Loss::none(), freedom});
}

void GraphEdit::remove(VariableKey id) {
  if (edit::Variables* c = known_column(id, "remove"))
    c->remove(id.key);
  else
    put_off({edit::Unmet::What::remove_variable, id.type, id.key});
}

void GraphEdit::remove(FactorId id) {
  if (id.table == PriorTable::kKey) {
    priors_.removed.push_back(id.key);
    return;
  }
  edit::Factors* c = known_column(id, "remove");
  if (c == nullptr) return put_off({edit::Unmet::What::remove_factor, id.table, id.key});
  c->removed_at.set(id.key.index, static_cast<std::uint32_t>(c->removed.size()));
  c->removed.push_back(id.key);
}

void GraphEdit::set(FactorId id, const Loss& loss) {
  if (edit::Factors* c = known_column(id, "set"))
    c->losses.emplace_back(id.key, loss);
  else
    put_off({edit::Unmet::What::set_loss, id.table, id.key, loss});
}

void GraphEdit::put_off(const edit::Unmet& what) {
  if (seen_ == nullptr && proposes_) unmet_.push_back(what);
}

void GraphEdit::meet(const Graph& graph) {
  if (unmet_.empty()) return;
  unknown_.clear();
  seen_ = &graph;
  for (const edit::Unmet& u : unmet_) {
    const VariableKey variable(u.type, u.key);
    switch (u.what) {
      case edit::Unmet::What::fix:
      case edit::Unmet::What::release:
        fix(variable, u.what == edit::Unmet::What::fix);
        break;
      case edit::Unmet::What::remove_variable:
        remove(variable);
        break;
      case edit::Unmet::What::remove_factor:
        remove(FactorId{u.type, u.key});
        break;
      case edit::Unmet::What::set_loss:
        set(FactorId{u.type, u.key}, u.loss);
        break;
      case edit::Unmet::What::set_freedom:
        set(variable, u.freedom);
    }
  }
  seen_ = nullptr;  // a proposal is its writer's again, who may be beside the graph
  unmet_.clear();
}

// Null, and an edit that is refused, for a table that the graph does not know.
edit::Factors* GraphEdit::known_column(FactorId id, const char* what) {
  for (auto& c : factors_)
    if (c->ops->key == id.table) return c.get();
  if (const FactorOps* ops = seen_ != nullptr ? seen_->find_factor_ops(id.table) : nullptr) return &factors(ops);
  if (unknown_.empty())
    unknown_ = std::string(what) + ": factor #" + std::to_string(id.key.index) + "." +
               std::to_string(id.key.generation) + " of a table that the graph does not know";
  return nullptr;
}

namespace {

// Places in a column stay as they are when apply gives the ids.
template <class Added>
SlotKey resolved_key(const std::vector<Added>& added, SlotKey key) {
  if (!is_placeholder(key) || placeholder_number(key) >= added.size()) return key;
  return added[placeholder_number(key)].key;
}

}  // namespace

VariableKey GraphEdit::resolved(VariableKey id) const {
  const edit::Variables* c = find_variables(id.type);
  return c == nullptr ? id : VariableKey{id.type, resolved_key(c->added, id.key)};
}

FactorId GraphEdit::resolved(FactorId id) const {
  if (id.table == PriorTable::kKey) return {id.table, resolved_key(priors_.added, id.key)};
  for (const auto& c : factors_)
    if (c->ops->key == id.table) return {id.table, resolved_key(c->added, id.key)};
  return id;
}

bool GraphEdit::empty() const {
  for (const auto& c : variables_)
    if (!c->empty()) return false;
  for (const auto& c : factors_)
    if (!c->empty()) return false;
  return priors_.empty() && unknown_.empty() && !whole_;
}

void GraphEdit::clear() {
  if (graph_ != nullptr && !applied_) graph_->give_back(*this);
  for (auto& c : variables_) c->clear();
  for (auto& c : factors_) c->clear();
  priors_.clear();
  labels_.clear();
  unmet_.clear();
  unknown_.clear();
  order_ = 0;
  required_version_ = 0;
  applied_ = whole_ = false;
}

}  // namespace oriel
