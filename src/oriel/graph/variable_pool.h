// All variables of one type: values and what the graph knows of each, in columns that are parallel to a SlotIndex.
#pragma once
#include <vector>

#include "oriel/base/byte_column.h"
#include "oriel/base/slot_map.h"
#include "oriel/graph/freedom.h"
#include "oriel/graph/type_ops.h"

namespace oriel {

class VariablePool {
 public:
  static constexpr std::uint32_t kNoIncidence = 0xffffffffu;

  // When what was last changed, in versions of the graph.
  struct Versions {
    std::uint64_t added = 0, value = 0, fixed = 0, first_estimate = 0, freedom = 0;
    bool changed_in(std::uint64_t version) const {
      return value == version || fixed == version || first_estimate == version || freedom == version;
    }
  };

  explicit VariablePool(const VariableOps* ops) : ops_(ops), values_(ops->bytes), first_estimates_(ops->bytes) {}

  const VariableOps& ops() const { return *ops_; }
  const SlotIndex& slots() const { return slots_; }
  SlotIndex& slots() { return slots_; }
  std::uint32_t extent() const { return slots_.extent(); }

  const void* value(std::uint32_t dense) const { return values_.at(dense); }
  const std::byte* values() const { return values_.data(); }
  const std::byte* first_estimates() const { return first_estimates_.data(); }
  bool fixed(std::uint32_t dense) const { return fixed_[dense] != 0; }
  const Freedom& freedom(std::uint32_t dense) const { return freedoms_[dense]; }
  // How many have directions held, fixed or not; 0 lets a solver skip the question.
  std::uint32_t restricted_count() const { return restricted_count_; }
  bool has_first_estimate(std::uint32_t dense) const { return has_first_estimate_[dense] != 0; }
  const void* first_estimate(std::uint32_t dense) const { return first_estimates_.at(dense); }
  const Versions& versions(std::uint32_t dense) const { return versions_[dense]; }
  // How many have a first estimate; 0 lets a solver skip the question.
  std::uint32_t first_estimate_count() const { return first_estimate_count_; }

  // Head of the list of factors at this variable (graph.h).
  std::uint32_t& incidence(std::uint32_t dense) { return incidence_[dense]; }
  std::uint32_t incidence(std::uint32_t dense) const { return incidence_[dense]; }

  std::uint32_t insert(SlotKey key, std::uint64_t serial, const void* value, bool fixed, std::uint64_t version);
  void erase(std::uint32_t dense);
  void set_value(std::uint32_t dense, const void* value) { values_.set(dense, value); }
  void note_value(std::uint32_t dense, std::uint64_t version) { versions_[dense].value = version; }
  void set_fixed(std::uint32_t dense, bool fixed, std::uint64_t version) {
    fixed_[dense] = fixed;
    versions_[dense].fixed = version;
    slots_.note_change(dense);
  }
  void set_freedom(std::uint32_t dense, const Freedom& freedom, std::uint64_t version);
  void set_first_estimate(std::uint32_t dense, const void* value, std::uint64_t version);
  void compact_if_due();
  void reserve(std::uint32_t more);

 private:
  const VariableOps* ops_;
  SlotIndex slots_;
  ByteColumn values_, first_estimates_;
  std::vector<char> fixed_, has_first_estimate_;
  std::vector<Freedom> freedoms_;
  std::vector<Versions> versions_;
  std::vector<std::uint32_t> incidence_;
  std::uint32_t first_estimate_count_ = 0, restricted_count_ = 0;
};

}  // namespace oriel
