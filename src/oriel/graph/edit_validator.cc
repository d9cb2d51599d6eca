#include "oriel/graph/edit_validator.h"

#include <cmath>

namespace oriel {
namespace {

std::string number(std::size_t n) { return std::to_string(n); }

std::string key_text(SlotKey k) {
  if (is_placeholder(k)) return "(new, number " + number(placeholder_number(k) + 1) + ")";
  return "#" + number(k.index) + "." + number(k.generation);
}

std::string factor_name(const edit::Factors& c, std::size_t i) {
  return "factor " + number(i + 1) + " of " + std::string(c.ops->residual) + " in this edit";
}

// What is wrong with a freedom of a variable of this type, after its name; empty: nothing.
std::string fault_of(const VariableOps& ops, const Freedom& freedom) {
  if (freedom.is_full()) return {};
  if (ops.dim == 0) return " is a constant, which has no directions to hold";
  const std::uint32_t all = ops.dim >= 32 ? ~std::uint32_t{0} : (std::uint32_t{1} << ops.dim) - 1;
  if ((freedom.held & ~all) != 0)
    return " has " + number(static_cast<std::size_t>(ops.dim)) + " components, and one above is to be held";
  if (freedom.held == all && ops.dim <= 32) return " would have no free direction; fix it instead";
  if (freedom.axes == Freedom::Axes::world && ops.world_axes == nullptr)
    return " is of a type without world axes (manifold.h)";
  return {};
}

const SlotIndex kNoSlots;  // of a type that the graph has not met

// May the i-th factor come in under this key? Its slot has to be empty, or to be emptied by the same edit.
template <class Column>
bool free_for(const Column& c, const SlotIndex& slots, SlotKey key, std::size_t i) {
  if (is_placeholder(key)) return placeholder_number(key) == i;
  if (!slots.is_new(key, c.added.size())) return false;
  return slots.find_slot(key.index) == SlotIndex::kNone || c.removes(slots.key_of_slot(key.index));
}

SlotKey key_of(SlotKey key) { return key; }
template <class Added>
SlotKey key_of(const Added& added) {
  return added.key;
}

// One slot named twice, under whatever generations. `marks` is empty before and after.
template <class Items>
bool has_twice(const Items& items, edit::SlotMarks& marks) {
  for (std::size_t i = 0; i < items.size(); ++i) marks.set(key_of(items[i]).index, static_cast<std::uint32_t>(i));
  bool twice = false;
  for (std::size_t i = 0; i < items.size(); ++i)
    twice = twice || (marks.find(key_of(items[i]).index) != i && !is_placeholder(key_of(items[i])));
  for (const auto& item : items) marks.forget(key_of(item).index);
  return twice;
}

}  // namespace

Result<void> EditValidator::validate() const {
  if (edit_.required_version() != 0 && edit_.required_version() != graph_.version())
    return Error{ErrorCode::conflict, "the edit was made for version " + number(edit_.required_version()) +
                                          " of the graph, which is at " + number(graph_.version())};
  if (!edit_.unknown().empty()) return Error{ErrorCode::stale_id, edit_.unknown()};
  for (const auto& c : edit_.variable_columns())
    if (auto ok = variables(*c); !ok) return ok;
  for (const auto& c : edit_.factor_columns())
    if (auto ok = factors(*c); !ok) return ok;
  return priors();
}

Result<void> EditValidator::variables(const edit::Variables& c) const {
  const VariablePool* pool = graph_.find_pool(c.ops->key);
  auto live = [&](SlotKey k) { return pool != nullptr && pool->slots().find(k) != SlotIndex::kNone; };
  auto name = [&](SlotKey k) { return graph_.describe({c.ops->key, k}); };
  for (std::size_t i = 0; i < c.removed.size(); ++i) {
    const SlotKey k = c.removed[i];
    if (!live(k)) return Error{ErrorCode::stale_id, "remove: " + name(k) + " is not in the graph"};
    if (c.removed_at.find(k.index) != i) return Error{ErrorCode::duplicate, "remove: " + name(k) + " is named twice"};
  }
  for (std::size_t i = 0; i < c.set.size(); ++i) {
    const SlotKey k = c.set[i].first;
    if ((!live(k) || c.removes(k)) && c.find_added(k) == edit::SlotMarks::kNone)
      return Error{ErrorCode::stale_id, "set: " + name(k) + " is not in the graph"};
    if (!c.ops->finite(c.set_values.at(i)))
      return Error{ErrorCode::not_finite, "set: the value of " + name(k) + " is not finite"};
  }
  for (const auto& [k, fixed] : c.fixed)
    if ((!live(k) || c.removes(k)) && c.find_added(k) == edit::SlotMarks::kNone)
      return Error{ErrorCode::stale_id, "fix: " + name(k) + " is not in the graph"};
  for (const auto& [k, freedom] : c.freedoms) {
    if ((!live(k) || c.removes(k)) && c.find_added(k) == edit::SlotMarks::kNone)
      return Error{ErrorCode::stale_id, "set: " + name(k) + " is not in the graph"};
    if (const std::string fault = fault_of(*c.ops, freedom); !fault.empty())
      return Error{ErrorCode::bad_input, "set: " + name(k) + fault};
  }
  return added_variables(c);
}

Result<void> EditValidator::added_variables(const edit::Variables& c) const {
  const VariablePool* pool = graph_.find_pool(c.ops->key);
  std::uint64_t serial = pool == nullptr ? 0 : pool->slots().last_serial();
  for (std::size_t i = 0; i < c.added.size(); ++i) {
    const edit::AddedVariable& a = c.added[i];
    auto name = [&] { return graph_.describe({c.ops->key, a.key}); };
    if (!is_placeholder(a.key) && c.added_at.find(a.key.index) != i)
      return Error{ErrorCode::duplicate, "add: " + name() + " is added twice"};
    if (!free_for(c, pool == nullptr ? kNoSlots : pool->slots(), a.key, i))
      return Error{ErrorCode::duplicate, "add: the id " + name() + " is or was in use"};
    if (a.serial != 0 && a.serial <= serial)
      return Error{ErrorCode::conflict, "add: the serial of " + name() + " is not above those in the graph"};
    if (a.serial != 0) serial = a.serial;
    if (!c.ops->finite(c.values.at(i)))
      return Error{ErrorCode::not_finite, "add: the value of " + name() + " is not finite"};
    if (a.has_first_estimate && !c.ops->finite(c.first_estimates.at(i)))
      return Error{ErrorCode::not_finite, "add: the first estimate of " + name() + " is not finite"};
    if (const std::string fault = fault_of(*c.ops, a.freedom); !fault.empty())
      return Error{ErrorCode::bad_input, "add: " + name() + fault};
  }
  return {};
}

Result<void> EditValidator::resolves(const VariableOps& ops, SlotKey key, const std::string& what) const {
  const edit::Variables* c = edit_.find_variables(ops.key);
  if (c != nullptr && c->find_added(key) != edit::SlotMarks::kNone) return {};
  const VariablePool* pool = graph_.find_pool(ops.key);
  if (pool == nullptr || pool->slots().find(key) == SlotIndex::kNone)
    return Error{ErrorCode::stale_id,
                 what + " names " + graph_.describe({ops.key, key}) + ", which is not in the graph"};
  if (c != nullptr && c->removes(key))
    return Error{ErrorCode::stale_id, what + " names " + graph_.describe({ops.key, key}) + ", which this edit removes"};
  return {};
}

Result<void> EditValidator::factors(const edit::Factors& c) const {
  const FactorTable* table = nullptr;
  for (const auto& t : graph_.tables())
    if (t->ops().key == c.ops->key) table = t.get();
  for (const SlotKey k : c.removed)
    if (table == nullptr || table->slots().find(k) == SlotIndex::kNone)
      return Error{ErrorCode::stale_id,
                   "remove: factor " + key_text(k) + " of " + std::string(c.ops->residual) + " is not in the graph"};
  for (std::size_t i = 0; i < c.removed.size(); ++i)
    if (c.removed_at.find(c.removed[i].index) != i)
      return Error{ErrorCode::duplicate, "remove: factor " + key_text(c.removed[i]) + " of " +
                                             std::string(c.ops->residual) + " is named twice"};
  for (const auto& [key, loss] : c.losses) {
    const std::string name = "set: factor " + key_text(key) + " of " + std::string(c.ops->residual);
    if (table == nullptr || table->slots().find(key) == SlotIndex::kNone || c.removes(key))
      return Error{ErrorCode::stale_id, name + " is not in the graph"};
    if (const std::string_view fault = fault_of(loss); !fault.empty())
      return Error{ErrorCode::bad_input, name + ": " + std::string(fault)};
  }
  return added_factors(c, table != nullptr ? table->slots() : kNoSlots);
}

Result<void> EditValidator::added_factors(const edit::Factors& c, const SlotIndex& slots) const {
  std::uint64_t serial = slots.last_serial();
  for (std::size_t i = 0; i < c.added.size(); ++i) {
    const edit::AddedFactor& a = c.added[i];
    if (!free_for(c, slots, a.key, i))
      return Error{ErrorCode::duplicate, factor_name(c, i) + ": its id " + key_text(a.key) + " is or was in use"};
    if (a.serial != 0 && a.serial <= serial)
      return Error{ErrorCode::conflict, factor_name(c, i) + ": its serial is not above those in the graph"};
    if (a.serial != 0) serial = a.serial;
    if (auto ok = factor(c, i); !ok) return ok;
  }
  if (has_twice(c.added, marks_))
    return Error{ErrorCode::duplicate, "add: two factors of " + std::string(c.ops->residual) + " have the same id"};
  return {};
}

Result<void> EditValidator::factor(const edit::Factors& c, std::size_t i) const {
  if (!c.ops->finite(c.measurements.at(i)))
    return Error{ErrorCode::not_finite, factor_name(c, i) + ": its measurement is not finite"};
  if (!c.ops->noise_valid(c.noises.at(i)))
    return Error{ErrorCode::indefinite,
                 factor_name(c, i) + ": its noise is not valid (sigma > 0, positive semidefinite information wanted)"};
  const Loss& loss = c.added[i].loss;
  if (const std::string_view fault = fault_of(loss); !fault.empty())
    return Error{ErrorCode::bad_input, factor_name(c, i) + ": " + std::string(fault)};
  const std::size_t arity = c.ops->variables.size();
  for (std::size_t k = 0; k < arity; ++k) {
    const VariableOps& ops = *c.ops->variables[k];
    const SlotKey key = c.variables[i * arity + k];
    const edit::Variables* column = edit_.find_variables(ops.key);  // the usual case needs no text
    if (column != nullptr && column->find_added(key) != edit::SlotMarks::kNone) continue;
    const VariablePool* pool = graph_.find_pool(ops.key);
    if (pool != nullptr && pool->slots().find(key) != SlotIndex::kNone && (column == nullptr || !column->removes(key)))
      continue;
    return resolves(ops, key, factor_name(c, i));
  }
  return {};
}

Result<void> EditValidator::priors() const {
  const edit::Priors& c = edit_.priors();
  for (const SlotKey k : c.removed)
    if (graph_.priors().slots().find(k) == SlotIndex::kNone)
      return Error{ErrorCode::stale_id, "remove: linear prior " + key_text(k) + " is not in the graph"};
  if (has_twice(c.removed, marks_)) return Error{ErrorCode::duplicate, "remove: a linear prior is named twice"};
  std::uint64_t serial = graph_.priors().slots().last_serial();
  for (std::size_t i = 0; i < c.added.size(); ++i) {
    const edit::AddedPrior& p = c.added[i];
    if (!free_for(c, graph_.priors().slots(), p.key, i))
      return Error{ErrorCode::duplicate, "add: the id " + key_text(p.key) + " of a linear prior is or was in use"};
    if (p.serial != 0 && p.serial <= serial)
      return Error{ErrorCode::conflict, "add: the serial of a linear prior is not above those in the graph"};
    if (p.serial != 0) serial = p.serial;
    if (auto ok = prior(p); !ok) return ok;
  }
  if (has_twice(c.added, marks_)) return Error{ErrorCode::duplicate, "add: two linear priors have the same id"};
  return {};
}

Result<void> EditValidator::prior(const edit::AddedPrior& p) const {
  const edit::Priors& c = edit_.priors();
  std::size_t cols = 0, estimates = 0;
  for (std::uint32_t k = 0; k < p.variable_count; ++k) {
    const VariableKey id = c.variables[p.variables + k];
    const edit::Variables* column = edit_.find_variables(id.type);
    const VariableOps* ops = column != nullptr ? column->ops : graph_.find_ops(id.type);
    if (ops == nullptr || ops->dim == 0)
      return Error{ErrorCode::stale_id, "a linear prior names a variable of a type that the graph does not know"};
    if (auto ok = resolves(*ops, id.key, "a linear prior"); !ok) return ok;
    for (std::uint32_t j = 0; j < k; ++j)
      if (c.variables[p.variables + j] == id)
        return Error{ErrorCode::duplicate, "a linear prior names " + graph_.describe(id) + " twice"};
    cols += static_cast<std::size_t>(ops->dim);
    estimates += estimate_doubles(*ops);
  }
  if (!p.well_formed || p.variable_count == 0 || p.block_size < estimates ||
      (p.block_size - estimates) % (1 + cols) != 0)
    return Error{ErrorCode::size_mismatch,
                 "a linear prior over " + number(cols) + " columns has " + number(p.block_size) +
                     " numbers in all, which are not estimates, d (rows) and R (rows x columns)"};
  return prior_numbers(p, estimates);
}

Result<void> EditValidator::prior_numbers(const edit::AddedPrior& p, std::size_t estimates) const {
  const edit::Priors& c = edit_.priors();
  const double* estimate = c.numbers.data() + p.block;
  for (std::uint32_t k = 0; k < p.variable_count; ++k) {
    const VariableKey id = c.variables[p.variables + k];
    const edit::Variables* column = edit_.find_variables(id.type);
    const VariableOps* ops = column != nullptr ? column->ops : graph_.find_ops(id.type);
    if (!ops->finite(estimate))
      return Error{ErrorCode::not_finite, "a linear prior's estimate of " + graph_.describe(id) + " is not finite"};
    estimate += estimate_doubles(*ops);
  }
  for (std::size_t i = p.block + estimates; i < p.block + p.block_size; ++i)
    if (!std::isfinite(c.numbers[i]))
      return Error{ErrorCode::not_finite, "a linear prior holds a number that is not finite"};
  return {};
}

}  // namespace oriel
