#include "oriel/linear/block_pattern.h"

namespace oriel {

void BlockPattern::reset(std::span<const int> dims) {
  dims_.assign(dims.begin(), dims.end());
  offsets_.resize(dims.size() + 1);
  offsets_[0] = 0;
  for (std::size_t i = 0; i < dims.size(); ++i) offsets_[i + 1] = offsets_[i] + dims[i];
  pairs_.clear();
  neighbours_.clear();
  begin_.assign(dims.size() + 1, 0);
}

void BlockPattern::connect(int i, int j) {
  if (i != j) pairs_.emplace_back(i, j);
}

void BlockPattern::connect_all(std::span<const int> blocks) {
  for (std::size_t a = 0; a < blocks.size(); ++a)
    for (std::size_t b = a + 1; b < blocks.size(); ++b) connect(blocks[a], blocks[b]);
}

// With as much room as the other has: it asks for memory no more often than that one.
void BlockPattern::remember(const BlockPattern& other) {
  auto copy = [](std::vector<int>& to, const std::vector<int>& from) {
    to.reserve(from.capacity());
    to = from;
  };
  copy(dims_, other.dims_);
  copy(begin_, other.begin_);
  copy(neighbours_, other.neighbours_);
}

// Two counting sorts, by one end and then, stably, by the other, leave every list ascending; equal neighbours stand
// side by side and fall out in the second.
void BlockPattern::finish() {
  bucket_by_second();
  bucket_by_first();
}

void BlockPattern::bucket_by_second() {
  bucket_begin_.assign(dims_.size() + 1, 0);
  for (auto [i, j] : pairs_) ++bucket_begin_[i], ++bucket_begin_[j];
  int total = 0;
  for (int& b : bucket_begin_) {
    const int count = b;
    b = total;
    total += count;
  }
  bucketed_.resize(total);
  begin_.assign(bucket_begin_.begin(), bucket_begin_.end());
  for (auto [i, j] : pairs_) {
    bucketed_[begin_[j]++] = i;
    bucketed_[begin_[i]++] = j;
  }
}

void BlockPattern::bucket_by_first() {
  const int n = blocks();
  last_seen_.assign(n, -1);
  begin_.assign(n + 1, 0);
  for (int j = 0; j < n; ++j)
    for (int k = bucket_begin_[j]; k < bucket_begin_[j + 1]; ++k) {
      int& i = bucketed_[k];
      if (last_seen_[i] == j)
        i = -1;
      else
        last_seen_[i] = j, ++begin_[i + 1];
    }
  for (int i = 0; i < n; ++i) begin_[i + 1] += begin_[i];
  neighbours_.resize(begin_[n]);
  last_seen_.assign(begin_.begin(), begin_.begin() + n);
  for (int j = 0; j < n; ++j)
    for (int k = bucket_begin_[j]; k < bucket_begin_[j + 1]; ++k)
      if (const int i = bucketed_[k]; i >= 0) neighbours_[last_seen_[i]++] = j;
}

}  // namespace oriel
