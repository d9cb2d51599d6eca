// Rows that name the same kept variables are put side by side, in runs that begin at multiples of eight lanes: their
// products with each other then go to the same blocks and are summed in registers before they are added once
// (accumulate_runs.cc). A function of the live graph alone: rows keep the order of serials within a run.
#include <algorithm>
#include <bit>
#include <cstring>

#include "oriel/base/pack.h"
#include "oriel/linear/kernel_dims.h"
#include "oriel/linear/structure.h"

namespace oriel {
namespace {

constexpr std::size_t kMostRows = 16384;  // larger tables keep their order, which their landmarks' memory follows
constexpr std::size_t kMostKept = 96;     // kept blocks up to which pairs of them are counted in a table
constexpr std::size_t kLeastMeanRun = 4;  // rows; shorter runs would be mostly padding

// That of an argument of a row, before plan_table has filled them in.
const Target& target_of(const LinearStructure& structure, const TablePlan& plan, std::size_t row,
                        std::size_t argument) {
  const TablePlan::Argument& a = plan.arguments[argument];
  const auto arity = static_cast<std::size_t>(plan.table->arity());
  return structure.target(a.pool, plan.dense[row * arity + static_cast<std::size_t>(a.arg)]);
}

}  // namespace

void LinearStructure::set_active(TablePlan& plan) {
  plan.runs.clear();
  plan.slices.clear();
  plan.partials.clear();
  plan.active.assign((plan.rows.size() + 63) / 64, ~std::uint64_t{0});
  if (plan.rows.size() % 64 != 0) plan.active.back() = (std::uint64_t{1} << plan.rows.size() % 64) - 1;
}

// A landmark that is kept is like any other variable.
int LinearStructure::find_landmark_argument(const TablePlan& plan) const {
  const std::size_t n = plan.arguments.size();
  int found = -1;
  if (n > kMostLandmarkArguments) return -1;
  for (std::size_t a = 0; a < n; ++a) {
    if (plan.arguments[a].dim > kLargestKernelDim) return -1;
    if (!plan.arguments[a].landmark_type) continue;
    if (found >= 0) return -1;
    found = static_cast<int>(a);
    for (std::size_t r = 0; r < plan.rows.size(); ++r)
      if (target_of(*this, plan, r, a).kind == Target::Kind::kept) return -1;
  }
  return found;
}

bool LinearStructure::count_runs(const TablePlan& plan) {
  const std::size_t n = plan.arguments.size(), others = n - 1;
  if (plan.landmark_argument < 0 || others > 2) return false;
  if (plan.rows.size() > kMostRows || kept_.size() > kMostKept) return false;
  const std::size_t base = kept_.size() + 1;
  run_key_.resize(plan.rows.size());
  run_begin_.assign((others == 2 ? base * base : others == 1 ? base : 1) + 1, 0);
  for (std::size_t r = 0; r < plan.rows.size(); ++r) {
    std::size_t key = 0;
    for (std::size_t a = 0; a < n; ++a) {
      if (plan.arguments[a].landmark_type) continue;
      const Target& t = target_of(*this, plan, r, a);
      key = key * base + (t.kind == Target::Kind::kept ? static_cast<std::size_t>(t.index) + 1 : 0);
    }
    run_key_[r] = static_cast<std::uint32_t>(key);
    ++run_begin_[key];
  }
  const auto used = run_begin_.size() - static_cast<std::size_t>(std::count(run_begin_.begin(), run_begin_.end(), 0u));
  return plan.rows.size() >= kLeastMeanRun * used;
}

void LinearStructure::group_rows(TablePlan& plan) {
  set_active(plan);
  plan.landmark_argument = find_landmark_argument(plan);
  if (!count_runs(plan)) return slice_rows(plan);
  constexpr std::uint32_t kLanes = Pack::kLanes;
  std::uint32_t end = 0;
  for (std::uint32_t& begin : run_begin_) {  // counts become first places
    const std::uint32_t count = begin, padded = (count + kLanes - 1) / kLanes * kLanes;
    if (count > 0) add_runs(plan, end, padded);
    begin = end;
    end += padded;
  }
  const std::size_t arity = static_cast<std::size_t>(plan.table->arity());
  grouped_rows_.resize(end);
  grouped_dense_.resize(end * arity);
  plan.active.assign((end + 63) / 64, 0);
  auto put = [&](std::uint32_t at, std::size_t r) {
    grouped_rows_[at] = plan.rows[r];
    std::size_t k = 0;  // a call to copy so few would take longer than the copies
    for (; k + 2 <= arity; k += 2) std::memcpy(&grouped_dense_[at * arity + k], &plan.dense[r * arity + k], 8);
    if (k < arity) grouped_dense_[at * arity + k] = plan.dense[r * arity + k];
  };
  for (std::size_t r = 0; r < plan.rows.size(); ++r) {
    const std::uint32_t at = run_begin_[run_key_[r]]++;
    put(at, r);
    plan.active[at / 64] |= std::uint64_t{1} << at % 64;
    // The rest of the eight repeats this row, inactive, until another takes the place.
    for (std::uint32_t pad = at + 1; pad % kLanes != 0; ++pad) put(pad, r);
  }
  plan.rows.swap(grouped_rows_);
  plan.dense.swap(grouped_dense_);
}

// A run ends at a batch's end and goes on in the next.
void LinearStructure::add_runs(TablePlan& plan, std::uint32_t first, std::uint32_t count) {
  while (count > 0) {
    const std::uint32_t here = std::min(count, 64 - first % 64);
    plan.runs.push_back({first, here});
    first += here;
    count -= here;
  }
}

}  // namespace oriel
