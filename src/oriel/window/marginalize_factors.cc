#include <algorithm>
#include <tuple>

#include "oriel/window/marginalize.h"

namespace oriel {
namespace {

std::span<const VariableRef> variables_of_row(const Graph& graph, const AbsorbedFactor& f) {
  return f.table == Graph::kPriorTable ? graph.priors().variables(f.row) : graph.tables()[f.table]->variables(f.row);
}

// What has columns, sorted.
void append_variables(const Graph& graph, const AbsorbedFactor& f, std::vector<std::uint64_t>& out) {
  const std::size_t first = out.size();
  for (const VariableRef& ref : variables_of_row(graph, f)) {
    const VariablePool& pool = *graph.pools()[ref.pool];
    if (pool.ops().dim > 0 && !pool.fixed(pool.slots().dense(ref.slot)))
      out.push_back((std::uint64_t{ref.pool} << 32) | ref.slot);
  }
  const auto begin = out.begin() + static_cast<std::ptrdiff_t>(first);
  std::sort(begin, out.end());
  out.erase(std::unique(begin, out.end()), out.end());
}

Result<AbsorbedFactor> find_row(const Graph& graph, FactorId id) {
  if (!graph.contains(id))
    return Error{ErrorCode::stale_id, "absorb: factor #" + std::to_string(id.key.index) + "." +
                                          std::to_string(id.key.generation) + " is not in the graph"};
  if (id.table == PriorTable::kKey) return AbsorbedFactor{Graph::kPriorTable, graph.priors().slots().find(id.key)};
  std::uint32_t table = 0;
  while (graph.tables()[table]->ops().key != id.table) ++table;
  return AbsorbedFactor{table, graph.tables()[table]->slots().find(id.key)};
}

}  // namespace

// Of the priors that know all its variables the one that knows most; of equal ones, the oldest. So a prior that is
// somebody's host is its own.
std::uint32_t Marginalizer::find_host(const Graph& graph, const Guest& guest) const {
  const auto own = variables_of(guest);
  if (own.empty()) return Guest::kNoHost;
  const auto pool = static_cast<std::uint32_t>(own[0] >> 32), slot = static_cast<std::uint32_t>(own[0]);
  const VariableKey first{graph.pools()[pool]->ops().key, graph.pools()[pool]->slots().key_of_slot(slot)};
  std::uint32_t host = Guest::kNoHost;
  std::size_t most = 0;
  graph.for_each_factor(first, [&](std::uint32_t table, std::uint32_t row) {
    if (table != Graph::kPriorTable) return;
    const auto refs = graph.priors().variables(row);
    const bool knows_all = std::all_of(own.begin(), own.end(), [&](std::uint64_t v) {
      return std::any_of(refs.begin(), refs.end(),
                         [&](const VariableRef& r) { return ((std::uint64_t{r.pool} << 32) | r.slot) == v; });
    });
    const auto fixed = static_cast<std::size_t>(std::count_if(refs.begin(), refs.end(), [&](const VariableRef& r) {
      return graph.pools()[r.pool]->fixed(graph.pools()[r.pool]->slots().dense(r.slot));
    }));
    const std::size_t count = refs.size() - fixed;
    if (!knows_all || count < most || (count == most && row > host)) return;
    host = row, most = count;
  });
  return host;
}

// Guests sorted by who joins whom: by host, then by their variables; a host that is named itself is its own guest.
Result<void> Marginalizer::invite(const Graph& graph, std::span<const FactorId> factors) {
  guests_.clear();
  guest_variables_.clear();
  for (const FactorId& id : factors) {
    const auto found = find_row(graph, id);
    if (!found) return found.error();
    Guest guest;
    guest.factor = *found;
    guest.first = static_cast<std::uint32_t>(guest_variables_.size());
    append_variables(graph, guest.factor, guest_variables_);
    guest.count = static_cast<std::uint32_t>(guest_variables_.size()) - guest.first;
    guest.host = find_host(graph, guest);
    guests_.push_back(guest);
  }
  auto place = [](const Guest& g) { return std::tuple(g.factor.table, g.factor.row); };
  std::sort(guests_.begin(), guests_.end(), [&](const Guest& a, const Guest& b) {
    if (a.host != b.host) return a.host < b.host;
    const auto x = variables_of(a), y = variables_of(b);
    if (!std::equal(x.begin(), x.end(), y.begin(), y.end()))
      return std::lexicographical_compare(x.begin(), x.end(), y.begin(), y.end());
    return place(a) < place(b);
  });
  for (std::size_t i = 1; i < guests_.size(); ++i)
    if (place(guests_[i]) == place(guests_[i - 1]))
      return Error{ErrorCode::duplicate, "absorb: a factor is named twice"};
  return {};
}

Result<MarginalizeReport> Marginalizer::absorb(Graph& graph, std::span<const FactorId> factors,
                                               const MarginalizeOptions& options, GraphEdit& edit) {
  edit.clear();
  if (auto ok = invite(graph, factors); !ok) return ok.error();
  root_.keep_conditional = false;
  MarginalizeReport report;
  edit.require_version(graph.version());
  for (const FactorId& id : factors)
    if (id.table != PriorTable::kKey) edit.remove(id);
  for (std::size_t begin = 0, end = 0; begin < guests_.size(); begin = end) {
    const Guest& first = guests_[begin];
    group_.clear();
    if (first.host != Guest::kNoHost) group_.push_back({Graph::kPriorTable, first.host});
    for (end = begin; end < guests_.size() && guests_[end].host == first.host; ++end) {
      const auto x = variables_of(first), y = variables_of(guests_[end]);
      if (first.host == Guest::kNoHost && !std::equal(x.begin(), x.end(), y.begin(), y.end())) break;
      const AbsorbedFactor& f = guests_[end].factor;
      if (f.table != Graph::kPriorTable || f.row != first.host) group_.push_back(f);
    }
    scope_.collect_factors(graph, group_);
    held_.begin(graph, scope_);  // nothing leaves, so nothing
    for (const AbsorbedFactor& f : group_)
      if (f.table == Graph::kPriorTable) edit.remove(FactorId{PriorTable::kKey, graph.priors().slots().key(f.row)});
    for (const MarginalComponent& component : scope_.components()) {
      absorb(graph, component, options, report);
      write_priors(graph, component, options, edit, report);
    }
  }
  return report;
}

}  // namespace oriel
