#include "oriel/linear/block_pattern.h"

#include <algorithm>

#include "oriel/linear/resize.h"

namespace oriel {

void BlockPattern::reset(std::span<const int> dims) {
  resize_with_room(dims_, dims.size());
  std::copy(dims.begin(), dims.end(), dims_.begin());
  resize_with_room(offsets_, dims.size() + 1);
  offsets_[0] = 0;
  for (std::size_t i = 0; i < dims.size(); ++i) offsets_[i + 1] = offsets_[i] + dims[i];
  pairs_.clear();
  neighbours_.clear();
  resize_with_room(begin_, dims.size() + 1);
  std::fill(begin_.begin(), begin_.end(), 0);
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
  resize_with_room(neighbours_, static_cast<std::size_t>(begin_[n]));
  last_seen_.assign(begin_.begin(), begin_.begin() + n);
  for (int j = 0; j < n; ++j)
    for (int k = bucket_begin_[j]; k < bucket_begin_[j + 1]; ++k)
      if (const int i = bucketed_[k]; i >= 0) neighbours_[last_seen_[i]++] = j;
}

void BlockPattern::begin_change(int from, std::span<const int> dims) {
  const auto first = static_cast<std::size_t>(from);
  dims_.resize(first);
  dims_.insert(dims_.end(), dims.begin(), dims.end());
  offsets_.resize(dims_.size() + 1);
  for (std::size_t i = first; i < dims_.size(); ++i) offsets_[i + 1] = offsets_[i] + dims_[i];
  pairs_.clear();
}

void BlockPattern::finish_change(std::span<const char> is_changed) {
  const std::size_t connected = pairs_.size();
  for (std::size_t k = 0; k < connected; ++k) pairs_.emplace_back(pairs_[k].second, pairs_[k].first);
  std::sort(pairs_.begin(), pairs_.end());
  pairs_.erase(std::unique(pairs_.begin(), pairs_.end()), pairs_.end());
  // What stands before the first that is changed stays where it is; the lists behind are copied out of the way.
  const int first = static_cast<int>(std::find_if(is_changed.begin(), is_changed.end(), [](char c) { return c != 0; }) -
                                     is_changed.begin());
  if (first >= static_cast<int>(begin_.size())) return;
  const int kept = begin_[first];
  bucket_begin_.assign(begin_.begin() + first, begin_.end());
  bucketed_.assign(neighbours_.begin() + kept, neighbours_.end());
  begin_.resize(dims_.size() + 1);
  neighbours_.resize(static_cast<std::size_t>(kept));
  std::size_t pair = 0;
  for (int i = first; i < blocks();) {
    if (is_changed[i] != 0) {
      begin_[i] = static_cast<int>(neighbours_.size());
      while (pair < pairs_.size() && pairs_[pair].first < i) ++pair;
      for (; pair < pairs_.size() && pairs_[pair].first == i; ++pair) neighbours_.push_back(pairs_[pair].second);
      ++i;
      continue;
    }
    int end = i;  // what stays side by side is copied as one
    while (end < blocks() && is_changed[end] == 0) ++end;
    const int shift = static_cast<int>(neighbours_.size()) - bucket_begin_[i - first];
    for (int k = i; k < end; ++k) begin_[k] = bucket_begin_[k - first] + shift;
    neighbours_.insert(neighbours_.end(), bucketed_.begin() + (bucket_begin_[i - first] - kept),
                       bucketed_.begin() + (bucket_begin_[end - first] - kept));
    i = end;
  }
  begin_[dims_.size()] = static_cast<int>(neighbours_.size());
}

}  // namespace oriel
