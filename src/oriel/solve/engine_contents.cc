#include "oriel/solve/engine_contents.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "oriel/linear/linearize_factor.h"
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

template <class Refs>
void add_residual(const Graph& graph, FactorId id, int rows, const Refs& refs, EngineContents& out) {
  EngineContents::Residual residual{id, rows, {}};
  for (const VariableRef& ref : refs) {
    const VariablePool& pool = *graph.pools()[ref.pool];
    const std::uint32_t d = pool.slots().dense(ref.slot);
    if (pool.ops().dim > 0 && !pool.fixed(d)) residual.add({pool.ops().key, pool.slots().key(d)});
  }
  const auto linearized = linearize_factor(graph, id, false);
  if (linearized) out.cost += linearized->cost;
  out.residuals.push_back(std::move(residual));
}

}  // namespace

EngineContents expected_contents(const Graph& graph) {
  EngineContents out;
  for (const auto& pool : graph.pools())
    for (std::uint32_t d = 0; d < pool->extent(); ++d) {
      if (!pool->slots().is_live(d) || pool->fixed(d) || pool->ops().dim == 0) continue;
      const auto* value = static_cast<const std::byte*>(pool->value(d));
      out.parameters.push_back(
          {{pool->ops().key, pool->slots().key(d)}, pool->ops().dim, {value, value + pool->ops().bytes}});
    }
  for (const auto& table : graph.tables())
    for (std::uint32_t r = 0; r < table->extent(); ++r)
      if (table->slots().is_live(r))
        add_residual(graph, {table->ops().key, table->slots().key(r)}, table->ops().dim, table->variables(r), out);
  const PriorTable& priors = graph.priors();
  for (std::uint32_t r = 0; r < priors.extent(); ++r)
    if (priors.slots().is_live(r))
      add_residual(graph, {PriorTable::kKey, priors.slots().key(r)}, priors.shape(r).rows, priors.variables(r), out);
  return out;
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
