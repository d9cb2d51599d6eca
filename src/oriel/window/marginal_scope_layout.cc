#include <algorithm>

#include "oriel/window/marginal_scope.h"

namespace oriel {

using Role = MarginalVariable::Role;

void MarginalScope::rank_types(const Graph& graph) {
  auto rank = [this](std::size_t n, std::vector<std::uint32_t>& ranks, auto less) {
    types_.resize(n);
    for (std::uint32_t i = 0; i < n; ++i) types_[i] = i;
    std::sort(types_.begin(), types_.end(), less);
    ranks.resize(n);
    for (std::uint32_t i = 0; i < n; ++i) ranks[types_[i]] = i;
  };
  const auto& pools = graph.pools();
  rank(pools.size(), pool_rank_, [&](auto a, auto b) { return pools[a]->ops().name < pools[b]->ops().name; });
  const auto& tables = graph.tables();
  rank(tables.size(), table_rank_, [&](auto a, auto b) {
    const FactorOps &x = tables[a]->ops(), &y = tables[b]->ops();
    return x.residual != y.residual ? x.residual < y.residual : x.noise < y.noise;
  });
}

// Dense positions are in the order of serials.
void MarginalScope::sort_variables() {
  std::sort(variables_.begin(), variables_.end(), [this](const MarginalVariable& a, const MarginalVariable& b) {
    return a.pool != b.pool ? pool_rank_[a.pool] < pool_rank_[b.pool] : a.dense < b.dense;
  });
  for (std::size_t i = 0; i < variables_.size(); ++i)
    marks_[variables_[i].pool][variables_[i].dense].at = static_cast<std::int32_t>(i);
  parent_.resize(variables_.size());  // scratch: from old places to new ones
  for (std::size_t i = 0; i < variables_.size(); ++i) parent_[variables_[i].found] = static_cast<std::int32_t>(i);
  for (std::int32_t& at : arguments_) at = parent_[at];
}

// A landmark is eliminated on its own if no prior ties it to others and nothing of it is held; of landmarks that share
// a factor, the first one.
void MarginalScope::choose_landmarks() {
  parent_.resize(variables_.size());  // scratch: who could be eliminated
  for (std::size_t i = 0; i < variables_.size(); ++i) {
    MarginalVariable& v = variables_[i];
    v.eliminated = v.landmark && v.role == Role::leaving && !v.in_prior && !v.fixed && !v.restricted && v.dim <= 3;
    if (keep_asked_landmarks_ && v.found < asked_) v.eliminated = false;
    parent_[i] = v.eliminated;
  }
  for (const MarginalRow& r : rows_) {
    auto first = static_cast<std::int32_t>(variables_.size());
    for (const std::int32_t at : arguments(r.arguments))
      if (parent_[at]) first = std::min(first, at);
    for (const std::int32_t at : arguments(r.arguments))
      if (at > first) variables_[at].eliminated = false;
  }
  for (const MarginalRow& r : rows_) {
    bool landmark = false;
    for (const std::int32_t at : arguments(r.arguments)) landmark = landmark || variables_[at].eliminated;
    if (!landmark) continue;
    for (const std::int32_t at : arguments(r.arguments)) variables_[at].seen = true;
  }
}

std::int32_t MarginalScope::root(std::int32_t v) {
  while (parent_[v] != v) v = parent_[v] = parent_[parent_[v]];
  return v;
}

void MarginalScope::connect(std::int32_t a, std::int32_t b) {
  const std::int32_t x = root(a), y = root(b);
  parent_[std::max(x, y)] = std::min(x, y);
}

void MarginalScope::find_components() {
  parent_.resize(variables_.size());
  for (std::size_t i = 0; i < parent_.size(); ++i) parent_[i] = static_cast<std::int32_t>(i);
  auto first_of = [&](MarginalArguments list) {
    std::int32_t first = -1;
    for (const std::int32_t at : arguments(list)) {
      if (!variables_[at].has_columns()) continue;
      if (first < 0) first = at;
      connect(first, at);
    }
    return first;
  };
  for (MarginalRow& r : rows_) r.component = first_of(r.arguments);
  for (MarginalPrior& p : priors_) p.component = first_of(p.arguments);
  for (std::size_t i = 0; i < variables_.size(); ++i) {
    MarginalVariable& v = variables_[i];
    if (!v.has_columns()) continue;
    const std::int32_t top = root(static_cast<std::int32_t>(i));  // never after i: it has its number
    if (top == static_cast<std::int32_t>(i)) {
      v.component = static_cast<std::int32_t>(components_.size());
      components_.emplace_back();
    } else {
      v.component = variables_[top].component;
    }
  }
  for (MarginalRow& r : rows_) r.component = r.component < 0 ? -1 : variables_[r.component].component;
  for (MarginalPrior& p : priors_) p.component = p.component < 0 ? -1 : variables_[p.component].component;
}

// Columns: leaving variables first; those that see eliminated landmarks stand together, leaving or not, so that what
// the landmarks take away is one contiguous square.
void MarginalScope::place_columns() {
  keys_.clear();
  for (std::size_t i = 0; i < variables_.size(); ++i) {
    const MarginalVariable& v = variables_[i];
    if (!v.has_columns()) continue;
    const std::uint64_t kind = v.eliminated ? 0 : v.role == Role::leaving ? 1 + v.seen : 4 - v.seen;
    keys_.push_back((static_cast<std::uint64_t>(v.component) << 40) | (kind << 32) | i);
  }
  std::sort(keys_.begin(), keys_.end());
  int slot = 0, chunk_column = 0;
  for (const std::uint64_t key : keys_) {
    const auto i = static_cast<std::uint32_t>(key);
    MarginalVariable& v = variables_[i];
    MarginalComponent& c = components_[v.component];
    if (c.variables_end == 0) c.variables_begin = static_cast<std::uint32_t>(ordered_.size()), slot = 0;
    ordered_.push_back(i);
    c.variables_end = static_cast<std::uint32_t>(ordered_.size());
    if (v.eliminated) {
      if (slot % kChunk == 0) chunk_column = 0;
      v.column = c.landmark_dim;
      v.chunk = slot / kChunk, v.chunk_slot = slot % kChunk, v.chunk_column = chunk_column;
      ++slot, c.landmark_dim += v.dim, chunk_column += v.dim;
      continue;
    }
    v.column = c.dim();
    (v.role == Role::leaving ? c.leaving_dim : c.staying_dim) += v.dim;
    if (!v.seen) continue;
    if (c.seen_end == 0) c.seen_begin = v.column;
    c.seen_end = c.dim();
  }
}

// By component, chunk of landmarks and table; rows of a table that touch the same variables, landmarks apart, follow
// each other.
void MarginalScope::sort_rows() {
  std::erase_if(rows_, [](const MarginalRow& r) { return r.component < 0; });  // all it touches is known
  for (MarginalRow& r : rows_) {
    std::uint64_t pair = 0;
    r.chunk = 0;
    for (const std::int32_t at : arguments(r.arguments)) {
      if (variables_[at].eliminated)
        r.chunk = variables_[at].chunk;
      else if (pair < (1u << 16))
        pair = (pair << 16) | ((static_cast<std::uint64_t>(at) + 1) & 0xffffu);
    }
    r.major = (static_cast<std::uint64_t>(r.component) << 40) | (static_cast<std::uint64_t>(r.chunk) << 16) |
              table_rank_[r.table];
    r.minor = (pair << 32) | r.row;
  }
  std::sort(rows_.begin(), rows_.end(), [](const MarginalRow& a, const MarginalRow& b) {
    return a.major != b.major ? a.major < b.major : a.minor < b.minor;
  });
  std::erase_if(priors_, [](const MarginalPrior& p) { return p.component < 0; });
  std::sort(priors_.begin(), priors_.end(), [](const MarginalPrior& a, const MarginalPrior& b) {
    return a.component != b.component ? a.component < b.component : a.row < b.row;
  });
  slice_components();
}

void MarginalScope::slice_components() {
  for (std::uint32_t i = 0; i < rows_.size(); ++i) {
    MarginalComponent& c = components_[rows_[i].component];
    if (c.rows_end == 0) c.rows_begin = i;
    c.rows_end = i + 1;
  }
  for (std::uint32_t i = 0; i < priors_.size(); ++i) {
    MarginalComponent& c = components_[priors_[i].component];
    if (c.priors_end == 0) c.priors_begin = i;
    c.priors_end = i + 1;
  }
}

}  // namespace oriel
