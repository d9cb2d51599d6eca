// The elimination order of a large graph is state (decision 20): what is gone is left out of it, what came stands
// behind the rest, and at points that the state and the graph decide it is made anew.
#include <algorithm>
#include <utility>

#include "oriel/linear/resize.h"
#include "oriel/linear/structure.h"

namespace oriel {
namespace {

// Of an order: as many variables as it was made of. What it costs by then is known by the work; where much has gone,
// that says little.
constexpr std::size_t kLargestDrift = 1;
constexpr double kMostWork = 2.0;       // times the work when the order was made
constexpr std::size_t kLateShare = 16;  // the newest sixteenth is eliminated last

}  // namespace

// order_ = the state's, without what is gone, and what came since behind it. False where it has drifted too far.
bool LinearStructure::arrange(const FactorOptions& options, const EliminationOrder& order) {
  FollowedStructure& f = followed_;
  if (order.serials.empty() || order.method != options.ordering) return false;
  if (f.follows)
    leave_out_gone();
  else
    find_places(order);
  const std::size_t gone = order.serials.size() - order_.size(), before = order_.size();
  f.drift = order.drift + gone + kept_.size() - before;
  if (f.drift > kLargestDrift * order.made_of) return false;
  if (before < kept_.size()) append_new();
  return true;
}

// Of what is the order of the build before: its variables, and their serials.
void LinearStructure::leave_out_gone() {
  FollowedStructure& f = followed_;
  std::size_t n = 0;
  for (std::size_t k = 0; k < order_.size(); ++k) {
    if (static_cast<std::size_t>(order_[k]) >= f.same_kept) continue;
    order_[n] = order_[k];
    f.order.serials[n++] = f.order.serials[k];
  }
  order_.resize(n);
  f.order.serials.resize(n);
}

void LinearStructure::find_places(const EliminationOrder& order) {
  order_.clear();
  for (const std::uint64_t serial : order.serials) {
    const auto& all = followed_.serials;
    const auto found = std::lower_bound(all.begin(), all.end(), serial);
    if (found != all.end() && *found == serial) order_.push_back(static_cast<int>(found - all.begin()));
  }
}

// What is new, by minimum degree among itself. What it shares with all that was there ties it together when that is
// eliminated: a block that stands for all of it, as heavy as these ties are.
void LinearStructure::append_new() {
  FollowedStructure& f = followed_;
  const std::size_t before = order_.size(), first = f.follows ? f.same_kept : 0;  // none that is new stands before
  f.place.assign(kept_.size() - first, 0);
  for (std::size_t k = 0; !f.follows && k < before; ++k) f.place[static_cast<std::size_t>(order_[k])] = -1;
  // Its place among what is new, -1: it is not new.
  auto place = [&](int b) {
    return static_cast<std::size_t>(b) < first ? -1 : f.place[static_cast<std::size_t>(b) - first];
  };
  dims_.clear();
  for (std::size_t b = first; b < kept_.size(); ++b) {
    if (f.place[b - first] < 0) continue;
    f.place[b - first] = static_cast<int>(order_.size() - before);
    order_.push_back(static_cast<int>(b));
    dims_.push_back(kept_[b].dim);
  }
  const int rest = static_cast<int>(dims_.size());
  const std::vector<int> fresh(order_.begin() + static_cast<std::ptrdiff_t>(before), order_.end());
  int weight = 1;
  for (const int b : fresh) {
    const auto neighbours = pattern_.neighbours(b);
    if (std::any_of(neighbours.begin(), neighbours.end(), [&](int j) { return place(j) < 0; }))
      weight += kept_[static_cast<std::size_t>(b)].dim;
  }
  dims_.push_back(weight);
  BlockPattern& tail = f.tail;
  tail.reset(dims_);
  for (int i = 0; i < rest; ++i)
    for (const int j : pattern_.neighbours(fresh[static_cast<std::size_t>(i)])) {
      const int other = place(j);
      tail.connect(i, other < 0 ? rest : other);
    }
  tail.finish();
  f.degree.order(tail, f.tail_order);
  auto to = order_.begin() + static_cast<std::ptrdiff_t>(before);
  for (const int i : f.tail_order)
    if (i != rest) *to++ = fresh[static_cast<std::size_t>(i)];
}

Result<void> LinearStructure::use_order(const FactorOptions& options) {
  FollowedStructure& f = followed_;
  FactorOptions given = options;
  given.ordering = OrderingMethod::given;
  if (!f.follows) return factorization_.analyze(pattern_, given, order_);
  if (f.changed.empty()) {  // nothing is tied in another way
    factorization_.set_relative_pivot(options.relative_pivot);
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

// The order at hand is the state from now on. Of one that follows, the serials of what was there are at hand.
void LinearStructure::note_order(EliminationOrder& order) {
  FollowedStructure& f = followed_;
  if (!f.follows) f.order.serials.clear();
  for (std::size_t k = f.order.serials.size(); k < order_.size(); ++k)
    f.order.serials.push_back(f.serials[static_cast<std::size_t>(order_[k])]);
  keep_room(f.order.serials);
  order.serials.reserve(f.order.serials.capacity());
  order.serials = f.order.serials;
  f.order.method = order.method, f.order.flops = order.flops;
  f.order.made = order.made, f.order.made_of = order.made_of, f.order.drift = order.drift;
}

}  // namespace oriel
