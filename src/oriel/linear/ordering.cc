#include "oriel/linear/ordering.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>
#ifdef ORIEL_HAS_METIS
#include <metis.h>
#endif

namespace oriel {

void MinimumDegree::order(const BlockPattern& pattern, std::vector<int>& order, int first_late) {
  first_late_ = first_late;
  start(pattern);
  order.clear();
  set_dense_aside(pattern);
  for (int p = pop_least(); p >= 0; p = pop_least()) {
    gather_element(p);
    measure_elements(p);
    update_variables(p);
    merge_indistinguishable();
    finish_element(p);
    for (int i = p; i >= 0; i = chain_next_[i]) order.push_back(i);
  }
  order.insert(order.end(), dense_.begin(), dense_.end());
}

void MinimumDegree::start(const BlockPattern& pattern) {
  n_ = pattern.blocks();
  remaining_ = pattern.total_dim();
  least_ = 0;
  stamp_ = 1;
  kind_.assign(n_, Kind::variable);
  lists_.clear();
  lists_.reserve(4 * static_cast<std::size_t>(pattern.neighbour_count()) + n_);
  begin_.resize(n_), length_.resize(n_), weight_.resize(n_), degree_.assign(n_, 0);
  elements_.assign(n_, 0);
  for (int i = 0; i < n_; ++i) {
    const auto neighbours = pattern.neighbours(i);
    begin_[i] = static_cast<int>(lists_.size());
    length_[i] = static_cast<int>(neighbours.size());
    lists_.insert(lists_.end(), neighbours.begin(), neighbours.end());
    weight_[i] = pattern.dim(i);
    for (int j : neighbours) degree_[i] += pattern.dim(j);
  }
  head_.assign(remaining_ + 1, -1);
  next_.assign(n_, -1), previous_.assign(n_, -1);
  outside_.assign(n_, 0), mark_.assign(n_, 0);
  chain_next_.assign(n_, -1), chain_last_.resize(n_);
  std::iota(chain_last_.begin(), chain_last_.end(), 0);
  hash_head_.assign(n_, -1), hash_next_.assign(n_, -1), hash_.assign(n_, 0);
}

// A block that nearly all others touch (a calibration, say) would be walked by every elimination, and comes last
// anyway.
void MinimumDegree::set_dense_aside(const BlockPattern& pattern) {
  dense_.clear();
  const int limit = std::max(16, static_cast<int>(10 * std::sqrt(static_cast<double>(n_))));
  for (int i = 0; i < n_; ++i) {
    if (length_[i] > limit && length_[i] > n_ / 4) {
      dense_.push_back(i);
      kind_[i] = Kind::gone;
      weight_[i] = 0;
      remaining_ -= pattern.dim(i);
    }
  }
  for (int i = n_ - 1; i >= 0; --i) {
    if (kind_[i] != Kind::variable) continue;
    degree_[i] = std::min(degree_[i], remaining_);
    list_by_degree(i);
  }
}

void MinimumDegree::list_by_degree(int i) {
  if (i >= first_late_) return;
  const int d = degree_[i];
  next_[i] = head_[d];
  previous_[i] = -1;
  if (head_[d] >= 0) previous_[head_[d]] = i;
  head_[d] = i;
  least_ = std::min(least_, d);
}

void MinimumDegree::unlist(int i) {
  if (i >= first_late_) return;
  if (previous_[i] >= 0)
    next_[previous_[i]] = next_[i];
  else
    head_[degree_[i]] = next_[i];
  if (next_[i] >= 0) previous_[next_[i]] = previous_[i];
}

int MinimumDegree::pop_least() {
  const int size = static_cast<int>(head_.size());
  while (least_ < size && head_[least_] < 0) ++least_;
  if (least_ == size && first_late_ < n_) {
    release_late();
    while (least_ < size && head_[least_] < 0) ++least_;
  }
  if (least_ == size) return -1;
  const int p = head_[least_];
  unlist(p);
  return p;
}

void MinimumDegree::release_late() {
  const int first = std::exchange(first_late_, kNoneLate);
  for (int i = n_ - 1; i >= first; --i)
    if (kind_[i] == Kind::variable && weight_[i] > 0) list_by_degree(i);
}

// L_p = (A_p ∪ ⋃ L_e over the elements e of p) \ {p}; those elements are absorbed. Variables in L_p get a negative
// weight.
void MinimumDegree::gather_element(int p) {
  const int new_begin = static_cast<int>(lists_.size());
  int total = 0;
  remaining_ -= weight_[p];
  weight_[p] = 0;
  auto take = [&](int i) {
    if (weight_[i] <= 0) return;
    total += weight_[i];
    weight_[i] = -weight_[i];
    unlist(i);
    lists_.push_back(i);
  };
  for (int k = 0; k < length_[p]; ++k) {
    const int x = lists_[begin_[p] + k];
    if (k >= elements_[p]) {
      take(x);
    } else if (kind_[x] == Kind::element) {
      for (int q = 0; q < length_[x]; ++q) take(lists_[begin_[x] + q]);
      kind_[x] = Kind::gone;
    }
  }
  kind_[p] = Kind::element;
  begin_[p] = new_begin;
  length_[p] = static_cast<int>(lists_.size()) - new_begin;
  degree_[p] = total;
}

// outside_[e] - stamp_ = weight of L_e \ L_p, for every element that a variable of L_p touches (their Algorithm 2).
void MinimumDegree::measure_elements(int p) {
  for (int k = 0; k < length_[p]; ++k) {
    const int i = lists_[begin_[p] + k];
    for (int q = 0; q < elements_[i]; ++q) {
      const int e = lists_[begin_[i] + q];
      if (kind_[e] != Kind::element) continue;
      if (outside_[e] < stamp_) outside_[e] = degree_[e] + stamp_;
      outside_[e] += weight_[i];  // negative within L_p
    }
  }
}

void MinimumDegree::update_variables(int p) {
  used_hashes_.clear();
  for (int k = 0; k < length_[p]; ++k) update_variable(p, lists_[begin_[p] + k]);
  stamp_ += static_cast<std::int64_t>(head_.size());  // beyond all that this step has written to outside_
}

// Prunes the lists of variable i of L_p, puts element p in front of them, and bounds its degree outside L_p.
void MinimumDegree::update_variable(int p, int i) {
  int* const list = lists_.data() + begin_[i];
  int kept = 0, outside = 0;
  std::uint32_t hash = 0;
  for (int q = 0; q < elements_[i]; ++q) {
    const int e = list[q];
    if (kind_[e] != Kind::element) continue;
    const int rest = static_cast<int>(outside_[e] - stamp_);
    if (rest == 0) {
      kind_[e] = Kind::gone;  // L_e is within L_p: absorbed
      continue;
    }
    outside += rest;
    hash += static_cast<std::uint32_t>(e);
    list[kept++] = e;
  }
  const int kept_elements = kept;
  for (int q = elements_[i]; q < length_[i]; ++q) {
    const int j = list[q];
    if (weight_[j] <= 0) continue;  // in L_p, eliminated, or merged
    outside += weight_[j];
    hash += static_cast<std::uint32_t>(j);
    list[kept++] = j;
  }
  if (outside == 0) {  // its neighbours are all in L_p: it can be eliminated with p, without fill
    remaining_ += weight_[i];
    degree_[p] += weight_[i];
    weight_[i] = 0;
    kind_[i] = Kind::gone;
    append(p, i);
    return;
  }
  // One place is free: i came into L_p through a variable or an element that the pruning removed.
  list[kept] = list[kept_elements];
  list[kept_elements] = list[0];
  list[0] = p;
  elements_[i] = kept_elements + 1;
  length_[i] = kept + 1;
  degree_[i] = std::min(degree_[i], outside);
  const int bucket = static_cast<int>(hash % static_cast<std::uint32_t>(n_));
  hash_[i] = bucket;
  if (hash_head_[bucket] < 0) used_hashes_.push_back(bucket);
  hash_next_[i] = hash_head_[bucket];
  hash_head_[bucket] = i;
}

void MinimumDegree::append(int to, int from) {
  chain_next_[chain_last_[to]] = from;
  chain_last_[to] = chain_last_[from];
}

// Variables with equal lists stay equal to the end: one stands for all.
void MinimumDegree::merge_indistinguishable() {
  for (int bucket : used_hashes_) {
    merge_bucket(hash_head_[bucket]);
    hash_head_[bucket] = -1;
  }
}

void MinimumDegree::merge_bucket(int first) {
  for (int i = first; i >= 0 && hash_next_[i] >= 0; i = hash_next_[i]) {
    if (kind_[i] != Kind::variable) continue;
    ++stamp_;
    for (int q = 0; q < length_[i]; ++q) mark_[lists_[begin_[i] + q]] = stamp_;
    for (int j = hash_next_[i]; j >= 0; j = hash_next_[j]) {
      if (kind_[j] != Kind::variable || !same_lists(i, j)) continue;
      weight_[i] += weight_[j];
      weight_[j] = 0;
      kind_[j] = Kind::gone;
      append(i, j);
    }
  }
}

bool MinimumDegree::same_lists(int i, int j) const {
  if (length_[i] != length_[j] || elements_[i] != elements_[j]) return false;
  const int* list = lists_.data() + begin_[j];
  return std::all_of(list, list + length_[j], [this](int x) { return mark_[x] == stamp_; });
}

// What is left of L_p gets its weights back and goes to its new place in the degree lists.
void MinimumDegree::finish_element(int p) {
  int kept = 0;
  for (int k = 0; k < length_[p]; ++k) {
    const int i = lists_[begin_[p] + k];
    if (weight_[i] == 0) continue;
    weight_[i] = -weight_[i];
    degree_[i] = std::min(degree_[i] + degree_[p], remaining_) - weight_[i];
    lists_[begin_[p] + kept++] = i;
    list_by_degree(i);
  }
  length_[p] = kept;
  lists_.resize(begin_[p] + kept);
  if (kept == 0) kind_[p] = Kind::gone;
}

#ifdef ORIEL_HAS_METIS
bool nested_dissection(const BlockPattern& pattern, std::vector<int>& order) {
  idx_t n = pattern.blocks();
  if (n < 2) return false;
  std::vector<idx_t> begin(n + 1, 0), neighbours, weights(n), permutation(n), inverse(n);
  neighbours.reserve(pattern.neighbour_count());
  for (idx_t i = 0; i < n; ++i) {
    for (int j : pattern.neighbours(i)) neighbours.push_back(j);
    begin[i + 1] = static_cast<idx_t>(neighbours.size());
    weights[i] = pattern.dim(i);
  }
  if (neighbours.empty()) return false;
  idx_t options[METIS_NOPTIONS];
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_SEED] = 1;  // the same order in every run
  options[METIS_OPTION_NUMBERING] = 0;
  const int status =
      METIS_NodeND(&n, begin.data(), neighbours.data(), weights.data(), options, permutation.data(), inverse.data());
  if (status != METIS_OK) return false;
  order.assign(permutation.begin(), permutation.end());
  return true;
}
#else
bool nested_dissection(const BlockPattern&, std::vector<int>&) { return false; }
#endif

}  // namespace oriel
