// The program lines that README and docs show are lines of programs that the tests compile and run.
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

// How many lines of C++ the page shows; each must be a line of the program.
int shown_lines(const std::string& page, const std::string& program_file) {
  const std::string root = ORIEL_SOURCE_DIR;
  const auto program = lines_of(root + "/" + program_file);
  const std::set<std::string> known(program.begin(), program.end());
  EXPECT_GT(known.size(), 20u);
  bool inside = false;
  int shown = 0;
  for (const std::string& line : lines_of(root + "/" + page)) {
    if (line.starts_with("```")) {
      inside = line == "```cpp";
    } else if (inside && !line.empty()) {
      EXPECT_TRUE(known.contains(line)) << page << " shows a line that no test compiles: " << line;
      ++shown;
    }
  }
  return shown;
}

TEST(Readme, ShowsOnlyLinesOfTheFirstProgram) { EXPECT_GE(shown_lines("README.md", "examples/first_program.cc"), 15); }

TEST(PageOfTheWindow, ShowsOnlyLinesOfItsTest) {
  EXPECT_GE(shown_lines("docs/window.md", "tests/window/general_window_test.cc"), 15);
}

TEST(PageOfConfigs, ShowsOnlyLinesOfItsTest) {
  EXPECT_GE(shown_lines("docs/config.md", "tests/io/custom_parts_test.cc"), 8);
}

TEST(PageOfEngines, ShowsOnlyLinesOfItsTest) {
  EXPECT_GE(shown_lines("docs/engines.md", "tests/solve/held_directions_page_test.cc"), 9);
}

}  // namespace
}  // namespace oriel::house
