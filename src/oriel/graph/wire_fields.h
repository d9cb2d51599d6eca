// What both sides of wire.h read and write alike; for those files alone.
#pragma once
#include <string>

#include "oriel/base/bytes.h"
#include "oriel/base/result.h"
#include "oriel/base/slot_map.h"
#include "oriel/graph/type_ops.h"

namespace oriel::wire {

enum VariableFlags : std::uint32_t { kFixed = 1, kHasFirstEstimate = 2, kRestricted = 4 };

inline Error damaged(const std::string& what) { return {ErrorCode::size_mismatch, "message: " + what}; }

inline SlotKey get_key(ByteReader& r) {
  SlotKey k;
  k.index = r.get<std::uint32_t>();
  k.generation = r.get<std::uint32_t>();
  return k;
}

inline Result<const VariableOps*> get_type(ByteReader& r, const TypeList& types) {
  const std::string name(r.get_text());
  const auto bytes = r.get<std::uint32_t>(), dim = r.get<std::uint32_t>();
  if (!r.ok()) return damaged("it ends within the name of a type");
  const VariableOps* ops = types.find_variable(type_key(name));
  if (ops == nullptr || ops->name != name)
    return Error{ErrorCode::not_found,
                 "message: it holds variables of the type '" + name + "', which the reader does not know"};
  if (ops->bytes != bytes || static_cast<std::uint32_t>(ops->dim) != dim)
    return damaged("'" + name + "' has " + std::to_string(bytes) + " bytes and dimension " + std::to_string(dim) +
                   ", " + std::to_string(ops->bytes) + " and " + std::to_string(ops->dim) + " expected");
  return ops;
}

}  // namespace oriel::wire
