#include "oriel/solve/engine_contents.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "oriel/linear/linearize_factor.h"
#include "oriel/solve/contents_of.h"
#include "oriel/solve/engine.h"

namespace oriel {
namespace {

constexpr double kCostTolerance = 1e-9;  // relative: sums of positive numbers in two orders

auto order(const VariableKey& id) { return std::tuple(id.type, id.key.index, id.key.generation); }
auto order(const FactorId& id) { return std::tuple(id.table, id.key.index, id.key.generation); }

template <class Items>
void sort(Items& items) {
  std::sort(items.begin(), items.end(), [](const auto& a, const auto& b) { return order(a.id) < order(b.id); });
}

std::string describe(const Graph& graph, const VariableKey& id) { return graph.describe(id); }
std::string describe(const Graph& graph, const FactorId& id) {
  const FactorOps* ops = graph.find_factor_ops(id.table);
  const std::string type = id.table == PriorTable::kKey ? std::string("linear prior")
                           : ops != nullptr             ? "factor of " + std::string(ops->residual)
                                                        : std::string("factor of an unknown table");
  return type + " #" + std::to_string(id.key.index) + "." + std::to_string(id.key.generation);
}

Error difference(const std::string& text) { return {ErrorCode::conflict, "check: the engine " + text}; }

// Both sorted; names the first item that only one side has, or that one side has twice.
template <class Items>
Result<void> compare_ids(const Graph& graph, const Items& expected, const Items& held) {
  for (std::size_t i = 0; i < std::max(expected.size(), held.size()); ++i) {
    const bool missing = i >= held.size() || (i < expected.size() && order(expected[i].id) < order(held[i].id));
    if (missing) return difference("lacks " + describe(graph, expected[i].id));
    if (i > 0 && held[i].id == held[i - 1].id) return difference("holds " + describe(graph, held[i].id) + " twice");
    if (i >= expected.size() || !(expected[i].id == held[i].id))
      return difference("holds " + describe(graph, held[i].id) + ", which is not for it to hold");
  }
  return {};
}

void add_parameter(const Graph& graph, const VariableKey& id, EngineContents& out) {
  const VariableOps* ops = graph.find_ops(id.type);
  const auto* value = static_cast<const std::byte*>(graph.find_value(id));
  if (value == nullptr)
    out.parameters.push_back({id, 0, {}, {}});
  else if (ops->dim > 0 && !graph.fixed(id))
    out.parameters.push_back({id, ops->dim, {value, value + ops->bytes}, graph.freedom(id)});
}

void add_residual(const Graph& graph, const FactorId& id, EngineContents& out) {
  out.residuals.push_back({id, 0, {}});
  const auto linearized = linearize_factor(graph, id, false);
  if (!linearized) return;
  out.cost += linearized->cost;
  out.residuals.back().rows = linearized->rows;
  for (const VariableKey& v : linearized->variables)
    if (!graph.fixed(v) && graph.find_ops(v.type)->dim > 0) out.residuals.back().add(v);
}

template <class Slots, class F>
void for_each_key(const Slots& slots, F&& f) {
  for (std::uint32_t d = 0; d < slots.extent(); ++d)
    if (slots.is_live(d)) f(slots.key(d));
}

}  // namespace

EngineContents contents_of(const Graph& graph, std::span<const VariableKey> variables,
                           std::span<const FactorId> factors) {
  EngineContents out;
  for (const VariableKey& id : variables) add_parameter(graph, id, out);
  for (const FactorId& id : factors) add_residual(graph, id, out);
  return out;
}

EngineContents expected_contents(const Graph& graph) {
  std::vector<VariableKey> variables;
  std::vector<FactorId> factors;
  for (const auto& pool : graph.pools())
    for_each_key(pool->slots(), [&](SlotKey k) { variables.emplace_back(pool->ops().key, k); });
  for (const auto& table : graph.tables())
    for_each_key(table->slots(), [&](SlotKey k) { factors.push_back({table->ops().key, k}); });
  for_each_key(graph.priors().slots(), [&](SlotKey k) { factors.push_back({PriorTable::kKey, k}); });
  return contents_of(graph, variables, factors);
}

Result<void> compare_contents(const Graph& graph, EngineContents expected, EngineContents held) {
  sort(expected.parameters), sort(held.parameters);
  sort(expected.residuals), sort(held.residuals);
  if (auto ok = compare_ids(graph, expected.parameters, held.parameters); !ok) return ok;
  for (std::size_t i = 0; i < held.parameters.size(); ++i) {
    const auto &e = expected.parameters[i], &h = held.parameters[i];
    if (e.dim != h.dim)
      return difference("has " + std::to_string(h.dim) + " dimensions for " + describe(graph, e.id) + ", " +
                        std::to_string(e.dim) + " expected");
    if (!(e.freedom == h.freedom)) return difference("holds other directions of " + describe(graph, e.id));
    if (e.value != h.value) return difference("holds another value of " + describe(graph, e.id));
  }
  if (auto ok = compare_ids(graph, expected.residuals, held.residuals); !ok) return ok;
  for (std::size_t i = 0; i < held.residuals.size(); ++i) {
    const auto &e = expected.residuals[i], &h = held.residuals[i];
    if (e.rows != h.rows)
      return difference("has " + std::to_string(h.rows) + " rows for " + describe(graph, e.id) + ", " +
                        std::to_string(e.rows) + " expected");
    if (e.parameters != h.parameters) return difference("connects " + describe(graph, e.id) + " to other variables");
  }
  if (!(std::fabs(expected.cost - held.cost) <= kCostTolerance * std::fabs(expected.cost)) &&
      (std::isfinite(expected.cost) || std::isfinite(held.cost)))
    return difference("has the cost " + std::to_string(held.cost) + ", " + std::to_string(expected.cost) + " expected");
  return {};
}

Result<void> check(Engine& engine, const Graph& graph) {
  auto held = engine.contents();
  if (!held) return held.error();
  return compare_contents(graph, expected_contents(graph), std::move(*held));
}

}  // namespace oriel
