// Things by name, as configs ask for them (R9): tasks, engines, builders, losses. A table is a value of whoever needs
// one; nothing registers itself behind anybody's back.
#pragma once
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "oriel/base/check.h"
#include "oriel/base/result.h"

namespace oriel {

template <class T>
class NameTable {
 public:
  // `what` is for messages: "task", "engine".
  explicit NameTable(std::string what) : what_(std::move(what)) {}

  // An error of code duplicate where the name is taken.
  Result<void> add(std::string name, T value) {
    if (get(name) != nullptr) return Error{ErrorCode::duplicate, "two of kind " + what_ + " are named '" + name + "'"};
    items_.emplace_back(std::move(name), std::move(value));
    return {};
  }
  // For what is known to be another's: an error of code not_found where the name is not.
  Result<void> replace(std::string_view name, T value) {
    for (auto& [known, old] : items_)
      if (known == name) return old = std::move(value), Result<void>{};
    return unknown(name);
  }
  // An error of code not_found that lists what there is.
  Result<T> find(std::string_view name) const {
    if (const T* value = get(name)) return *value;
    return unknown(name);
  }
  const T* get(std::string_view name) const {  // null: none
    for (const auto& [known, value] : items_)
      if (known == name) return &value;
    return nullptr;
  }
  Error unknown(std::string_view name) const {
    return {ErrorCode::not_found, "unknown " + what_ + " '" + std::string(name) + "'; expected one of " + names()};
  }
  std::string names() const {
    std::string all;
    for (const auto& [name, unused] : items_) all += (all.empty() ? "" : ", ") + name;
    return all.empty() ? "none, since none was added" : all;
  }
  std::vector<std::string> list() const {
    std::vector<std::string> all;
    for (const auto& [name, unused] : items_) all.push_back(name);
    return all;
  }
  const std::vector<std::pair<std::string, T>>& items() const { return items_; }  // in the order in which they came
  const std::string& what() const { return what_; }
  std::size_t size() const { return items_.size(); }

 private:
  std::string what_;
  std::vector<std::pair<std::string, T>> items_;
};

// To a table that the library fills: two of one name are an error of its own.
template <class T>
void add_shipped(NameTable<T>& table, const char* name, T value) {
  check(table.add(name, std::move(value)).ok(), "two shipped names are alike");
}

}  // namespace oriel
