// What every first program compiles: the headers that examples/first_program.cc reaches.
#include <gtest/gtest.h>

#include <fstream>
#include <regex>
#include <set>
#include <string>

namespace oriel::house {
namespace {

// Standard headers that cost a program a tenth of a second each (GCC 12); base/owned.h, base/function.h and
// base/result.h stand in for what they would be included for.
const std::set<std::string> kHeavy = {"algorithm", "chrono",        "functional", "iostream", "map",     "memory",
                                      "numeric",   "unordered_map", "random",     "ranges",   "sstream", "variant"};

// All headers of ours below `path`, and "header includes <heavy>" for each that is too heavy.
void walk(const std::string& root, const std::string& path, std::set<std::string>& seen, std::set<std::string>& heavy) {
  static const std::regex include(R"re(^\s*#\s*include\s*([<"])([^">]+)[">])re");
  std::ifstream in(root + "/" + path);
  ASSERT_TRUE(in) << path;
  for (std::string line; std::getline(in, line);) {
    std::smatch match;
    if (!std::regex_search(line, match, include)) continue;
    const std::string target = match[2].str();
    if (match[1] == "\"" && seen.insert(target).second) walk(root, "src/" + target, seen, heavy);
    if (match[1] == "<" && path.starts_with("src/") && kHeavy.contains(target))
      heavy.insert(path + " includes <" + target + ">");
  }
}

TEST(FirstProgram, ReachesNoHeavyStandardHeaderThroughOurs) {
  std::set<std::string> seen, heavy;
  walk(ORIEL_SOURCE_DIR, "examples/first_program.cc", seen, heavy);
  EXPECT_TRUE(seen.contains("oriel/solve/options.h"));  // it looked beyond what the program itself includes
  for (const std::string& h : heavy) ADD_FAILURE() << h;
}

}  // namespace
}  // namespace oriel::house
