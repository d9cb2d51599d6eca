// What travels to a worker without being named by its user: all that is shipped.
#include "oriel/run/registry.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <set>

namespace oriel {
namespace {

using Names = std::set<std::string>;

// Every "name/version" that stands in the code of a room; "prior/1" of what is composed with another's name.
Names names_in(const std::string& room) {
  static const std::regex name("\"([a-z0-9_]+/[0-9]+)\"");
  Names out;
  for (const auto& file : std::filesystem::recursive_directory_iterator(ORIEL_SOURCE_DIR "/src/oriel/" + room)) {
    std::ifstream in(file.path());
    for (std::string line; std::getline(in, line);) {
      line.resize(std::min(line.size(), line.find("//")));
      for (std::sregex_iterator it(line.begin(), line.end(), name), end; it != end; ++it) out.insert((*it)[1]);
    }
  }
  return out;
}

bool has_factor(const TypeList& types, const std::string& residual) {
  for (const char* noise : {"isotropic", "diagonal", "full"})
    if (types.find_factor(type_key(residual) * 31 + type_key(noise)) != nullptr) return true;
  return false;
}
bool has(const TypeList& types, const std::string& name) {
  return types.find_variable(type_key(name)) != nullptr || has_factor(types, name);
}

// R9
TEST(ShippedTypes, AreEveryVariableAndEveryResidualThatTheSourceNames) {
  const TypeList types = shipped_types();
  Names names;
  for (const char* room : {"manifold", "sensor", "residual"}) names.merge(names_in(room));
  ASSERT_GT(names.size(), 40u);
  // Put together letter by letter.
  for (int n = 1; n <= 9; ++n) names.insert("vector" + std::to_string(n) + "/1");
  for (int n = 2; n <= 8; ++n) names.insert("structureless_track" + std::to_string(n) + "/1");
  for (const std::string& name : names) {
    bool found = has(types, name);
    for (const std::string& inner : names) found = found || has(types, name + "(" + inner + ")");
    EXPECT_TRUE(found) << name << " is shipped, and shipped_types() has it not";
  }
}

// What can be estimated can be known beforehand.
TEST(ShippedTypes, HaveAPriorOfEveryVariable) {
  const TypeList types = shipped_types();
  Names names = names_in("manifold");
  for (int n = 1; n <= 9; ++n) names.insert("vector" + std::to_string(n) + "/1");
  for (const std::string& name : names) EXPECT_TRUE(has_factor(types, "prior/1(" + name + ")")) << name;
}

}  // namespace
}  // namespace oriel
