// A large graph changes a little all the time, and mostly at its newest end. A structure that was built before is
// followed: which rows, and thereby which kept blocks, differ; what they reach of pattern, fronts and addresses is made
// anew, the rest stands. The elimination order is state; the bits are those of a structure that is built from nothing
// with that order.
#include <algorithm>
#include <utility>

#include "oriel/linear/resize.h"
#include "oriel/linear/structure.h"

namespace oriel {
namespace {

constexpr std::size_t kLargestChange = 8;  // a structure is followed where at most an eighth of its blocks may differ
constexpr std::size_t kLongestTail = 8;    // and its end is looked at alone where that is an eighth at most

bool differ(const Target* x, const Target* y, std::size_t n) {
  return !std::equal(x, x + n, y,
                     [](const Target& a, const Target& b) { return a.kind == b.kind && a.index == b.index; });
}

}  // namespace

// What is behind the cuts of a column's places is compared with what was there; what stands before is known to be as it
// was (SlotIndex::changes).
bool LinearStructure::may_cut(const Graph& graph) const {
  const FollowedStructure& f = followed_;
  return f.same_tables && f.seen_pools.size() == graph.pools().size() && !has_landmark_types_;
}

void LinearStructure::find_cuts(const Graph& graph) {
  FollowedStructure& f = followed_;
  f.follows = f.same_targets = f.same_tables = false;
  f.kept_cut = 0;
  f.pool_cut.assign(graph.pools().size(), 0);
  f.row_cut.assign(table_order_.size(), 0);
  if (!std::exchange(f.is_ready, false)) return;
  f.same_tables = table_order_.size() == plan_count_ && f.graph.is(graph.identity());
  for (std::size_t t = 0; f.same_tables && t < plan_count_; ++t)
    f.same_tables = plans_[t].table == graph.tables()[table_order_[t]].get();
  if (!may_cut(graph)) return remember_tails();
  auto same = [](const SlotIndex& slots, const FollowedStructure::Seen& seen) {
    return std::min(seen.extent, slots.changes().same_since(seen.changes));
  };
  f.kept_cut = kept_.size();
  for (std::size_t p = 0; p < f.pool_cut.size(); ++p) {
    const SlotIndex& slots = graph.pools()[p]->slots();
    f.pool_cut[p] = same(slots, f.seen_pools[p]);
    const std::vector<Target>& targets = targets_[p];  // the build's before
    const auto first = std::find_if(targets.begin() + f.pool_cut[p], targets.end(),
                                    [](const Target& t) { return t.kind == Target::Kind::kept; });
    if (first != targets.end()) f.kept_cut = std::min(f.kept_cut, static_cast<std::size_t>(first->index));
    if (f.pool_cut[p] == slots.extent()) continue;
    const auto at = std::lower_bound(f.serials.begin(), f.serials.end(), slots.serial(f.pool_cut[p]));
    f.kept_cut = std::min(f.kept_cut, static_cast<std::size_t>(at - f.serials.begin()));
  }
  std::size_t behind = kept_.size() - f.kept_cut, all = kept_.size();
  for (std::size_t p = 0; p < f.pool_cut.size(); ++p)
    behind += graph.pools()[p]->extent() - f.pool_cut[p], all += graph.pools()[p]->extent();
  if (f.kept_cut == 0 || behind > all / kLongestTail) {
    f.kept_cut = 0;
    f.pool_cut.assign(f.pool_cut.size(), 0);
    return remember_tails();
  }
  for (std::size_t t = 0; t < plan_count_; ++t) {
    const auto& rows = plans_[t].rows;
    if (f.is_by_row[t] != 0 && !is_long_enough_for_slices(plans_[t]))  // which are sorted as a whole
      f.row_cut[t] = static_cast<std::size_t>(
          std::lower_bound(rows.begin(), rows.end(), same(plans_[t].table->slots(), f.seen_tables[t])) - rows.begin());
  }
  remember_tails();
}

// Of the build before, before it is overwritten. (The targets of rows stay where they are until they are.)
void LinearStructure::remember_tails() {
  FollowedStructure& f = followed_;
  auto keep_tail = [](auto& to, const auto& from, std::size_t cut) {
    to.assign(from.begin() + static_cast<std::ptrdiff_t>(cut), from.end());
  };
  f.kept_before = kept_.size();
  keep_tail(f.kept, kept_, f.kept_cut);
  keep_tail(f.old_serials, f.serials, f.kept_cut);
  f.old_prior_blocks.swap(f.prior_blocks);
  if (!f.same_tables) return;
  if (f.rows.size() < plan_count_) f.rows.resize(plan_count_), f.dense.resize(plan_count_);
  for (std::size_t t = 0; t < plan_count_; ++t) {
    keep_tail(f.rows[t], plans_[t].rows, f.row_cut[t]);
    keep_tail(f.dense[t], plans_[t].dense, f.row_cut[t] * static_cast<std::size_t>(plans_[t].table->arity()));
  }
}

// This build is what the next one compares with.
void LinearStructure::note_seen(const Graph& graph) {
  FollowedStructure& f = followed_;
  f.is_ready = f.is_large;
  if (!f.is_ready) return;
  auto seen = [](const SlotIndex& slots) {
    return FollowedStructure::Seen{slots.changes().count(), slots.last_serial(), slots.extent()};
  };
  f.graph = graph.identity();
  f.seen_pools.clear(), f.seen_tables.clear();
  for (const auto& pool : graph.pools()) f.seen_pools.push_back(seen(pool->slots()));
  for (std::size_t t = 0; t < plan_count_; ++t) f.seen_tables.push_back(seen(plans_[t].table->slots()));
}

VariableKey LinearStructure::key_of(const Graph& graph, const KeptBlock& b) const {
  const VariablePool& pool = *graph.pools()[b.pool];
  return {pool.ops().key, pool.slots().key(b.dense)};
}

// From the first kept block on that is another variable than before, all are. A variable of both builds that stands
// behind it would have to be found in another place: that is not followed, but an end that has ceased, and what begins
// there.
void LinearStructure::find_changed_blocks(const Graph& graph, const FactorOptions& options) {
  FollowedStructure& f = followed_;
  f.is_large = landmarks_.empty() && kept_.size() >= options.least_followed;
  if (!f.is_large) return;
  resize_with_room(f.serials, kept_.size());
  const SlotIndex* slots = nullptr;
  for (std::size_t i = f.kept_cut, pool = ~std::size_t{0}; i < kept_.size(); ++i) {
    if (kept_[i].pool != pool) pool = kept_[i].pool, slots = &graph.pools()[pool]->slots();
    f.serials[i] = slots->serial(kept_[i].dense);
  }
  note_priors();
  f.same_kept = 0;
  f.same.assign(plan_count_, 0);
  if (!f.same_tables) return;
  const auto kept = kept_.begin() + static_cast<std::ptrdiff_t>(f.kept_cut);
  const auto serials = f.serials.begin() + static_cast<std::ptrdiff_t>(f.kept_cut);
  const auto same = std::mismatch(
      kept, kept_.end(), f.kept.begin(), f.kept.end(),
      [](const KeptBlock& a, const KeptBlock& b) { return a.dim == b.dim && a.pool == b.pool && a.dense == b.dense; });
  // Places are taken again: the same one may be another variable.
  const auto same_serials =
      std::mismatch(f.old_serials.begin(), f.old_serials.begin() + (same.first - kept), serials, f.serials.end());
  f.same_kept = f.kept_cut + static_cast<std::size_t>(same_serials.first - f.old_serials.begin());
  f.same_targets =
      f.same_kept == kept_.size() || f.old_serials.empty() || f.serials[f.same_kept] > f.old_serials.back();
}

void LinearStructure::note_priors() {
  auto& blocks = followed_.prior_blocks;
  blocks.clear();
  for (std::size_t i = 0; i < prior_count_; ++i) {
    for (const Target& t : priors_[i].targets) blocks.push_back(t.kind == Target::Kind::kept ? t.index : -1);
    blocks.push_back(-2);  // the end of a prior
  }
}

void LinearStructure::look_at_all_rows(const Graph& graph) {
  followed_.row_cut.assign(plan_count_, 0);
  collect_rows(graph);
  for (std::size_t t = 0; t < plan_count_; ++t) group_rows(plans_[t]);
}

void LinearStructure::touch(int block) {
  if (std::exchange(followed_.is_changed[static_cast<std::size_t>(block)], 1) == 0) followed_.changed.push_back(block);
}

void LinearStructure::touch(const Target* targets, std::size_t arguments) {
  for (std::size_t a = 0; a < arguments; ++a)
    if (targets[a].kind == Target::Kind::kept) touch(targets[a].index);
}

// The rows of a table, and which of them, with which blocks, differ from the build before. Rows that are the same
// factors keep their targets, but at variables that came or ceased at the end (or were fixed there, or freed).
void LinearStructure::plan_followed(const Graph& graph) {
  FollowedStructure& f = followed_;
  const bool was_cut = std::any_of(f.row_cut.begin(), f.row_cut.end(), [](std::size_t cut) { return cut > 0; });
  f.was_by_row.swap(f.is_by_row);
  f.is_by_row.resize(plan_count_), f.by_row.resize(plan_count_), f.was_by_row.resize(plan_count_);
  for (std::size_t t = 0; t < plan_count_; ++t) f.is_by_row[t] = plans_[t].slices.empty() && plans_[t].runs.empty();
  if (was_cut && !f.same_targets) look_at_all_rows(graph);
  if (!f.same_targets) {
    for (std::size_t t = 0; t < plan_count_; ++t) plan_table(plans_[t], 0);
    return;
  }
  f.changed.clear();
  f.is_changed.assign(std::max(kept_.size(), f.kept_before), 0);
  for (std::size_t i = f.same_kept; i < f.is_changed.size(); ++i) touch(static_cast<int>(i));
  // What was tied to a variable that is gone is tied to another one now, even where that has its index: pattern_ is
  // still that of the build before.
  for (std::size_t i = f.same_kept; i < f.kept_before; ++i)
    for (const int j : pattern_.neighbours(static_cast<int>(i))) touch(j);
  for (std::size_t t = 0; t < plan_count_; ++t) find_changed_rows(t);
  find_elsewhere(graph);
  for (const VariableKey& id : f.elsewhere)
    for_each_row(graph, id, [&](TablePlan& plan, std::size_t r) { plan_again(graph, plan, r); });
  for (std::size_t t = 0; t < plan_count_; ++t)
    for (std::size_t r = 0; f.by_row[t] == 0 && r < f.same[t]; ++r) plan_again(graph, plans_[t], r);
  if (f.prior_blocks != f.old_prior_blocks)
    for (const auto* blocks : {&f.old_prior_blocks, &f.prior_blocks})
      for (const std::int32_t b : *blocks)
        if (b >= 0) touch(b);
  f.follows = f.changed.size() <= kept_.size() / kLargestChange;
}

// Variables of both builds behind those that stand where they stood; and what has another place in its column, fixed
// ones as well: rows before the cuts still name the old one.
void LinearStructure::find_elsewhere(const Graph& graph) {
  FollowedStructure& f = followed_;
  f.elsewhere.clear();
  auto add = [&](std::uint32_t p, std::uint32_t dense) {
    const SlotIndex& slots = graph.pools()[p]->slots();
    const bool is_known = p < f.seen_pools.size() && dense < slots.extent() && slots.is_live(dense) &&
                          slots.serial(dense) <= f.seen_pools[p].last_serial;  // else all its rows are new
    if (is_known) f.elsewhere.push_back({graph.pools()[p]->ops().key, slots.key(dense)});
  };
  for (std::size_t i = f.same_kept; i < f.kept_before; ++i) {
    const KeptBlock& b = f.kept[i - f.kept_cut];
    add(b.pool, b.dense);
  }
  for (std::size_t i = f.same_kept; i < kept_.size(); ++i) add(kept_[i].pool, kept_[i].dense);
  if (f.kept_cut == 0) return;  // nothing was cut: all rows were looked at
  for (std::uint32_t p = 0; p < f.pool_cut.size(); ++p)
    for (std::uint32_t d = f.pool_cut[p]; d < graph.pools()[p]->extent(); ++d)
      if (targets_[p][d].kind != Target::Kind::kept) add(p, d);
}

void LinearStructure::plan_again(const Graph& graph, TablePlan& plan, std::size_t r) {
  FollowedStructure& f = followed_;
  const std::size_t n = plan.arguments.size(), arity = static_cast<std::size_t>(plan.table->arity());
  f.before.assign(&plan.targets[r * n], &plan.targets[r * n] + n);
  std::uint32_t* dense = &plan.dense[r * arity];
  for (const VariableRef& ref : plan.table->variables(plan.rows[r]))
    *dense++ = graph.pools()[ref.pool]->slots().dense(ref.slot);
  plan_row(plan, r);
  if (n >= 2 && differ(f.before.data(), &plan.targets[r * n], n))
    touch(f.before.data(), n), touch(&plan.targets[r * n], n);
}

// f(plan, row) for the rows at a variable, of tables in which a row can be found.
template <class F>
void LinearStructure::for_each_row(const Graph& graph, VariableKey id, F function) {
  graph.for_each_factor(id, [&](std::uint32_t place, std::uint32_t row) {
    if (place == Graph::kPriorTable) return;
    const FactorTable* table = graph.tables()[place].get();
    for (std::size_t t = 0; t < plan_count_; ++t) {
      if (plans_[t].table != table || followed_.by_row[t] == 0) continue;
      // Rows ascend: at most so many are missing before this one.
      const std::vector<std::uint32_t>& rows = plans_[t].rows;
      const std::size_t missing = table->extent() - rows.size();
      const auto from = rows.begin() + (row < missing ? 0 : static_cast<std::ptrdiff_t>(row - missing));
      const auto to = rows.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(row, rows.size()));
      const auto at = std::lower_bound(from, to, row);
      function(plans_[t], static_cast<std::size_t>(at - rows.begin()));
    }
  });
}

// The rows of both builds by row of the table, which is by serial: what one has and the other has not, and what has
// other variables. In slices rows have another order: there, all from the first difference on.
void LinearStructure::find_changed_rows(std::size_t t) {
  FollowedStructure& f = followed_;
  TablePlan& plan = plans_[t];
  const std::size_t n = plan.arguments.size(), arity = static_cast<std::size_t>(plan.table->arity());
  const std::size_t cut = f.row_cut[t];
  const auto &old = f.rows[t], &now = plan.rows;
  auto same_from = [](const auto& tail, const auto& all, std::size_t from) {
    const auto first = all.begin() + static_cast<std::ptrdiff_t>(from);
    return static_cast<std::size_t>(std::mismatch(tail.begin(), tail.end(), first, all.end()).first - tail.begin());
  };
  const std::size_t end = cut + old.size();  // of the rows before
  std::size_t same = cut + std::min(same_from(old, now, cut), same_from(f.dense[t], plan.dense, cut * arity) / arity);
  f.by_row[t] = f.is_by_row[t] != 0 && f.was_by_row[t] != 0;
  if (f.by_row[t] != 0) {  // a new factor may have the row of one that is gone, and name places that were taken again
    const std::uint32_t first_new = plan.table->slots().first_after(f.seen_tables[t].last_serial);
    same = std::min(same, static_cast<std::size_t>(std::lower_bound(now.begin(), now.end(), first_new) - now.begin()));
  }
  f.same[t] = same;
  f.before.assign(plan.targets.begin() + static_cast<std::ptrdiff_t>(same * n),
                  plan.targets.begin() + static_cast<std::ptrdiff_t>(end * n));
  plan_table(plan, same);
  if (n < 2) return;  // they tie nothing
  std::size_t i = same, j = same;
  while (i < end || j < now.size()) {
    const bool only_before = j == now.size() || (f.by_row[t] != 0 && i < end && old[i - cut] < now[j]);
    const bool only_after = i == end || (f.by_row[t] != 0 && !only_before && now[j] < old[i - cut]);
    if (!only_before && !only_after && !differ(&f.before[(i - same) * n], &plan.targets[j * n], n)) {
      ++i, ++j;
      continue;
    }
    if (!only_after) touch(&f.before[(i++ - same) * n], n);
    if (!only_before) touch(&plan.targets[j++ * n], n);
  }
}

void LinearStructure::connect_changed(const Target& x, const Target& y) {
  const auto& is_changed = followed_.is_changed;
  if (x.kind == Target::Kind::kept && y.kind == Target::Kind::kept &&
      (is_changed[static_cast<std::size_t>(x.index)] | is_changed[static_cast<std::size_t>(y.index)]) != 0)
    pattern_.connect(x.index, y.index);
}

// Only what touches a changed block is connected again.
void LinearStructure::follow_pattern(const Graph& graph) {
  const std::size_t first = followed_.same_kept;
  dims_.clear();
  for (std::size_t i = first; i < kept_.size(); ++i) dims_.push_back(kept_[i].dim);
  pattern_.begin_change(static_cast<int>(first), dims_);
  auto connect_row = [&](const TablePlan& plan, std::size_t r) {
    const std::size_t n = plan.arguments.size();
    for (std::size_t a = 1; a < n; ++a)
      for (std::size_t b = 0; b < a; ++b) connect_changed(plan.targets[r * n + a], plan.targets[r * n + b]);
  };
  for (const int b : followed_.changed)
    if (static_cast<std::size_t>(b) < kept_.size())
      for_each_row(graph, key_of(graph, kept_[static_cast<std::size_t>(b)]), connect_row);
  for (std::size_t t = 0; t < plan_count_; ++t)
    for (std::size_t r = 0; followed_.by_row[t] == 0 && r < plans_[t].rows.size(); ++r) connect_row(plans_[t], r);
  for (std::size_t i = 0; i < prior_count_; ++i)
    for (const Target& x : priors_[i].targets)
      for (const Target& y : priors_[i].targets) connect_changed(x, y);
  pattern_.finish_change(followed_.is_changed);
}

// Of rows that are the same factors as before, those at a block whose column stands elsewhere.
void LinearStructure::place_moved_pairs(const Graph& graph) {
  auto place = [&](TablePlan& plan, std::size_t r) { place_pairs_of_row(plan, r); };
  for (std::size_t b = 0; b < kept_.size(); ++b)
    if (followed_.is_moved[b] != 0) for_each_row(graph, key_of(graph, kept_[b]), place);
  for (const VariableKey& id : followed_.elsewhere) for_each_row(graph, id, place);  // fixed ones have no place
  for (std::size_t t = 0; t < plan_count_; ++t)
    for (std::size_t r = 0; followed_.by_row[t] == 0 && r < followed_.same[t]; ++r) place(plans_[t], r);
}

void LinearStructure::mark_moved() {
  followed_.is_moved.assign(kept_.size(), 0);
  factorization_.symbolic().for_each_moved([&](int b) { followed_.is_moved[static_cast<std::size_t>(b)] = 1; });
}

}  // namespace oriel
