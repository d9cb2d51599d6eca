#include "oriel/graph/fingerprint.h"

#include <algorithm>
#include <vector>

#include "oriel/base/hash.h"

namespace oriel {
namespace {

void add(Hash& h, SlotKey k) { h.word((std::uint64_t{k.index} << 32) | k.generation); }
void add(Hash& h, std::string_view text) { h.bytes(text.data(), text.size()); }

// Those that hold anything, by name: the order in which a graph met its types says nothing about it.
template <class Columns, class Less>
auto by_name(const Columns& columns, Less&& less) {
  std::vector<decltype(columns[0].get())> sorted;
  for (const auto& c : columns)
    if (c->slots().size() > 0) sorted.push_back(c.get());
  std::sort(sorted.begin(), sorted.end(), less);
  return sorted;
}

std::vector<VariablePool*> sorted_pools(const Graph& graph) {
  return by_name(graph.pools(), [](const auto* a, const auto* b) { return a->ops().name < b->ops().name; });
}

std::vector<FactorTable*> sorted_tables(const Graph& graph) {
  return by_name(graph.tables(), [](const auto* a, const auto* b) {
    const FactorOps &x = a->ops(), &y = b->ops();
    return x.residual != y.residual ? x.residual < y.residual : x.noise < y.noise;
  });
}

void add_variables(Hash& h, const Graph& graph, std::span<const VariableRef> refs) {
  for (const VariableRef& ref : refs) {
    const VariablePool& pool = *graph.pools()[ref.pool];
    h.word(pool.ops().key);
    add(h, pool.slots().key_of_slot(ref.slot));
  }
}

void add_pool(Hash& h, const VariablePool& pool) {
  add(h, pool.ops().name);
  h.word(pool.slots().size());
  for (std::uint32_t d = 0; d < pool.extent(); ++d) {
    if (!pool.slots().is_live(d)) continue;
    add(h, pool.slots().key(d));
    h.word(pool.slots().serial(d));
    const Freedom& freedom = pool.freedom(d);  // of what is free it says nothing, as before there were any
    h.word((pool.fixed(d) ? 1u : 0u) | (pool.has_first_estimate(d) ? 2u : 0u) | (freedom.is_full() ? 0u : 4u));
    if (!freedom.is_full()) h.word((std::uint64_t{freedom.held} << 8) | static_cast<std::uint64_t>(freedom.axes));
    h.bytes(pool.value(d), pool.ops().bytes);
    if (pool.has_first_estimate(d)) h.bytes(pool.first_estimate(d), pool.ops().bytes);
  }
}

void add_table(Hash& h, const Graph& graph, const FactorTable& table) {
  add(h, table.ops().residual);
  add(h, table.ops().noise);
  h.word(table.slots().size());
  for (std::uint32_t r = 0; r < table.extent(); ++r) {
    if (!table.slots().is_live(r)) continue;
    add(h, table.slots().key(r));
    h.word(table.slots().serial(r));
    h.bytes(table.measurement(r), table.ops().measurement_bytes);
    h.bytes(table.noise(r), table.ops().noise_bytes);
    h.word(static_cast<std::uint64_t>(table.loss(r).kind));
    h.bytes(&table.loss(r).scale, sizeof(double));
    h.bytes(&table.loss(r).shape, sizeof(double));
    if (table.loss(r).kind == LossKind::custom) h.word(table.loss(r).ops->key);
    add_variables(h, graph, table.variables(r));
  }
}

void add_priors(Hash& h, const Graph& graph) {
  const PriorTable& table = graph.priors();
  h.word(table.slots().size());
  for (std::uint32_t r = 0; r < table.extent(); ++r) {
    if (!table.slots().is_live(r)) continue;
    add(h, table.slots().key(r));
    h.word(table.slots().serial(r));
    add_variables(h, graph, table.variables(r));
    const auto block = table.block(r);
    h.bytes(block.data(), block.size_bytes());
  }
}

}  // namespace

std::uint64_t fingerprint(const Graph& graph) {
  Hash h;
  for (const VariablePool* pool : sorted_pools(graph)) add_pool(h, *pool);
  for (const FactorTable* table : sorted_tables(graph)) add_table(h, graph, *table);
  add_priors(h, graph);
  return h.value();
}

std::uint64_t value_fingerprint(const Graph& graph) {
  Hash h;
  for (const VariablePool* pool : sorted_pools(graph)) {
    add(h, pool->ops().name);
    for (std::uint32_t d = 0; d < pool->extent(); ++d)
      if (pool->slots().is_live(d)) h.bytes(pool->value(d), pool->ops().bytes);
  }
  return h.value();
}

}  // namespace oriel
