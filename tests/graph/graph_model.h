// What a graph should hold, kept by the simplest means: plain lists in the order in which things came. Times are
// versions of the graph.
#pragma once
#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <vector>

#include "graph/random_graph.h"

namespace oriel::testing_graph {

struct ModelVariable {
  VariableKey id;
  const VariableOps* ops = nullptr;
  std::array<double, 8> value{}, first{};  // as many bytes as the type has
  bool fixed = false, has_first = false;
  Freedom freedom{};
  int label = -1;
  std::uint64_t added = 0, set = 0, flagged = 0, first_set = 0, restricted = 0;  // when; 0: never

  const VariableOps& type() const { return *ops; }
  bool same_value(const void* p) const { return std::memcmp(value.data(), p, ops->bytes) == 0; }
};

struct ModelFactor {
  FactorId id;
  std::vector<VariableKey> variables;
  Loss loss = Loss::none();
  std::uint64_t added = 0, weighed = 0;
};

struct GraphModel {
  std::vector<ModelVariable> variables;
  std::vector<ModelFactor> factors;  // linear priors among them

  ModelVariable* find(const VariableKey& id) {
    for (ModelVariable& v : variables)
      if (v.id == id) return &v;
    return nullptr;
  }
  const ModelVariable* find(const VariableKey& id) const { return const_cast<GraphModel*>(this)->find(id); }
  const ModelFactor* find(const FactorId& id) const {
    for (const ModelFactor& f : factors)
      if (f.id == id) return &f;
    return nullptr;
  }
  static bool touches(const ModelFactor& f, const VariableKey& id) {
    return std::find(f.variables.begin(), f.variables.end(), id) != f.variables.end();
  }
  static bool is_prior(const ModelFactor& f) { return f.id.table == PriorTable::kKey; }
};

namespace detail {

inline std::string variable_difference(const Graph& graph, const VariablePool& pool, std::uint32_t d,
                                       const ModelVariable& v) {
  const VariableKey id(pool.ops().key, pool.slots().key(d));
  if (id != v.id) return graph.describe(id) + " stands where " + graph.describe(v.id) + " was expected";
  if (!v.same_value(pool.value(d))) return graph.describe(id) + " has another value";
  if (pool.fixed(d) != v.fixed) return graph.describe(id) + " has another flag";
  if (!(pool.freedom(d) == v.freedom)) return graph.describe(id) + " has another freedom";
  if (pool.has_first_estimate(d) != v.has_first ||
      (v.has_first && std::memcmp(v.first.data(), pool.first_estimate(d), pool.ops().bytes) != 0))
    return graph.describe(id) + " has another first estimate";
  if (v.label >= 0 && graph.describe(id) != std::string(pool.ops().name) + " 'x" + std::to_string(v.label) + "'")
    return graph.describe(id) + " has another label";
  return {};
}

inline std::string pool_difference(const Graph& graph, const VariablePool& pool, const GraphModel& model) {
  auto next = model.variables.begin();
  auto skip = [&] {
    while (next != model.variables.end() && next->ops->key != pool.ops().key) ++next;
  };
  for (std::uint32_t d = 0; d < pool.extent(); ++d) {
    if (!pool.slots().is_live(d)) continue;
    skip();
    if (next == model.variables.end()) return "more variables than expected";
    if (auto text = variable_difference(graph, pool, d, *next++); !text.empty()) return text;
  }
  skip();
  return next == model.variables.end() ? "" : "fewer variables than expected";
}

template <class Table>
std::string table_difference(const Graph& graph, const Table& table, std::uint64_t key, const GraphModel& model) {
  auto next = model.factors.begin();
  auto skip = [&] {
    while (next != model.factors.end() && next->id.table != key) ++next;
  };
  for (std::uint32_t r = 0; r < table.extent(); ++r) {
    if (!table.slots().is_live(r)) continue;
    skip();
    if (next == model.factors.end()) return "more factors than expected";
    const ModelFactor& f = *next++;
    if (f.id.key != table.slots().key(r)) return "a factor stands where another was expected";
    if constexpr (requires { table.loss(r); })
      if (table.loss(r).kind != f.loss.kind || table.loss(r).scale != f.loss.scale) return "a factor has another loss";
    const auto refs = table.variables(r);
    if (refs.size() != f.variables.size()) return "a factor has another number of variables";
    for (std::size_t k = 0; k < refs.size(); ++k) {
      const VariablePool& pool = *graph.pools()[refs[k].pool];
      if (f.variables[k] != VariableKey(pool.ops().key, pool.slots().key_of_slot(refs[k].slot)))
        return "a factor has another variable";
    }
  }
  skip();
  return next == model.factors.end() ? "" : "fewer factors than expected";
}

}  // namespace detail

// Empty where the graph holds what the model says, in the order in which it came, and nothing else.
inline std::string difference(const Graph& graph, const GraphModel& model) {
  if (graph.variable_count() != model.variables.size()) return "another number of variables";
  if (graph.factor_count() != model.factors.size()) return "another number of factors";
  for (const auto& p : graph.pools())
    if (auto text = detail::pool_difference(graph, *p, model); !text.empty()) return text;
  for (const auto& t : graph.tables())
    if (auto text = detail::table_difference(graph, *t, t->ops().key, model); !text.empty()) return text;
  return detail::table_difference(graph, graph.priors(), PriorTable::kKey, model);
}

// Does each variable's list of factors name those that the model has on it?
inline std::string incidence_difference(const Graph& graph, const GraphModel& model) {
  for (const ModelVariable& v : model.variables) {
    std::size_t listed = 0, expected = 0;
    graph.for_each_factor(v.id, [&](std::uint32_t, std::uint32_t) { ++listed; });
    for (const ModelFactor& f : model.factors)
      expected += static_cast<std::size_t>(std::count(f.variables.begin(), f.variables.end(), v.id));
    if (listed != expected) return graph.describe(v.id) + " lists other factors";
  }
  return {};
}

}  // namespace oriel::testing_graph
