// Large tables are cut into slices, which may be linearized beside each other, with the same bits by any number of
// threads. Rows are sorted by the landmark that they see, else by the last of their variables. A landmark is of one
// slice alone; of a block of H to which several slices have to add, each has a partial sum of its own, behind H in the
// same buffer, and these are added in the order of slices. Slices depend on the graph alone, and one thread goes
// through them, too.
#include <algorithm>

#include "oriel/linear/structure.h"
#include "oriel/residual/batch.h"

namespace oriel {
namespace {

constexpr std::size_t kRows = Batch::kRows;
constexpr std::size_t kLeastSlice = 512, kMostSlices = 12;  // rows of a slice, slices of a table
// Numbers in the Jacobians of a table, and of a row: below, sorting costs one thread more than it gains two (by 10 % on
// city10000, whose rows of 18 numbers are little work; sphere2500 has 356 000 numbers in rows of 72).
constexpr std::size_t kLeastNumbers = 250'000, kLeastOfRow = 20;

constexpr std::size_t round_up(std::size_t n, std::size_t to) { return (n + to - 1) / to * to; }

}  // namespace

void SharedBlocks::reset(std::size_t variables, std::size_t most) {
  std::size_t size = 64;
  while (size < 2 * most) size *= 2;
  entries_.assign(size, {});
  diagonal_.assign(variables, {});
}

SharedBlocks::Entry& SharedBlocks::find(std::int64_t block) {
  const std::size_t mask = entries_.size() - 1;
  std::size_t at = static_cast<std::size_t>(static_cast<std::uint64_t>(block) * 0x9E3779B97F4A7C15u >> 32) & mask;
  while (entries_[at].block >= 0 && entries_[at].block != block) at = (at + 1) & mask;
  entries_[at].block = block;
  return entries_[at];
}

bool LinearStructure::is_long_enough_for_slices(const TablePlan& plan) {
  const std::size_t rows = plan.table->slots().size();
  std::size_t columns = 0;
  for (const TablePlan::Argument& x : plan.arguments) columns += static_cast<std::size_t>(x.dim);
  const std::size_t of_row = columns * static_cast<std::size_t>(plan.table->ops().dim);
  return of_row >= kLeastOfRow && of_row * rows >= kLeastNumbers && rows >= 2 * kLeastSlice;
}

void LinearStructure::slice_rows(TablePlan& plan) {
  if (is_long_enough_for_slices(plan) && sort_rows(plan)) cut_rows(plan);
}

// Keys and places in sorted order: landmarks first. False if a row names a variable twice: the product of its two
// columns goes into a diagonal block in a way that a partial sum has no place for.
bool LinearStructure::sort_rows(const TablePlan& plan) {
  const std::size_t n = plan.rows.size(), arity = static_cast<std::size_t>(plan.table->arity());
  const auto landmarks = static_cast<std::uint32_t>(landmarks_.size());
  run_key_.resize(n);
  run_begin_.assign(landmarks_.size() + kept_.size() + 2, 0);
  for (std::size_t r = 0; r < n; ++r) {
    std::uint32_t key = landmarks, last = 0;
    for (std::size_t a = 0; a < plan.arguments.size(); ++a) {
      const TablePlan::Argument& x = plan.arguments[a];
      const Target& t = targets_[x.pool][plan.dense[r * arity + static_cast<std::size_t>(x.arg)]];
      if (t.kind == Target::Kind::landmark) key = static_cast<std::uint32_t>(t.index);
      if (t.kind == Target::Kind::kept) last = std::max(last, static_cast<std::uint32_t>(t.index) + 1);
      for (std::size_t b = 0; b < a && t.kind == Target::Kind::kept; ++b) {
        const TablePlan::Argument& y = plan.arguments[b];
        if (x.pool == y.pool && plan.dense[r * arity + static_cast<std::size_t>(x.arg)] ==
                                    plan.dense[r * arity + static_cast<std::size_t>(y.arg)])
          return false;
      }
    }
    run_key_[r] = key < landmarks ? key : landmarks + last;
    ++run_begin_[run_key_[r] + 1];
  }
  for (std::size_t k = 1; k < run_begin_.size(); ++k) run_begin_[k] += run_begin_[k - 1];
  sorted_.resize(n);
  for (std::size_t r = 0; r < n; ++r) sorted_[run_begin_[run_key_[r]]++] = static_cast<std::uint32_t>(r);
  return true;
}

// A slice begins with a batch. Where the one before it ends within a batch, repetitions of its last row, which do not
// count and are not evaluated, fill that up.
void LinearStructure::cut_rows(TablePlan& plan) {
  const std::size_t n = plan.rows.size(), arity = static_cast<std::size_t>(plan.table->arity());
  const std::size_t count = std::min(kMostSlices, n / kLeastSlice);
  grouped_rows_.clear();
  grouped_dense_.clear();
  plan.active.clear();
  auto put = [&](std::size_t r) {
    grouped_rows_.push_back(plan.rows[r]);
    grouped_dense_.insert(grouped_dense_.end(), plan.dense.begin() + static_cast<std::ptrdiff_t>(r * arity),
                          plan.dense.begin() + static_cast<std::ptrdiff_t>((r + 1) * arity));
  };
  std::size_t begin = 0;
  for (std::size_t k = 0; k < count && begin < n; ++k) {
    std::size_t end = k + 1 == count ? n : std::max(begin, std::min(n, round_up(n * (k + 1) / count, kRows)));
    while (end > begin && end < n && run_key_[sorted_[end]] < landmarks_.size() &&
           run_key_[sorted_[end]] == run_key_[sorted_[end - 1]])
      ++end;
    if (end == begin) continue;
    TablePlan::Slice slice;
    slice.first = static_cast<std::uint32_t>(plan.active.size());
    for (std::size_t i = begin; i < end; i += kRows) {
      const std::size_t rows = std::min(kRows, end - i);
      for (std::size_t l = 0; l < rows; ++l) put(sorted_[i + l]);
      plan.active.push_back(rows == kRows ? ~std::uint64_t{0} : (std::uint64_t{1} << rows) - 1);
      for (std::size_t l = rows; l < kRows && end < n; ++l) put(sorted_[end - 1]);
    }
    slice.last = static_cast<std::uint32_t>(plan.active.size());
    plan.slices.push_back(slice);
    begin = end;
  }
  plan.rows.swap(grouped_rows_);
  plan.dense.swap(grouped_dense_);
}

// Once it is known where everything stands.
void LinearStructure::place_slices() {
  hessian_size_ = static_cast<std::int64_t>(round_up(static_cast<std::size_t>(factorization_.storage_size()), 8));
  slices_clear_landmarks_ = false;
  bool first = true;  // to say anything of landmarks
  for (std::size_t t = 0; t < plan_count_; ++t) {
    TablePlan& plan = plans_[t];
    const bool sees_landmarks =
        !landmarks_.empty() && std::any_of(plan.landmark.begin(), plan.landmark.end(), [](auto l) { return l >= 0; });
    if (!plan.slices.empty()) {
      if (first && sees_landmarks) clear_by_slices(plan);
      find_shared(plan);
      place_partials(plan);
    }
    first = first && !sees_landmarks;
  }
}

// From the first landmark of each slice to that of the next.
void LinearStructure::clear_by_slices(TablePlan& plan) {
  slices_clear_landmarks_ = true;
  std::int64_t end = landmark_store_;
  for (std::size_t k = plan.slices.size(); k-- > 0;) {
    TablePlan::Slice& slice = plan.slices[k];
    const std::int32_t landmark = plan.landmark[slice.first * kRows];
    slice.clear_end = end;
    slice.clear_begin = k == 0 ? 0 : landmark >= 0 ? landmarks_[static_cast<std::size_t>(landmark)].data : end;
    end = slice.clear_begin;
  }
}

// Rows of two kept variables are sorted by the later one: what ties it to another is said by one slice alone, but for
// the variables whose rows a cut parts. Where rows may be otherwise, none are listed.
void LinearStructure::find_split_keys(const TablePlan& plan) {
  split_keys_.clear();
  const std::size_t n = plan.arguments.size();
  if (n > 2 || !landmarks_.empty()) return;
  auto last_of = [&](std::size_t row) {
    std::int32_t last = -1;
    for (std::size_t a = 0; a < n; ++a)
      if (const Target& t = plan.targets[row * n + a]; t.kind == Target::Kind::kept) last = std::max(last, t.index);
    return last;
  };
  for (const TablePlan::Slice& slice : plan.slices) {
    const std::size_t first = slice.first * kRows, end = std::min(plan.rows.size(), slice.last * kRows);
    split_keys_.emplace_back(first == 0 ? -1 : last_of(first), end == plan.rows.size() ? -1 : last_of(end - 1));
  }
}

// Null: nothing, or what no other slice says anything of.
SharedBlocks::Entry* LinearStructure::shared_entry(const TablePlan& plan, std::size_t row, std::size_t pair,
                                                   std::size_t slice) {
  const std::size_t n = plan.arguments.size();
  const PairAddress& at = plan.pairs[row * (n * (n + 1) / 2) + pair];
  if (at.kind == PairAddress::Kind::none) return nullptr;
  if (n == 2 && !split_keys_.empty()) {
    const Target &x = plan.targets[row * 2], &y = plan.targets[row * 2 + 1];
    if (pair != 1) return &shared_.diagonal(pair == 0 ? x.index : y.index);
    const std::int32_t last = std::max(x.index, y.index);
    const auto [before, next] = split_keys_[slice];
    return last == before || last == next ? &shared_.find(at.offset) : nullptr;
  }
  for (std::size_t a = 0; a < n; ++a)
    if (pair == a * (a + 1) / 2 + a) return &shared_.diagonal(plan.targets[row * n + a].index);
  return &shared_.find(at.offset);
}

void LinearStructure::find_shared(const TablePlan& plan) {
  const std::size_t n = plan.arguments.size(), pairs = n * (n + 1) / 2;
  find_split_keys(plan);
  std::size_t most = 0;  // blocks off the diagonal
  for (std::size_t k = 0; k < plan.slices.size(); ++k) {
    const std::size_t end = std::min(plan.rows.size(), plan.slices[k].last * kRows);
    for (std::size_t r = plan.slices[k].first * kRows; r < end; ++r) {
      if (split_keys_.empty()) {
        most += pairs - n;
        continue;
      }
      const std::int32_t last = std::max(plan.targets[r * n].index, plan.targets[r * n + n - 1].index);
      most += last == split_keys_[k].first || last == split_keys_[k].second;
    }
  }
  shared_.reset(kept_.size(), most);
  for (std::size_t k = 0; k < plan.slices.size(); ++k) {
    const std::size_t end = std::min(plan.rows.size(), plan.slices[k].last * kRows);
    for (std::size_t r = plan.slices[k].first * kRows; r < end; ++r)
      for (std::size_t i = 0; i < pairs; ++i) {
        SharedBlocks::Entry* e = shared_entry(plan, r, i, k);
        if (e == nullptr) continue;
        e->shared = e->shared || (e->slice >= 0 && e->slice != static_cast<std::int32_t>(k));
        e->slice = static_cast<std::int32_t>(k);
      }
  }
}

void LinearStructure::place_partials(TablePlan& plan) {
  for (std::size_t k = 0; k < plan.slices.size(); ++k) {
    TablePlan::Slice& slice = plan.slices[k];
    slice.partial_begin = hessian_size_;
    for (std::size_t r = slice.first * kRows; r < std::min(plan.rows.size(), slice.last * kRows); ++r)
      place_partials_of_row(plan, r, static_cast<int>(k));
    slice.partial_end = hessian_size_;
  }
}

void LinearStructure::place_partials_of_row(TablePlan& plan, std::size_t row, int slice) {
  const std::size_t n = plan.arguments.size();
  PairAddress* pair = &plan.pairs[row * (n * (n + 1) / 2)];
  for (std::size_t a = 0; a < n; ++a)
    for (std::size_t b = 0; b <= a; ++b, ++pair) {
      SharedBlocks::Entry* const found = shared_entry(plan, row, a * (a + 1) / 2 + b, static_cast<std::size_t>(slice));
      if (found == nullptr || !found->shared) continue;
      SharedBlocks::Entry& e = *found;
      const int x = plan.arguments[a].dim, y = plan.arguments[b].dim;
      const bool turned = pair->kind == PairAddress::Kind::transposed;
      const std::int32_t rows = turned ? y : x, columns = turned ? x : y;
      if (e.partial_slice != slice) {
        e.partial_slice = slice;
        e.partial = hessian_size_;
        plan.partials.push_back(
            {e.partial, pair->offset, pair->ld, rows, columns, a == b ? plan.targets[row * n + a].offset : -1});
        hessian_size_ += static_cast<std::int64_t>(
            round_up(static_cast<std::size_t>(a == b ? packed_half(rows) + rows : rows * columns), 8));
      }
      *pair = {e.partial, rows, a == b ? PairAddress::Kind::packed : pair->kind};
    }
}

}  // namespace oriel
