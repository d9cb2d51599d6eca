// The rules of the house, on the tree as it is; and each rule on a tree that breaks it, so that a rule which stopped
// looking would be noticed.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <regex>
#include <string>
#include <string_view>
#include <vector>

namespace oriel::house {
namespace {

namespace fs = std::filesystem;

// The source tree as data, so that a rule can be tried on a bad tree made up for it.
struct SourceFile {
  std::string path;                // relative to the project, e.g. "src/oriel/graph/graph.h"
  std::vector<std::string> lines;  // without line ends
};
using SourceTree = std::vector<SourceFile>;

// Each room may include itself and the rooms to its left.
constexpr std::array<std::string_view, 11> kRooms = {"base",  "manifold", "sensor", "residual", "graph",   "linear",
                                                     "solve", "window",   "run",    "io",       "evaluate"};
constexpr int kAbove = static_cast<int>(kRooms.size());  // apps, python, viewer, examples, benchmarks, tests
constexpr int kUnknown = -1;

int rank_of(std::string_view room) {
  const auto it = std::find(kRooms.begin(), kRooms.end(), room);
  return it == kRooms.end() ? kUnknown : static_cast<int>(it - kRooms.begin());
}

std::string room_of(std::string_view path_below_oriel) {
  return std::string(path_below_oriel.substr(0, path_below_oriel.find('/')));
}

// The highest rank that a file at `path` may include; engines stand on solve, testing on everything.
int reach_of(const std::string& path) {
  constexpr std::string_view kRoot = "src/oriel/";
  if (!path.starts_with(kRoot)) return kAbove;
  const std::string room = room_of(std::string_view(path).substr(kRoot.size()));
  if (room == "engines") return rank_of("solve");
  if (room == "testing") return kAbove;
  return rank_of(room);
}

std::string breach(const SourceFile& file, std::size_t line, const std::string& what) {
  return file.path + ":" + std::to_string(line + 1) + ": " + what;
}

// What is wrong with including "oriel/<target>" from `file`, empty if nothing.
std::string fault_of_arrow(const SourceFile& file, const std::string& target) {
  const int reach = reach_of(file.path);
  const std::string room = room_of(target);
  if (room == "engines" || room == "testing") {
    const bool own_room = file.path.starts_with("src/oriel/" + room + "/");
    return own_room || reach == kAbove ? "" : "no room of the core may include " + room + "/";
  }
  const int rank = rank_of(room);
  if (rank == kUnknown) return "unknown room '" + room + "'";
  return rank <= reach ? "" : room + " is to the right of this room";
}

bool is_header(const std::string& path) { return path.ends_with(".h"); }

std::string joined(const std::vector<std::string>& breaches) {
  std::string text;
  for (const auto& b : breaches) text += "\n  " + b;
  return text;
}

// Every .h and .cc below `project`, sorted by path.
SourceTree read_tree(const std::string& project) {
  SourceTree tree;
  for (const char* top : {"src", "apps", "benchmarks", "examples", "python", "tests"}) {
    const fs::path root = fs::path(project) / top;
    if (!fs::is_directory(root)) continue;
    for (const auto& entry : fs::recursive_directory_iterator(root)) {
      const auto extension = entry.path().extension();
      if (extension != ".h" && extension != ".cc") continue;
      SourceFile file{fs::relative(entry.path(), project).generic_string(), {}};
      std::ifstream in(entry.path());
      for (std::string line; std::getline(in, line);) file.lines.push_back(line);
      tree.push_back(std::move(file));
    }
  }
  std::sort(tree.begin(), tree.end(), [](const auto& a, const auto& b) { return a.path < b.path; });
  return tree;
}

const SourceTree& project_tree() {
  static const SourceTree tree = read_tree(ORIEL_SOURCE_DIR);
  return tree;
}

// Each rule gives one line per breach, "path:line: what was expected"; none where the tree keeps it.
std::vector<std::string> arrows_to_the_right(const SourceTree& tree) {
  static const std::regex include(R"(^\s*#\s*include\s*["<]oriel/([^">]+)[">])");
  static const std::regex climbing(R"(^\s*#\s*include\s*"\.\./)");
  std::vector<std::string> found;
  for (const auto& file : tree) {
    if (reach_of(file.path) == kUnknown) {
      found.push_back(file.path + ":1: a file in a folder that is no room");
      continue;
    }
    for (std::size_t i = 0; i < file.lines.size(); ++i) {
      std::smatch match;
      if (std::regex_search(file.lines[i], climbing))
        found.push_back(breach(file, i, R"(expected "oriel/<room>/x.h")"));
      if (!std::regex_search(file.lines[i], match, include)) continue;
      const std::string fault = fault_of_arrow(file, match[1].str());
      if (!fault.empty()) found.push_back(breach(file, i, fault));
    }
  }
  return found;
}

std::vector<std::string> eigen_in_headers(const SourceTree& tree) {
  static const std::regex include(R"(^\s*#\s*include\s*[<"]Eigen/)");
  std::vector<std::string> found;
  for (const auto& file : tree) {
    const bool ours = file.path.starts_with("src/oriel/") && !file.path.starts_with("src/oriel/engines/");
    if (!ours || !is_header(file.path)) continue;
    for (std::size_t i = 0; i < file.lines.size(); ++i) {
      if (std::regex_search(file.lines[i], include)) found.push_back(breach(file, i, "Eigen belongs into .cc files"));
    }
  }
  return found;
}

std::vector<std::string> long_files(const SourceTree& tree, std::size_t max_lines) {
  std::vector<std::string> found;
  for (const auto& file : tree) {
    if (file.lines.size() <= max_lines) continue;
    found.push_back(file.path + ": " + std::to_string(file.lines.size()) + " lines, at most " +
                    std::to_string(max_lines));
  }
  return found;
}

// Lines of the first class of a file, 0 where there is none.
std::size_t class_lines(const SourceFile& file) {
  std::size_t first = file.lines.size();
  for (std::size_t i = 0; i < file.lines.size(); ++i) {
    if (first == file.lines.size() && file.lines[i].starts_with("class ")) first = i;
    if (first < i && file.lines[i] == "};") return i - first + 1;
  }
  return 0;
}

// Comments like `// M3, L12` in tests, whose numbers docs/behaviours.md does not have.
std::vector<std::string> unknown_behaviours(const SourceTree& tree, const std::string& behaviours) {
  static const std::regex numbers(R"(^\s*//\s*([VLMWCR]\d+(\s*,\s*[VLMWCR]\d+)*)\s*$)");
  static const std::regex number(R"([VLMWCR]\d+)");
  std::vector<std::string> found;
  for (const auto& file : tree) {
    if (!file.path.starts_with("tests/")) continue;
    for (std::size_t i = 0; i < file.lines.size(); ++i) {
      std::smatch match;
      if (!std::regex_search(file.lines[i], match, numbers)) continue;
      const std::string list = match[1].str();
      for (std::sregex_iterator it(list.begin(), list.end(), number), end; it != end; ++it) {
        const bool known = behaviours.find("- " + it->str() + " ") != std::string::npos;
        if (!known) found.push_back(breach(file, i, "docs/behaviours.md has no " + it->str()));
      }
    }
  }
  return found;
}

TEST(Layers, EachRoomIncludesOnlyRoomsToItsLeft) {
  ASSERT_FALSE(project_tree().empty());
  const auto breaches = arrows_to_the_right(project_tree());
  EXPECT_TRUE(breaches.empty()) << joined(breaches);
}

TEST(Layers, AnArrowToTheRightIsCaughtWithFileAndLine) {
  const SourceTree bad = {{"src/oriel/graph/graph.h", {"#pragma once", "#include \"oriel/solve/engine.h\""}}};
  ASSERT_EQ(arrows_to_the_right(bad).size(), 1u);
  EXPECT_TRUE(arrows_to_the_right(bad)[0].starts_with("src/oriel/graph/graph.h:2: ")) << arrows_to_the_right(bad)[0];
}

TEST(Layers, EveryKindOfForbiddenArrowIsCaught) {
  const auto breaches_of = [](const std::string& path, const std::string& line) {
    return arrows_to_the_right({{path, {line}}}).size();
  };
  EXPECT_EQ(breaches_of("src/oriel/base/x.h", "#include \"oriel/manifold/so3.h\""), 1u);
  EXPECT_EQ(breaches_of("src/oriel/io/x.cc", "  #  include <oriel/evaluate/ate.h>"), 1u);
  EXPECT_EQ(breaches_of("src/oriel/solve/x.cc", "#include \"oriel/engines/ceres/ceres_engine.h\""), 1u);
  EXPECT_EQ(breaches_of("src/oriel/linear/x.cc", "#include \"oriel/testing/world.h\""), 1u);
  EXPECT_EQ(breaches_of("src/oriel/engines/ceres/x.cc", "#include \"oriel/window/timeline.h\""), 1u);
  EXPECT_EQ(breaches_of("src/oriel/engines/ceres/x.cc", "#include \"oriel/testing/world.h\""), 1u);
  EXPECT_EQ(breaches_of("src/oriel/graph/x.cc", "#include \"oriel/grahp/ids.h\""), 1u);
  EXPECT_EQ(breaches_of("src/oriel/graph/x.cc", "#include \"../solve/engine.h\""), 1u);
  EXPECT_EQ(breaches_of("src/oriel/attic/x.cc", ""), 1u);
}

TEST(Layers, AllowedArrowsPass) {
  const SourceTree good = {
      {"src/oriel/graph/graph.h",
       {"#include \"oriel/graph/ids.h\"", "#include \"oriel/base/result.h\"", "#include <map>"}},
      {"src/oriel/engines/ceres/x.cc", {"#include \"oriel/engines/ceres/x.h\"", "#include \"oriel/solve/engine.h\""}},
      {"src/oriel/testing/world.cc", {"#include \"oriel/window/timeline.h\""}},
      {"apps/solve.cc", {"#include \"oriel/testing/world.h\"", "#include \"oriel/evaluate/ate.h\""}},
  };
  EXPECT_TRUE(arrows_to_the_right(good).empty()) << joined(arrows_to_the_right(good));
}

TEST(Headers, DoNotIncludeEigen) {
  const auto breaches = eigen_in_headers(project_tree());
  EXPECT_TRUE(breaches.empty()) << joined(breaches);
  EXPECT_EQ(eigen_in_headers({{"src/oriel/linear/qr.h", {"#include <Eigen/Dense>"}}}).size(), 1u);
  EXPECT_TRUE(eigen_in_headers({{"src/oriel/linear/qr.cc", {"#include <Eigen/Dense>"}}}).empty());
}

TEST(Files, HaveAtMostFourHundredLines) {
  const auto breaches = long_files(project_tree(), 400);
  EXPECT_TRUE(breaches.empty()) << joined(breaches);
  EXPECT_EQ(long_files({{"src/oriel/graph/graph.cc", std::vector<std::string>(401)}}, 400).size(), 1u);
}

TEST(Tutorials, OfAnEngineTakesLessThanEightyLines) {
  const SourceTree& tree = project_tree();
  const auto file = std::find_if(tree.begin(), tree.end(),
                                 [](const auto& f) { return f.path == "tests/solve/custom_engine_test.cc"; });
  ASSERT_NE(file, tree.end());
  EXPECT_GT(class_lines(*file), 20u);
  EXPECT_LT(class_lines(*file), 80u);
  EXPECT_EQ(class_lines({"x.cc", {"class X {", "  struct Y {", "  };", "};", "class Z {", "};"}}), 4u);
}

// From one line to another, blank ones not counted; 0 where they are not there.
std::size_t lines_between(const SourceFile& file, const std::string& first, const std::string& last) {
  const auto a = std::find(file.lines.begin(), file.lines.end(), first);
  const auto b = std::find(a, file.lines.end(), last);
  if (b == file.lines.end()) return 0;
  return static_cast<std::size_t>(std::count_if(a + 1, b, [](const std::string& l) { return !l.empty(); }));
}

// R9
TEST(Tutorials, OfABuilderAndALossByNameTakesLessThanSixtyLines) {
  const SourceTree& tree = project_tree();
  const auto file =
      std::find_if(tree.begin(), tree.end(), [](const auto& f) { return f.path == "tests/io/custom_parts_test.cc"; });
  ASSERT_NE(file, tree.end());
  const std::size_t lines =
      lines_between(*file, "// ---- what the user writes ----", "// ---- and what comes of it ----");
  EXPECT_GT(lines, 20u);
  EXPECT_LT(lines, 60u);
  EXPECT_EQ(lines_between({"x.cc", {"a", "1", "", "2", "b"}}, "a", "b"), 2u);
}

TEST(Behaviours, NumbersInTestsStandInTheList) {
  std::ifstream in(std::string(ORIEL_SOURCE_DIR) + "/docs/behaviours.md");
  const std::string behaviours((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  ASSERT_NE(behaviours.find("- V1 "), std::string::npos);
  const auto breaches = unknown_behaviours(project_tree(), behaviours);
  EXPECT_TRUE(breaches.empty()) << joined(breaches);
  EXPECT_EQ(unknown_behaviours({{"tests/graph/x_test.cc", {"  // V1, V99"}}}, behaviours).size(), 1u);
}

}  // namespace
}  // namespace oriel::house
