#include "oriel/window/marginal_scope.h"

#include <algorithm>

namespace oriel {
namespace {

using Role = MarginalVariable::Role;

// Grows a column of marks; its length is that of the graph's, so a steady window leaves it alone.
template <class T>
void cover(std::vector<T>& column, std::size_t extent) {
  if (column.size() < extent) column.resize(extent + extent / 2);
}

}  // namespace

Result<void> MarginalScope::collect(const Graph& graph, std::span<const VariableKey> leaving, LandmarkPolicy policy,
                                    std::span<const TypePolicy> types, bool keep_asked_landmarks) {
  reset(graph);
  keep_asked_landmarks_ = keep_asked_landmarks;
  for (const VariableKey& id : leaving)
    if (auto ok = add_leaving(graph, id, types); !ok) return ok;
  asked_ = static_cast<std::int32_t>(variables_.size());
  for (std::int32_t i = 0; i < asked_; ++i) drop_asked(graph, i);
  for (std::int32_t i = 0; i < asked_; ++i)
    if (variables_[i].role == Role::leaving) judge_landmarks(graph, i, policy);
  const auto gone = static_cast<std::int32_t>(variables_.size());
  for (std::int32_t i = 0; i < gone; ++i)
    if (variables_[i].role == Role::leaving) absorb_factors(graph, i);
  arrange(graph);
  return {};
}

void MarginalScope::collect_factors(const Graph& graph, std::span<const AbsorbedFactor> factors) {
  reset(graph);
  keep_asked_landmarks_ = false;
  asked_ = 0;
  for (const AbsorbedFactor& f : factors) {
    if (f.table == Graph::kPriorTable)
      absorb_prior(graph, f.row);
    else
      absorb_row(graph, f.table, f.row);
  }
  arrange(graph);
}

void MarginalScope::arrange(const Graph& graph) {
  for (MarginalVariable& v : variables_) {
    const VariablePool& pool = *graph.pools()[v.pool];
    v.restricted =
        pool.restricted_count() > 0 && v.role == Role::leaving && !v.fixed && !pool.freedom(v.dense).is_full();
  }
  rank_types(graph);
  sort_variables();
  choose_landmarks();
  find_components();
  place_columns();
  sort_rows();
}

void MarginalScope::reset(const Graph& graph) {
  ++stamp_;
  variables_.clear();
  rows_.clear();
  priors_.clear();
  arguments_.clear();
  components_.clear();
  ordered_.clear();
  closed_landmarks = leaving_landmarks = kept_landmarks = dropped_landmarks = dropped_factors = dropped_variables = 0;
  if (marks_.size() < graph.pools().size()) marks_.resize(graph.pools().size());
  for (std::size_t p = 0; p < graph.pools().size(); ++p) cover(marks_[p], graph.pools()[p]->extent());
  if (row_stamps_.size() < graph.tables().size()) row_stamps_.resize(graph.tables().size());
  for (std::size_t t = 0; t < graph.tables().size(); ++t) cover(row_stamps_[t], graph.tables()[t]->extent());
  cover(prior_stamps_, graph.priors().extent());
}

std::int32_t MarginalScope::find(std::uint32_t pool, std::uint32_t dense) const {
  const Mark& m = marks_[pool][dense];
  return m.stamp == stamp_ ? m.at : -1;
}

std::int32_t MarginalScope::add(const Graph& graph, std::uint32_t pool, std::uint32_t dense) {
  const VariablePool& p = *graph.pools()[pool];
  if (p.ops().dim == 0) return -1;
  Mark& mark = marks_[pool][dense];
  if (mark.stamp == stamp_) return mark.at;
  mark = {stamp_, static_cast<std::int32_t>(variables_.size())};
  MarginalVariable v;
  v.id = {p.ops().key, p.slots().key(dense)};
  v.pool = pool, v.dense = dense;
  v.dim = p.ops().dim;
  v.fixed = p.fixed(dense);
  v.landmark = p.ops().landmark;
  v.found = mark.at;
  variables_.push_back(v);
  return mark.at;
}

Result<void> MarginalScope::add_leaving(const Graph& graph, VariableKey id, std::span<const TypePolicy> types) {
  std::uint32_t pool = 0;
  while (pool < graph.pools().size() && graph.pools()[pool]->ops().key != id.type) ++pool;
  const std::uint32_t dense =
      pool == graph.pools().size() ? SlotIndex::kNone : graph.pools()[pool]->slots().find(id.key);
  if (dense == SlotIndex::kNone)
    return Error{ErrorCode::stale_id, "marginalize: " + graph.describe(id) + " is not in the graph"};
  if (find(pool, dense) >= 0)
    return Error{ErrorCode::duplicate, "marginalize: " + graph.describe(id) + " is named twice"};
  const std::int32_t at = add(graph, pool, dense);
  if (at < 0)
    return Error{ErrorCode::bad_input, "marginalize: " + graph.describe(id) + " is a constant, expected a variable"};
  MarginalVariable& v = variables_[at];
  const Departure departure = policy_of(types, id.type).departure;
  v.held = departure == Departure::fix;
  v.fixed = v.fixed || v.held || departure == Departure::condition;
  v.role = v.held ? Role::staying : departure == Departure::drop ? Role::dropped : Role::leaving;
  return {};
}

// Factors of variables that are dropped are claimed before any of them is absorbed.
void MarginalScope::drop_asked(const Graph& graph, std::int32_t at) {
  if (variables_[at].role != Role::dropped) return;
  ++dropped_variables;
  drop(graph, at);
  for_each_landmark(graph, at, [&](std::uint32_t pool, std::uint32_t dense) {
    if (!is_orphan(graph, {graph.pools()[pool]->ops().key, graph.pools()[pool]->slots().key(dense)})) return;
    variables_[add(graph, pool, dense)].role = Role::dropped;
    ++dropped_landmarks;
  });
}

// Whether all its factors are claimed, and no prior knows it.
bool MarginalScope::is_orphan(const Graph& graph, VariableKey id) const {
  bool orphan = true;
  graph.for_each_factor(id, [&](std::uint32_t table, std::uint32_t row) {
    orphan = orphan && table != Graph::kPriorTable && row_stamps_[table][row] == stamp_;
  });
  return orphan;
}

// f(pool, dense position) for the landmarks, neither fixed nor known yet, that factors of a variable touch.
template <class F>
void MarginalScope::for_each_landmark(const Graph& graph, std::int32_t at, F&& f) const {
  const VariableKey id = variables_[at].id;
  graph.for_each_factor(id, [&](std::uint32_t table, std::uint32_t row) {
    if (table == Graph::kPriorTable) return;
    for (const VariableRef& ref : graph.tables()[table]->variables(row)) {
      const VariablePool& pool = *graph.pools()[ref.pool];
      const std::uint32_t dense = pool.slots().dense(ref.slot);
      if (!pool.ops().landmark || pool.fixed(dense) || find(ref.pool, dense) >= 0) continue;
      f(ref.pool, dense);
    }
  });
}

void MarginalScope::judge_landmarks(const Graph& graph, std::int32_t at, LandmarkPolicy policy) {
  for_each_landmark(graph, at, [&](std::uint32_t pool, std::uint32_t dense) {
    judge_landmark(graph, add(graph, pool, dense), policy);
  });
}

void MarginalScope::judge_landmark(const Graph& graph, std::int32_t at, LandmarkPolicy policy) {
  if (seen_by_leaving_alone(graph, at)) {
    variables_[at].role = Role::leaving;
    ++leaving_landmarks;
  } else if (policy == LandmarkPolicy::keep) {
    ++kept_landmarks;
  } else if (policy == LandmarkPolicy::close) {
    variables_[at].role = Role::leaving;
    ++closed_landmarks;
  } else {
    ++dropped_landmarks;
    drop(graph, at);
  }
}

bool MarginalScope::seen_by_leaving_alone(const Graph& graph, std::int32_t at) const {
  bool alone = true;
  auto look = [&](const VariableRef& ref) {
    const VariablePool& pool = *graph.pools()[ref.pool];
    if (pool.ops().dim == 0) return;
    const std::int32_t other = find(ref.pool, pool.slots().dense(ref.slot));
    alone = alone && (other == at || (other >= 0 && other < asked_ && variables_[other].role != Role::staying));
  };
  graph.for_each_factor(variables_[at].id, [&](std::uint32_t table, std::uint32_t row) {
    const auto refs =
        table == Graph::kPriorTable ? graph.priors().variables(row) : graph.tables()[table]->variables(row);
    for (const VariableRef& ref : refs) look(ref);
  });
  return alone;
}

// Its factors are claimed, so that nobody absorbs them. What an absorbed prior says of it is marginalized, not lost.
void MarginalScope::drop(const Graph& graph, std::int32_t at) {
  variables_[at].role = Role::dropped;
  graph.for_each_factor(variables_[at].id, [&](std::uint32_t table, std::uint32_t row) {
    if (table == Graph::kPriorTable)
      variables_[at].role = Role::leaving;
    else if (claim(row_stamps_[table], row))
      ++dropped_factors;
  });
}

bool MarginalScope::claim(std::vector<std::uint32_t>& stamps, std::uint32_t row) {
  if (stamps[row] == stamp_) return false;
  stamps[row] = stamp_;
  return true;
}

void MarginalScope::absorb_factors(const Graph& graph, std::int32_t at) {
  const VariableKey id = variables_[at].id;
  graph.for_each_factor(id, [&](std::uint32_t table, std::uint32_t row) {
    if (table == Graph::kPriorTable) {
      if (claim(prior_stamps_, row)) absorb_prior(graph, row);
    } else if (claim(row_stamps_[table], row)) {
      absorb_row(graph, table, row);
    }
  });
}

MarginalArguments MarginalScope::add_all(const Graph& graph, std::span<const VariableRef> refs) {
  MarginalArguments list{static_cast<std::uint32_t>(arguments_.size()), 0};
  for (const VariableRef& ref : refs) {
    const std::int32_t at = add(graph, ref.pool, graph.pools()[ref.pool]->slots().dense(ref.slot));
    if (at >= 0) arguments_.push_back(at), ++list.count;
  }
  return list;
}

void MarginalScope::absorb_row(const Graph& graph, std::uint32_t table, std::uint32_t row) {
  MarginalRow r;
  r.table = table, r.row = row;
  r.arguments = add_all(graph, graph.tables()[table]->variables(row));
  rows_.push_back(r);
}

void MarginalScope::absorb_prior(const Graph& graph, std::uint32_t row) {
  MarginalPrior p;
  p.row = row;
  p.arguments = add_all(graph, graph.priors().variables(row));
  for (const std::int32_t at : arguments(p.arguments)) variables_[at].in_prior = true;
  priors_.push_back(p);
}

}  // namespace oriel
