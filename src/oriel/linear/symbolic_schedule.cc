// The third part of the symbolic analysis: in which sequence fronts are factored, which subtrees of them beside each
// other, and where their update matrices stand meanwhile. Sums over a subtree stay with its root: what an update leaves
// as it was is not looked at again.
#include <algorithm>
#include <iterator>
#include <utility>

#include "oriel/linear/resize.h"
#include "oriel/linear/symbolic.h"

namespace oriel {
namespace {

// Subtrees are cut at this share of all flops, and only where there is enough work to be worth a task. Functions of
// the structure, never of the number of threads.
constexpr double kLargestTask = 1.0 / 12, kSmallestTask = 1.0 / 512;
constexpr double kWorthTasks = 4e6;  // [flop]

// Flops of p steps of Cholesky on n rows, lower triangle: Σ (n - j)², multiplications and additions.
double front_flops(const Front& f) {
  const double n = f.n, m = f.n - f.p;
  return (n * (n + 1) * (2 * n + 1) - m * (m + 1) * (2 * m + 1)) / 6.0;
}

std::int64_t update_size(const Front& f) { return static_cast<std::int64_t>(f.update_ld) * (f.n - f.p); }

}  // namespace

// Whole numbers below 2^53, or halves of them: the sums are exact in any order, and what was added can be taken away.
void Symbolic::add_up(const Front& f, double sign) {
  flops_ += sign * front_flops(f);
  fill_ += sign * (0.5 * f.p * (f.p + 1.0) + static_cast<double>(f.p) * (f.n - f.p));
  live_factor_ += static_cast<std::int64_t>(sign) * f.ld * f.p;
}

void Symbolic::sum_up() {
  flops_ = 0, fill_ = 0, live_factor_ = 0, largest_front_ = 0;
  for (const Front& f : fronts_) {
    add_up(f, 1.0);
    largest_front_ = std::max(largest_front_, f.n);
  }
}

// Without the marked fronts, and with those from `first` on.
void Symbolic::sum_up_few(std::size_t first) {
  const auto is_largest = [this](int i) { return fronts_[i].n == largest_front_; };
  const bool all = std::any_of(marked_.begin(), marked_.end(), is_largest);
  for (const int i : marked_) add_up(fronts_[i], -1.0);
  for (std::size_t i = first; i < fronts_.size(); ++i) add_up(fronts_[i], 1.0);
  if (all) largest_front_ = 0;
  for (std::size_t i = all ? 0 : first; i < fronts_.size(); ++i)
    if (fronts_[i].live) largest_front_ = std::max(largest_front_, fronts_[i].n);
}

// Fronts before `first` stand, with all below them, in the order in which they stood.
void Symbolic::make_sequence(std::size_t first) {
  sum_subtrees(first);
  old_sequence_.swap(sequence_);
  stack_.assign(roots_.begin(), roots_.end());
  sequence_.clear();
  while (!stack_.empty()) {  // a preorder, which backwards is a postorder
    const int i = stack_.back();
    stack_.pop_back();
    if (static_cast<std::size_t>(i) < first) {
      const auto end = old_sequence_.begin() + place_[i] + 1;
      sequence_.insert(sequence_.end(), std::make_reverse_iterator(end),
                       std::make_reverse_iterator(end - subtree_size_[i]));
      continue;
    }
    sequence_.push_back(i);
    const auto children = this->children(i);
    stack_.insert(stack_.end(), children.begin(), children.end());
  }
  std::reverse(sequence_.begin(), sequence_.end());
}

// Fronts of a subtree, and their flops; children come before their parents.
void Symbolic::sum_subtrees(std::size_t first) {
  resize_with_room(subtree_flops_, fronts_.size()), resize_with_room(subtree_size_, fronts_.size());
  for (std::size_t i = first; i < fronts_.size(); ++i) {
    subtree_flops_[i] = front_flops(fronts_[i]);
    subtree_size_[i] = 1;
    for (const int child : children(static_cast<int>(i))) {
      subtree_flops_[i] += subtree_flops_[child];
      subtree_size_[i] += subtree_size_[child];
    }
  }
}

// Fronts before `first`, their subtrees and the places of their update matrices are those of the schedule before.
void Symbolic::make_schedule(std::size_t first) {
  make_sequence(first);
  old_subtrees_.swap(subtrees_);
  find_subtrees();
  // Roots that were, and are no more: what is below them is in no subtree, or in another one.
  is_cut_.assign(fronts_.size(), 0);
  for (const Subtree& tree : subtrees_) is_cut_[sequence_[tree.last]] = 1;
  for (const Subtree& tree : old_subtrees_) {
    const int root = old_sequence_[tree.last];
    if (static_cast<std::size_t>(root) >= first) continue;  // all is new
    if (is_cut_[root] != 0 && fronts_[root].live) {
      is_cut_[root] = 2;  // stays
      continue;
    }
    for (int k = tree.first; k <= tree.last; ++k) fronts_[old_sequence_[k]].task = -1;
  }
  resize_with_room(place_, fronts_.size());
  for (std::size_t k = 0; k < sequence_.size(); ++k) place_[sequence_[k]] = static_cast<int>(k);
  place_updates();
}

// The largest subtrees of little enough work; those of hardly any are left to the top.
void Symbolic::find_subtrees() {
  subtrees_.clear();
  if (flops_ < kWorthTasks) return;
  // From the last to the first: a front's subtree ends with it.
  for (int k = static_cast<int>(sequence_.size()) - 1; k >= 0;) {
    const int i = sequence_[k];
    if (subtree_flops_[i] > kLargestTask * flops_) {
      --k;
      continue;
    }
    if (subtree_flops_[i] >= kSmallestTask * flops_) subtrees_.push_back({k - subtree_size_[i] + 1, k});
    k -= subtree_size_[i];
  }
  std::sort(subtrees_.begin(), subtrees_.end(), [&](const Subtree& a, const Subtree& b) {
    const double x = subtree_flops_[sequence_[a.last]], y = subtree_flops_[sequence_[b.last]];
    return x != y ? x > y : a.first < b.first;
  });
}

// f(front) for those in no subtree, by the sequence.
template <class F>
void Symbolic::for_each_of_top(F f) {
  std::vector<std::pair<int, int>>& ranges = subtree_ranges_;
  ranges.clear();
  for (const Subtree& tree : subtrees_) ranges.emplace_back(tree.first, tree.last);
  std::sort(ranges.begin(), ranges.end());
  ranges.emplace_back(static_cast<int>(sequence_.size()), 0);
  int k = 0;
  for (const auto& [first, last] : ranges) {
    for (; k < first; ++k) f(sequence_[k]);
    k = last + 1;
  }
}

// An update matrix lives from its front until its parent has taken it. In a postorder that is a stack; with fronts of
// even and odd depth on a stack each, a front's own matrix never lies upon those of its children, and all places are
// known beforehand. The root of a subtree outlives its task: it has a place in the shared arena.
void Symbolic::place_updates() {
  task_arena_size_ = 0;
  subtree_part_size_ = 0;
  resize_with_room(arena_size_, fronts_.size()), resize_with_room(depth_, fronts_.size());
  for (Subtree& tree : subtrees_) {
    const int i = sequence_[tree.last];
    if (is_cut_[i] == 1) {
      for (const int member : fronts_of(tree)) fronts_[member].task = i;
      depth_[i] = 0;
      arena_size_[i] = place_updates(tree.first, tree.last - 1);
    }
    task_arena_size_ = std::max(task_arena_size_, arena_size_[i]);
    tree.part = subtree_part_size_;
    subtree_part_size_ += fronts_[i].n - fronts_[i].p;
  }
  if (subtrees_.empty())
    shared_arena_size_ = place_updates(0, static_cast<int>(sequence_.size()) - 1);
  else
    place_shared_updates();
}

// Of the fronts at [first, last] of the sequence, whose parents are among them, the one behind, or nowhere; returns
// their end.
std::int64_t Symbolic::place_updates(int first, int last) {
  for (int k = last; k >= first; --k) {
    const int i = sequence_[k];
    depth_[i] = fronts_[i].parent < 0 ? 0 : depth_[fronts_[i].parent] + 1;
  }
  std::int64_t top[2] = {0, 0}, high[2] = {0, 0};
  for (int k = first; k <= last; ++k) {
    const int i = sequence_[k];
    Front& f = fronts_[i];
    const int parity = depth_[i] & 1;
    f.update_offset = top[parity];
    top[parity] += update_size(f);
    high[parity] = std::max(high[parity], top[parity]);
    for (const int child : children(i)) top[1 - parity] -= update_size(fronts_[child]);
  }
  for (int k = first; k <= last; ++k)
    if ((depth_[sequence_[k]] & 1) != 0) fronts_[sequence_[k]].update_offset += high[0];
  return high[0] + high[1];
}

// Of the roots of subtrees, which are there before the top of the tree begins, and of the top: the first gap that is
// wide enough, where a stack would keep the places of roots that were taken long ago.
void Symbolic::place_shared_updates() {
  std::vector<Gap>& gaps = gaps_;  // ascending, none next to another; the top has some ten fronts
  gaps.clear();
  shared_arena_size_ = 0;
  for (const Subtree& tree : subtrees_) {
    Front& root = fronts_[sequence_[tree.last]];
    root.update_offset = shared_arena_size_;
    shared_arena_size_ += update_size(root);
  }
  auto take = [&](std::int64_t size) {
    for (Gap& g : gaps)
      if (g.end - g.begin >= size) return std::exchange(g.begin, g.begin + size);
    if (!gaps.empty() && gaps.back().end == shared_arena_size_) {  // the last gap, and more
      const std::int64_t begin = gaps.back().begin;
      gaps.pop_back();
      shared_arena_size_ = begin + size;
      return begin;
    }
    return std::exchange(shared_arena_size_, shared_arena_size_ + size);
  };
  auto give = [&](Gap gap) {
    auto next = std::find_if(gaps.begin(), gaps.end(), [&](const Gap& g) { return g.begin >= gap.end; });
    if (next != gaps.end() && next->begin == gap.end) gap.end = next->end, next = gaps.erase(next);
    if (next != gaps.begin() && std::prev(next)->end == gap.begin)
      std::prev(next)->end = gap.end;
    else
      gaps.insert(next, gap);
  };
  for_each_of_top([&](int i) {
    fronts_[i].update_offset = take(update_size(fronts_[i]));
    for (const int child : children(i))
      give({fronts_[child].update_offset, fronts_[child].update_offset + update_size(fronts_[child])});
  });
}

}  // namespace oriel
