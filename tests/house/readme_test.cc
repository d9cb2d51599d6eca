// The program lines that README shows are lines of a program that the tests compile and run.
#include <gtest/gtest.h>

#include <fstream>
#include <set>
#include <string>
#include <vector>

namespace oriel::house {
namespace {

std::string trimmed(const std::string& line) {
  const auto first = line.find_first_not_of(' ');
  if (first == std::string::npos) return {};
  return line.substr(first, line.find_last_not_of(' ') - first + 1);
}

std::vector<std::string> lines_of(const std::string& path) {
  std::ifstream in(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(trimmed(line));
  return lines;
}

TEST(Readme, ShowsOnlyLinesOfTheFirstProgram) {
  const std::string root = ORIEL_SOURCE_DIR;
  const auto program = lines_of(root + "/examples/first_program.cc");
  const std::set<std::string> known(program.begin(), program.end());
  ASSERT_GT(known.size(), 20u);
  bool inside = false;
  int shown = 0;
  for (const std::string& line : lines_of(root + "/README.md")) {
    if (line.starts_with("```")) {
      inside = line == "```cpp";
    } else if (inside && !line.empty()) {
      EXPECT_TRUE(known.contains(line)) << "README.md shows a line that no test compiles: " << line;
      ++shown;
    }
  }
  EXPECT_GE(shown, 15);
}

}  // namespace
}  // namespace oriel::house
