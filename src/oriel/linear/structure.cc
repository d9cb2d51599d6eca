#include "oriel/linear/structure.h"

#include <algorithm>

#include "oriel/linear/resize.h"

namespace oriel {
namespace {

constexpr std::size_t kManyKept = 500, kFewLandmarks = 4;  // kept variables, and as many for each landmark

}  // namespace

Result<void> LinearStructure::build(const Graph& graph, const FactorOptions& options, EliminationOrder& order) {
  ++version_;
  order_types(graph);
  find_cuts(graph);
  number_variables(graph);
  demote_landmarks(graph);
  demote_few_landmarks();
  collect_rows(graph);
  number_kept(graph);
  plan_priors(graph);
  find_changed_blocks(graph, options);
  for (std::size_t t = 0; t < plan_count_; ++t) group_rows(plans_[t]);
  plan_followed(graph);
  find_neighbours();
  place_landmarks();
  if (auto ok = followed_.is_large ? analyze_large(graph, options, order) : analyze(options); !ok) return ok;
  place_pairs(graph);
  place_slices();
  place_landmark_pairs();
  note_seen(graph);
  return {};
}

// By name, whatever the order in which the graph came to know them: a replica may have met them in another.
void LinearStructure::order_types(const Graph& graph) {
  const auto& pools = graph.pools();
  pool_order_.resize(pools.size());
  for (std::size_t p = 0; p < pools.size(); ++p) pool_order_[p] = static_cast<std::uint32_t>(p);
  std::sort(pool_order_.begin(), pool_order_.end(),
            [&](auto a, auto b) { return pools[a]->ops().name < pools[b]->ops().name; });
  has_landmark_types_ =
      std::any_of(pools.begin(), pools.end(), [](const auto& p) { return p->ops().landmark && p->slots().size() > 0; });
  const auto& tables = graph.tables();
  table_order_.clear();
  for (std::uint32_t t = 0; t < tables.size(); ++t)
    if (tables[t]->slots().size() > 0) table_order_.push_back(t);
  std::sort(table_order_.begin(), table_order_.end(), [&](auto a, auto b) {
    const FactorOps &x = tables[a]->ops(), &y = tables[b]->ops();
    return x.residual != y.residual ? x.residual < y.residual : x.noise < y.noise;
  });
}

// First guess: everything that is free and of a landmark type is eliminated.
void LinearStructure::number_variables(const Graph& graph) {
  const auto& pools = graph.pools();
  targets_.resize(pools.size());
  offsets_.resize(pools.size());
  for (std::size_t p = 0; p < pools.size(); ++p) {
    const VariablePool& pool = *pools[p];
    const std::uint32_t from = followed_.pool_cut[p];
    targets_[p].resize(from), resize_with_room(targets_[p], pool.extent());
    offsets_[p].resize(from), resize_with_room(offsets_[p], pool.extent());
    std::fill(offsets_[p].begin() + from, offsets_[p].end(), -1);
    if (pool.ops().dim == 0) continue;
    for (std::uint32_t d = from; d < pool.extent(); ++d)
      if (pool.slots().is_live(d) && !pool.fixed(d))
        targets_[p][d].kind = pool.ops().landmark ? Target::Kind::landmark : Target::Kind::kept;
  }
}

// Of two landmarks in one factor the second is kept, and so is each that a prior touches.
void LinearStructure::demote_landmarks(const Graph& graph) {
  if (!has_landmark_types_) return;
  const PriorTable& priors = graph.priors();
  for (std::uint32_t r = 0; r < priors.extent(); ++r) {
    if (!priors.slots().is_live(r)) continue;
    for (const VariableRef& ref : priors.variables(r)) {
      Target& t = targets_[ref.pool][graph.pools()[ref.pool]->slots().dense(ref.slot)];
      if (t.kind == Target::Kind::landmark) t.kind = Target::Kind::kept;
    }
  }
  for (const std::uint32_t place : table_order_) {
    const FactorTable* table = graph.tables()[place].get();
    int landmark_arguments = 0;
    for (const VariableOps* v : table->ops().variables) landmark_arguments += v->landmark;
    if (landmark_arguments < 2) continue;
    for (std::uint32_t r = 0; r < table->extent(); ++r) {
      if (!table->slots().is_live(r)) continue;
      bool first = true;
      for (const VariableRef& ref : table->variables(r)) {
        Target& t = targets_[ref.pool][graph.pools()[ref.pool]->slots().dense(ref.slot)];
        if (t.kind != Target::Kind::landmark) continue;
        if (!first) t.kind = Target::Kind::kept;
        first = false;
      }
    }
  }
}

// Few landmarks among very many other variables, as trees along a drive: each is seen from so many poses that to
// eliminate it first would tie all of these together. The ordering finds a better place for them.
void LinearStructure::demote_few_landmarks() {
  if (!has_landmark_types_) return;
  std::size_t kept = 0, landmarks = 0;
  for (const auto& pool : targets_)
    for (const Target& t : pool) kept += t.kind == Target::Kind::kept, landmarks += t.kind == Target::Kind::landmark;
  if (landmarks == 0 || kept < kManyKept || kept < kFewLandmarks * landmarks) return;
  for (auto& pool : targets_)
    for (Target& t : pool)
      if (t.kind == Target::Kind::landmark) t.kind = Target::Kind::kept;
}

void LinearStructure::collect_rows(const Graph& graph) {
  const auto& tables = graph.tables();
  plan_count_ = table_order_.size();
  if (plans_.size() < plan_count_) plans_.resize(plan_count_);
  row_count_ = 0;
  for (std::size_t i = 0; i < plan_count_; ++i) {
    TablePlan& plan = plans_[i];
    const FactorTable& table = *tables[table_order_[i]];
    plan.table = &table;
    plan.arguments.clear();
    collect_rows(graph, plan, followed_.row_cut[i]);
    row_count_ += plan.rows.size();
    int column = 0;
    const auto refs = table.variables(plan.rows.front());
    for (int k = 0; k < table.arity(); ++k) {
      const VariableOps& ops = *table.ops().variables[k];
      if (ops.dim > 0) plan.arguments.push_back({k, ops.dim, column, refs[k].pool, ops.landmark});
      column += ops.dim;
    }
  }
}

void LinearStructure::collect_rows(const Graph& graph, TablePlan& plan, std::size_t from) {
  const FactorTable& table = *plan.table;
  const auto arity = static_cast<std::size_t>(table.arity());
  const std::uint32_t first = from == 0 ? 0 : plan.rows[from - 1] + 1;
  resize_with_room(plan.rows, table.slots().size());
  resize_with_room(plan.dense, plan.rows.size() * arity);
  std::uint32_t *row = plan.rows.data() + from, *dense = plan.dense.data() + from * arity;
  for (std::uint32_t r = first; r < table.extent(); ++r) {
    if (!table.slots().is_live(r)) continue;
    *row++ = r;
    for (const VariableRef& ref : table.variables(r)) *dense++ = graph.pools()[ref.pool]->slots().dense(ref.slot);
  }
}

// Kept blocks: first those that no landmark's factor touches (velocities and biases: the chain of a window), then the
// rest; each in the order of serials, so that states that were born together stand together.
void LinearStructure::number_kept(const Graph& graph) {
  for (std::size_t i = 0; i < plan_count_; ++i) {
    const TablePlan& plan = plans_[i];
    const bool landmarks =
        std::any_of(plan.arguments.begin(), plan.arguments.end(), [](auto& a) { return a.landmark_type; });
    if (!landmarks) continue;
    const int arity = plan.table->arity();
    for (std::size_t r = 0; r < plan.rows.size(); ++r) {
      bool touches = false;
      for (const auto& a : plan.arguments)
        touches = touches || targets_[a.pool][plan.dense[r * arity + a.arg]].kind == Target::Kind::landmark;
      if (!touches) continue;
      for (const auto& a : plan.arguments)
        targets_[a.pool][plan.dense[r * arity + a.arg]].index = 0;  // marks it as seen
    }
  }
  collect_kept(graph);
  int offset = kept_dim_;
  for (std::size_t i = 0; i < landmarks_.size(); ++i) {
    LandmarkBlock& l = landmarks_[i];
    l.offset = offset;
    targets_[l.pool][l.dense] = {Target::Kind::landmark, static_cast<std::int32_t>(i), offset};
    offsets_[l.pool][l.dense] = offset;
    offset += l.dim;
  }
  dim_ = offset;
}

// From the cut on; within a pool, places are by serial.
void LinearStructure::collect_kept(const Graph& graph) {
  const std::size_t cut = followed_.kept_cut;
  const std::uint64_t last = cut == 0 ? 0 : followed_.serials[cut - 1];
  kept_.resize(cut);
  landmarks_.clear();
  std::size_t pools = 0;  // that have any
  for (const std::uint32_t p : pool_order_) {
    const VariablePool& pool = *graph.pools()[p];
    const std::size_t before = kept_.size();
    std::uint32_t d = cut == 0 ? 0 : pool.slots().first_after(last);
    for (; d < pool.extent(); ++d) {
      const Target& t = targets_[p][d];
      if (t.kind == Target::Kind::kept) kept_.push_back({pool.ops().dim, 0, p, d, t.index == 0});
      if (t.kind == Target::Kind::landmark) {
        LandmarkBlock& l = landmarks_.emplace_back();
        l.dim = pool.ops().dim, l.pool = p, l.dense = d;
      }
    }
    pools += kept_.size() > before;
  }
  auto serial = [&](const KeptBlock& b) { return graph.pools()[b.pool]->slots().serial(b.dense); };
  auto before = [&](const KeptBlock& a, const KeptBlock& b) {
    return a.sees_landmarks != b.sees_landmarks ? b.sees_landmarks : serial(a) < serial(b);
  };
  const auto from = kept_.begin() + static_cast<std::ptrdiff_t>(cut);
  const bool is_sorted = pools <= 1 && landmarks_.empty();
  if (!is_sorted && !std::is_sorted(from, kept_.end(), before)) std::sort(from, kept_.end(), before);
  int offset = cut == 0 ? 0 : kept_[cut - 1].offset + kept_[cut - 1].dim;
  for (std::size_t i = cut; i < kept_.size(); ++i) {
    kept_[i].offset = offset;
    targets_[kept_[i].pool][kept_[i].dense] = {Target::Kind::kept, static_cast<std::int32_t>(i), offset};
    offsets_[kept_[i].pool][kept_[i].dense] = offset;
    offset += kept_[i].dim;
  }
  kept_dim_ = offset;
}

void LinearStructure::plan_priors(const Graph& graph) {
  const PriorTable& table = graph.priors();
  prior_count_ = table.slots().size();
  if (priors_.size() < prior_count_) priors_.resize(prior_count_);
  std::size_t i = 0;
  for (std::uint32_t r = 0; r < table.extent(); ++r) {
    if (!table.slots().is_live(r)) continue;
    PriorPlan& plan = priors_[i++];
    plan.row = r;
    plan.targets.clear();
    plan.columns.clear();
    plan.pool.clear();
    plan.dense.clear();
    int column = 0;
    for (const VariableRef& ref : table.variables(r)) {
      const VariablePool& pool = *graph.pools()[ref.pool];
      const std::uint32_t d = pool.slots().dense(ref.slot);
      plan.targets.push_back(targets_[ref.pool][d]);
      plan.columns.push_back(column);
      plan.pool.push_back(ref.pool);
      plan.dense.push_back(d);
      column += pool.ops().dim;
    }
    plan.columns.push_back(column);
  }
}

// Rows before `from` are planned.
void LinearStructure::plan_table(TablePlan& plan, std::size_t from) {
  resize_with_room(plan.targets, plan.rows.size() * plan.arguments.size());
  resize_with_room(plan.landmark, plan.rows.size());
  for (std::size_t r = from; r < plan.rows.size(); ++r) plan_row(plan, r);
}

void LinearStructure::plan_row(TablePlan& plan, std::size_t r) {
  const std::size_t n = plan.arguments.size(), arity = static_cast<std::size_t>(plan.table->arity());
  std::int32_t landmark = -1;
  for (std::size_t a = 0; a < n; ++a) {
    const auto& argument = plan.arguments[a];
    const Target& t = targets_[argument.pool][plan.dense[r * arity + static_cast<std::size_t>(argument.arg)]];
    plan.targets[r * n + a] = t;
    if (t.kind == Target::Kind::landmark) landmark = t.index;
  }
  plan.landmark[r] = landmark;
}

BlockAddress LinearStructure::address(int i, int j) const {
  if (!small_table_.empty()) return small_table_[static_cast<std::size_t>(i) * kept_.size() + j];
  return factorization_.address(i, j);
}

// In runs, those of each run's first row alone.
void LinearStructure::place_pairs(const Graph& graph) {
  for (std::size_t t = 0; t < plan_count_; ++t) {
    TablePlan& plan = plans_[t];
    const std::size_t n = plan.arguments.size();
    resize_with_room(plan.pairs, plan.rows.size() * (n * (n + 1) / 2));
    for (const TablePlan::Run& run : plan.runs) place_pairs_of_row(plan, run.first);
    if (!plan.runs.empty()) continue;
    for (std::size_t r = followed_.follows ? followed_.same[t] : 0; r < plan.rows.size(); ++r)
      place_pairs_of_row(plan, r);
  }
  if (followed_.follows) place_moved_pairs(graph);
}

void LinearStructure::place_pairs_of_row(TablePlan& plan, std::size_t r) {
  const std::size_t n = plan.arguments.size();
  PairAddress* out = &plan.pairs[r * (n * (n + 1) / 2)];
  for (std::size_t a = 0; a < n; ++a)
    for (std::size_t b = 0; b <= a; ++b, ++out) {
      *out = {};
      const Target &x = plan.targets[r * n + a], &y = plan.targets[r * n + b];
      if (x.kind != Target::Kind::kept || y.kind != Target::Kind::kept) continue;
      const BlockAddress at = address(x.index, y.index);
      *out = {at.offset, at.ld, at.transposed ? PairAddress::Kind::transposed : PairAddress::Kind::stored};
      if (a != b && x.index == y.index) out->kind = PairAddress::Kind::diagonal_twice;
    }
}

void LinearStructure::locate(int s, std::uint32_t& pool, std::uint32_t& dense, int& within) const {
  auto find = [&](const auto& blocks) {
    auto after = std::upper_bound(blocks.begin(), blocks.end(), s, [](int at, const auto& b) { return at < b.offset; });
    const auto& b = *std::prev(after);
    pool = b.pool, dense = b.dense, within = s - b.offset;
  };
  if (s < kept_dim_)
    find(kept_);
  else
    find(landmarks_);
}

}  // namespace oriel
