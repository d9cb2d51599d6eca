// Ids: index + generation, lent by an edit before the thing exists. An id that was erased never resolves again.
#pragma once
#include <cstdint>
#include <string>

#include "oriel/base/slot_map.h"
#include "oriel/manifold/manifold.h"

namespace oriel {

template <Variable V>
struct VariableId {
  SlotKey key;
  friend bool operator==(const VariableId&, const VariableId&) = default;
};

// The same without the C++ type, e.g. in a message or a report. `type` is type_key(V::kName).
struct VariableKey {
  std::uint64_t type = 0;
  SlotKey key;
  VariableKey() = default;
  VariableKey(std::uint64_t t, SlotKey k) : type(t), key(k) {}
  template <Variable V>
  VariableKey(VariableId<V> id) : type(type_key(V::kName)), key(id.key) {}  // NOLINT(google-explicit-constructor)
  friend bool operator==(const VariableKey&, const VariableKey&) = default;
};

// A factor, of whatever residual: the key of its table, and its place there.
struct FactorId {
  std::uint64_t table = 0;
  SlotKey key;
  friend bool operator==(const FactorId&, const FactorId&) = default;
};

// A name for people, e.g. Label("start") or Label("x", 17): kept in a cold side table, for reports only.
struct Label {
  std::string text;
  Label() = default;
  explicit Label(std::string t) : text(std::move(t)) {}
  Label(std::string t, std::int64_t number);
};

}  // namespace oriel
