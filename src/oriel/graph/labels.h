// The names that people gave to variables: cold, beside the pools, for reports alone.
#pragma once
#include <string>
#include <unordered_map>

#include "oriel/graph/ids.h"

namespace oriel {

class LabelTable {
 public:
  // Null where it has none.
  const std::string* find(const VariableKey& id) const {
    const auto type = by_type_.find(id.type);
    if (type == by_type_.end()) return nullptr;
    const auto label = type->second.find(packed(id.key));
    return label == type->second.end() ? nullptr : &label->second;
  }
  void set(const VariableKey& id, const std::string& text) { by_type_[id.type][packed(id.key)] = text; }
  void erase(const VariableKey& id) {
    if (const auto type = by_type_.find(id.type); type != by_type_.end()) type->second.erase(packed(id.key));
  }

 private:
  static std::uint64_t packed(SlotKey k) { return (std::uint64_t{k.index} << 32) | k.generation; }
  std::unordered_map<std::uint64_t, std::unordered_map<std::uint64_t, std::string>> by_type_;
};

}  // namespace oriel
