// Things by name, as configs ask for them (R9): tasks, engines, builders, losses. A table is a value of whoever needs
// one; nothing registers itself behind anybody's back.
#pragma once
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "oriel/base/result.h"

namespace oriel {

template <class T>
class NameTable {
 public:
  // `what` is for messages: "task", "engine".
  explicit NameTable(std::string what) : what_(std::move(what)) {}

  // An error of code duplicate where the name is taken.
  Result<void> add(std::string name, T value) {
    for (const auto& [known, unused] : items_)
      if (known == name) return Error{ErrorCode::duplicate, "two of kind " + what_ + " are named '" + name + "'"};
    items_.emplace_back(std::move(name), std::move(value));
    return {};
  }
  // An error of code not_found that lists what there is.
  Result<T> find(std::string_view name) const {
    for (const auto& [known, value] : items_)
      if (known == name) return value;
    return Error{ErrorCode::not_found, "unknown " + what_ + " '" + std::string(name) + "'; expected one of " + names()};
  }
  std::string names() const {
    std::string all;
    for (const auto& [name, unused] : items_) all += (all.empty() ? "" : ", ") + name;
    return all.empty() ? "none, since none was added" : all;
  }
  std::size_t size() const { return items_.size(); }

 private:
  std::string what_;
  std::vector<std::pair<std::string, T>> items_;
};

}  // namespace oriel
