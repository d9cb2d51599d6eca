#include "oriel/graph/variable_pool.h"

namespace oriel {

std::uint32_t VariablePool::insert(SlotKey key, std::uint64_t serial, const void* value, bool fixed,
                                   std::uint64_t version) {
  const std::uint32_t dense = slots_.insert(key, serial);
  values_.push_back(value);
  first_estimates_.push_back(value);
  fixed_.push_back(fixed);
  freedoms_.push_back({});
  has_first_estimate_.push_back(0);
  versions_.push_back({.added = version});
  incidence_.push_back(kNoIncidence);
  return dense;
}

void VariablePool::erase(std::uint32_t dense) {
  if (has_first_estimate_[dense]) --first_estimate_count_;
  if (!freedoms_[dense].is_full()) --restricted_count_;
  slots_.erase(slots_.key(dense));
}

void VariablePool::set_freedom(std::uint32_t dense, const Freedom& freedom, std::uint64_t version) {
  restricted_count_ += freedom.is_full() ? 0 : 1;
  restricted_count_ -= freedoms_[dense].is_full() ? 0 : 1;
  freedoms_[dense] = freedom;
  versions_[dense].freedom = version;
}

void VariablePool::set_first_estimate(std::uint32_t dense, const void* value, std::uint64_t version) {
  if (!has_first_estimate_[dense]) ++first_estimate_count_;
  has_first_estimate_[dense] = 1;
  first_estimates_.set(dense, value);
  versions_[dense].first_estimate = version;
}

void VariablePool::compact_if_due() {
  if (!slots_.wants_compaction()) return;
  slots_.compact(
      [this](std::uint32_t from, std::uint32_t to) {
        values_.move(from, to);
        first_estimates_.move(from, to);
        fixed_[to] = fixed_[from];
        freedoms_[to] = freedoms_[from];
        has_first_estimate_[to] = has_first_estimate_[from];
        versions_[to] = versions_[from];
        incidence_[to] = incidence_[from];
      },
      [this](std::uint32_t n) {
        values_.resize(n);
        first_estimates_.resize(n);
        fixed_.resize(n);
        freedoms_.resize(n);
        has_first_estimate_.resize(n);
        versions_.resize(n);
        incidence_.resize(n);
      });
}

void VariablePool::reserve(std::uint32_t more) {
  slots_.reserve(more);
  const std::size_t n = extent() + std::size_t{more};
  values_.reserve(n);
  first_estimates_.reserve(n);
  reserve_more(fixed_, more);
  reserve_more(freedoms_, more);
  reserve_more(has_first_estimate_, more);
  reserve_more(versions_, more);
  reserve_more(incidence_, more);
}

}  // namespace oriel
