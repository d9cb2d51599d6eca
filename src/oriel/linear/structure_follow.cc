// A large graph changes a little all the time, and mostly at its newest end. A structure that was built before is
// followed: which rows, and thereby which kept blocks, differ; what they reach of pattern, fronts and addresses is made
// anew, the rest stands. The elimination order is state; the bits are those of a structure that is built from nothing
// with that order.
#include <algorithm>
#include <utility>

#include "oriel/linear/structure.h"

namespace oriel {
namespace {

constexpr std::size_t kLargestChange = 8;  // a structure is followed where at most an eighth of its blocks may differ
constexpr std::size_t kLargestDrift = 8;   // of an order: an eighth of its variables
constexpr double kMostWork = 2.0;          // times the work when the order was made
constexpr std::size_t kLateShare = 16;     // the newest sixteenth is eliminated last

bool differ(const Target* x, const Target* y, std::size_t n) {
  return !std::equal(x, x + n, y,
                     [](const Target& a, const Target& b) { return a.kind == b.kind && a.index == b.index; });
}

}  // namespace

// What the build before left, before it is overwritten. (The targets of rows stay where they are until they are.)
void LinearStructure::remember() {
  FollowedStructure& f = followed_;
  f.follows = f.same_targets = false;
  if (!f.is_ready) return;
  f.kept.swap(kept_);
  f.serials.swap(f.new_serials);
  f.prior_blocks.swap(f.new_prior_blocks);
  f.tables.clear();
  if (f.rows.size() < plan_count_) f.rows.resize(plan_count_), f.dense.resize(plan_count_);
  for (std::size_t t = 0; t < plan_count_; ++t) {
    f.tables.push_back(plans_[t].table);
    f.rows[t].swap(plans_[t].rows);
    f.dense[t].swap(plans_[t].dense);
  }
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
  const bool was_ready = std::exchange(f.is_ready, false);
  f.is_large = landmarks_.empty() && kept_.size() >= options.least_followed;
  if (!f.is_large) return;
  f.new_serials.resize(kept_.size());
  const SlotIndex* slots = nullptr;
  for (std::size_t i = 0, pool = ~std::size_t{0}; i < kept_.size(); ++i) {
    if (kept_[i].pool != pool) pool = kept_[i].pool, slots = &graph.pools()[pool]->slots();
    f.new_serials[i] = slots->serial(kept_[i].dense);
  }
  note_priors();
  f.same_kept = 0;
  f.same.assign(plan_count_, 0);
  if (!was_ready || f.tables.size() != plan_count_) return;
  for (std::size_t t = 0; t < plan_count_; ++t)
    if (f.tables[t] != plans_[t].table) return;
  const auto same = std::mismatch(
      kept_.begin(), kept_.end(), f.kept.begin(), f.kept.end(),
      [](const KeptBlock& a, const KeptBlock& b) { return a.dim == b.dim && a.pool == b.pool && a.dense == b.dense; });
  // Places are taken again: the same one may be another variable.
  const auto serials =
      std::mismatch(f.serials.begin(), f.serials.begin() + (same.first - kept_.begin()), f.new_serials.begin());
  f.same_kept = static_cast<std::size_t>(serials.first - f.serials.begin());
  f.same_targets = f.same_kept == kept_.size() || f.serials.empty() || f.new_serials[f.same_kept] > f.serials.back();
}

void LinearStructure::note_priors() {
  auto& blocks = followed_.new_prior_blocks;
  blocks.clear();
  for (std::size_t i = 0; i < prior_count_; ++i) {
    for (const Target& t : priors_[i].targets) blocks.push_back(t.kind == Target::Kind::kept ? t.index : -1);
    blocks.push_back(-2);  // the end of a prior
  }
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
  f.was_by_row.swap(f.is_by_row);
  f.is_by_row.resize(plan_count_), f.by_row.resize(plan_count_);
  for (std::size_t t = 0; t < plan_count_; ++t) f.is_by_row[t] = plans_[t].slices.empty() && plans_[t].runs.empty();
  if (!f.same_targets) {
    for (std::size_t t = 0; t < plan_count_; ++t) plan_table(plans_[t], 0);
    return;
  }
  f.changed.clear();
  f.is_changed.assign(std::max(kept_.size(), f.kept.size()), 0);
  for (std::size_t i = f.same_kept; i < f.is_changed.size(); ++i) touch(static_cast<int>(i));
  // What was tied to a variable that is gone is tied to another one now, even where that has its index: pattern_ is
  // still that of the build before.
  for (std::size_t i = f.same_kept; i < f.kept.size(); ++i)
    for (const int j : pattern_.neighbours(static_cast<int>(i))) touch(j);
  for (std::size_t t = 0; t < plan_count_; ++t) find_changed_rows(t);
  f.elsewhere.clear();
  for (const auto* blocks : {&f.kept, &kept_})
    for (std::size_t i = f.same_kept; i < blocks->size(); ++i)
      if (const KeptBlock& b = (*blocks)[i];
          b.dense < graph.pools()[b.pool]->extent() && graph.pools()[b.pool]->slots().is_live(b.dense))
        f.elsewhere.push_back(key_of(graph, b));
  auto plan_again = [&](TablePlan& plan, std::size_t r) {
    const std::size_t n = plan.arguments.size();
    f.before.assign(&plan.targets[r * n], &plan.targets[r * n] + n);
    plan_row(plan, r);
    if (n >= 2 && differ(f.before.data(), &plan.targets[r * n], n))
      touch(f.before.data(), n), touch(&plan.targets[r * n], n);
  };
  for (const VariableKey& id : f.elsewhere) for_each_row(graph, id, plan_again);
  for (std::size_t t = 0; t < plan_count_; ++t)
    for (std::size_t r = 0; f.by_row[t] == 0 && r < f.same[t]; ++r) plan_again(plans_[t], r);
  if (f.prior_blocks != f.new_prior_blocks)
    for (const auto* blocks : {&f.prior_blocks, &f.new_prior_blocks})
      for (const std::int32_t b : *blocks)
        if (b >= 0) touch(b);
  f.follows = f.changed.size() <= kept_.size() / kLargestChange;
}

// f(plan, row) for the rows at a variable, of tables in which a row can be found.
template <class F>
void LinearStructure::for_each_row(const Graph& graph, VariableKey id, F function) {
  graph.for_each_factor(id, [&](std::uint32_t place, std::uint32_t row) {
    if (place == Graph::kPriorTable) return;
    const FactorTable* table = graph.tables()[place].get();
    for (std::size_t t = 0; t < plan_count_; ++t) {
      if (plans_[t].table != table || followed_.by_row[t] == 0) continue;
      const auto& rows = plans_[t].rows;
      const auto at = std::lower_bound(rows.begin(), rows.end(), row);
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
  const auto &old = f.rows[t], &now = plan.rows;
  const auto rows = std::mismatch(old.begin(), old.end(), now.begin(), now.end());
  const auto dense = std::mismatch(f.dense[t].begin(), f.dense[t].end(), plan.dense.begin(), plan.dense.end());
  const std::size_t same = std::min(static_cast<std::size_t>(rows.first - old.begin()),
                                    static_cast<std::size_t>(dense.first - f.dense[t].begin()) / arity);
  f.same[t] = same;
  f.by_row[t] = f.is_by_row[t] != 0 && f.was_by_row[t] != 0;
  f.before.assign(plan.targets.begin() + static_cast<std::ptrdiff_t>(same * n),
                  plan.targets.begin() + static_cast<std::ptrdiff_t>(old.size() * n));
  plan_table(plan, same);
  if (n < 2) return;  // they tie nothing
  std::size_t i = same, j = same;
  while (i < old.size() || j < now.size()) {
    const bool only_before = j == now.size() || (f.by_row[t] != 0 && i < old.size() && old[i] < now[j]);
    const bool only_after = i == old.size() || (f.by_row[t] != 0 && !only_before && now[j] < old[i]);
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
  dims_.clear();
  for (const KeptBlock& b : kept_) dims_.push_back(b.dim);
  pattern_.begin_change(dims_);
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
  for (std::size_t t = 0; t < plan_count_; ++t)
    for (std::size_t r = 0; followed_.by_row[t] == 0 && r < followed_.same[t]; ++r) place(plans_[t], r);
}

void LinearStructure::mark_moved() {
  followed_.is_moved.assign(kept_.size(), 0);
  factorization_.symbolic().for_each_moved([&](int b) { followed_.is_moved[static_cast<std::size_t>(b)] = 1; });
}

// order_ = the state's, without what is gone, and what came since behind it. False where it has drifted too far.
bool LinearStructure::arrange(const FactorOptions& options, const EliminationOrder& order) {
  FollowedStructure& f = followed_;
  if (order.serials.empty() || order.method != options.ordering) return false;
  if (f.follows)
    std::erase_if(order_, [&](int b) { return static_cast<std::size_t>(b) >= f.same_kept; });
  else
    find_places(order);
  const std::size_t gone = order.serials.size() - order_.size(), before = order_.size();
  f.drift = order.drift + gone + kept_.size() - before;
  if (f.drift * kLargestDrift > order.made_of) return false;
  if (before < kept_.size()) append_new();
  return true;
}

void LinearStructure::find_places(const EliminationOrder& order) {
  order_.clear();
  for (const std::uint64_t serial : order.serials) {
    const auto& all = followed_.new_serials;
    const auto found = std::lower_bound(all.begin(), all.end(), serial);
    if (found != all.end() && *found == serial) order_.push_back(static_cast<int>(found - all.begin()));
  }
}

// What is new, by minimum degree among itself. What it shares with all that was there ties it together when that is
// eliminated: a block that stands for all of it, as heavy as these ties are.
void LinearStructure::append_new() {
  std::vector<int>& place = followed_.place;
  place.assign(kept_.size(), 0);
  for (const int b : order_) place[static_cast<std::size_t>(b)] = -1;
  dims_.clear();
  const std::size_t before = order_.size();
  for (std::size_t b = 0; b < kept_.size(); ++b) {
    if (place[b] < 0) continue;
    place[b] = static_cast<int>(order_.size() - before);
    order_.push_back(static_cast<int>(b));
    dims_.push_back(kept_[b].dim);
  }
  const int rest = static_cast<int>(dims_.size());
  const std::vector<int> fresh(order_.begin() + static_cast<std::ptrdiff_t>(before), order_.end());
  int weight = 1;
  for (const int b : fresh) {
    const auto neighbours = pattern_.neighbours(b);
    if (std::any_of(neighbours.begin(), neighbours.end(),
                    [&](int j) { return place[static_cast<std::size_t>(j)] < 0; }))
      weight += kept_[static_cast<std::size_t>(b)].dim;
  }
  dims_.push_back(weight);
  BlockPattern& tail = followed_.tail;
  tail.reset(dims_);
  for (int i = 0; i < rest; ++i)
    for (const int j : pattern_.neighbours(fresh[static_cast<std::size_t>(i)])) {
      const int other = place[static_cast<std::size_t>(j)];
      tail.connect(i, other < 0 ? rest : other);
    }
  tail.finish();
  followed_.degree.order(tail, followed_.tail_order);
  auto to = order_.begin() + static_cast<std::ptrdiff_t>(before);
  for (const int i : followed_.tail_order)
    if (i != rest) *to++ = fresh[static_cast<std::size_t>(i)];
}

Result<void> LinearStructure::use_order(const FactorOptions& options) {
  FollowedStructure& f = followed_;
  FactorOptions given = options;
  given.ordering = OrderingMethod::given;
  if (!f.follows) return factorization_.analyze(pattern_, given, order_);
  if (f.changed.empty()) {  // nothing is tied in another way
    f.is_moved.assign(kept_.size(), 0);
    return {};
  }
  const std::int64_t updates = factorization_.updates();
  factorization_.follow(pattern_, options, order_, f.changed);
  if (factorization_.updates() == updates)
    f.follows = false;
  else
    mark_moved();
  return {};
}

Result<void> LinearStructure::analyze_large(const Graph& graph, const FactorOptions& options, EliminationOrder& order) {
  FollowedStructure& f = followed_;
  is_large_ = false, forms_reduced_ = true;
  small_table_.clear();
  f.follows = f.follows && f.order == order;
  if (!f.follows)
    find_pattern();
  else if (!f.changed.empty())
    follow_pattern(graph);
  if (arrange(options, order)) {
    if (auto ok = use_order(options); !ok) return ok;
    if (factorization_.symbolic().flops() <= kMostWork * order.flops) {
      order.drift = f.drift;
      note_order(order);
      return {};
    }
  }
  f.follows = false;
  FactorOptions anew = options;
  anew.first_late = static_cast<int>(kept_.size() - kept_.size() / kLateShare);
  if (auto ok = factorization_.analyze(pattern_, anew); !ok) return ok;
  const auto found = factorization_.symbolic().order();
  order_.assign(found.begin(), found.end());
  order.method = options.ordering;
  order.flops = factorization_.symbolic().flops();
  order.made_of = order_.size(), order.drift = 0;
  ++order.made;
  note_order(order);
  return {};
}

// The order at hand is the state from now on.
void LinearStructure::note_order(EliminationOrder& order) {
  const bool same = followed_.follows && followed_.changed.empty();
  if (!same) {
    order.serials.resize(order_.size());
    for (std::size_t k = 0; k < order_.size(); ++k)
      order.serials[k] = followed_.new_serials[static_cast<std::size_t>(order_[k])];
  }
  followed_.order = order;
}

}  // namespace oriel
