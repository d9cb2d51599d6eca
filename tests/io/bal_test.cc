#include "oriel/io/bal.h"

#include <gtest/gtest.h>

#include <random>
#include <string>

namespace oriel {
namespace {

const std::string kTiny =
    "2 1 3\n"
    "0 0     -3.5e+02 2.5\n"
    "1 0     1 2\n"
    "0 0     1 2\n"
    "0.1\n0.2\n0.3\n1\n2\n3\n500\n-1e-7\n1e-13\n"
    "0.1 0.2 0.3 1 2 3 500 0 0\n"
    "4\n5\n6\n";

std::string error_of(std::string text, const std::string& from = "", const std::string& to = "") {
  if (!from.empty()) text.replace(text.find(from), from.size(), to);
  const auto problem = parse_bal(text, "f.txt");
  return problem ? "no error" : problem.error().text();
}

TEST(Bal, ReadsCountsObservationsCamerasAndPoints) {
  const auto problem = parse_bal(kTiny, "f.txt");
  ASSERT_TRUE(problem) << problem.error();
  ASSERT_EQ(problem->cameras.size(), 2u);
  EXPECT_EQ(problem->cameras[0][6], 500);
  EXPECT_EQ(problem->cameras[1][5], 3);
  EXPECT_EQ(problem->points[0], (Vec3d{4, 5, 6}));
  ASSERT_EQ(problem->observations.size(), 3u);
  EXPECT_EQ(problem->observations[0].u, -350);
  EXPECT_EQ(problem->observations[1].camera, 1);
  EXPECT_EQ(problem->observations[1].line, 3);
}

TEST(Bal, NamesFileLineAndExpectationForBadInput) {
  EXPECT_EQ(error_of("3 7\n" + kTiny),
            "f.txt:1: expected a count for the number of observations, found the end of the line");
  EXPECT_EQ(error_of(kTiny, "2 1 3", "-2 1 3"), "f.txt:1: expected a number of cameras from 1 to 2147483647, found -2");
  EXPECT_EQ(error_of(kTiny, "2 1 3", "3000000000 1 3"),
            "f.txt:1: expected a number of cameras from 1 to 2147483647, found 3000000000");
  EXPECT_NE(error_of(kTiny, "2 1 3", "2000000000 1 3").find("cannot hold"), std::string::npos)
      << "and nothing is allocated";
  EXPECT_EQ(error_of(kTiny, "1 0  ", "2 0  "), "f.txt:3: expected a camera from 0 to 1, found 2");
  EXPECT_EQ(error_of(kTiny, "1 0  ", "1 -1 "), "f.txt:3: expected a point from 0 to 0, found -1");
  EXPECT_EQ(error_of(kTiny, "1 0     1 2", "1 0     1"),
            "f.txt:3: expected a finite number for v, found the end of the line");
  EXPECT_EQ(error_of(kTiny, "\n6\n", "\nnan\n"), "f.txt:17: expected a finite number for z of point 0, found 'nan'");
  EXPECT_EQ(error_of(kTiny, "\n6\n", "\n"), "f.txt:16: expected a number for z of point 0, found the end of the file");
  EXPECT_EQ(error_of(kTiny + "7\n"), "f.txt:18: expected the end of the file after the last point, found '7'");
  EXPECT_EQ(error_of(""), "f.txt: expected the counts of cameras, points and observations, found no line");
}

TEST(Bal, RefusesEveryCutOfAFile) {
  for (std::size_t n = 0; n + 2 < kTiny.size(); ++n) EXPECT_FALSE(parse_bal(kTiny.substr(0, n), "f.txt")) << n;
}

TEST(Bal, ReadsBackWhatItWroteToTheBit) {
  const auto once = parse_bal(kTiny, "f.txt");
  ASSERT_TRUE(once);
  const auto twice = parse_bal(format_bal(*once), "g.txt");
  ASSERT_TRUE(twice) << twice.error();
  EXPECT_EQ(once->cameras, twice->cameras);
  EXPECT_EQ(once->points[0], twice->points[0]);
  EXPECT_EQ(once->observations[0].u, twice->observations[0].u);
}

TEST(Bal, SurvivesAnyBytes) {
  std::mt19937 random(3);
  for (int round = 0; round < 2000; ++round) {
    std::string text = kTiny;
    for (int k = 0; k < 1 + round % 4; ++k) text[random() % text.size()] = static_cast<char>(random());
    const auto problem = parse_bal(text, "f.txt");
    if (!problem) {
      EXPECT_LT(problem.error().text().size(), 300u);
    }
  }
}

}  // namespace
}  // namespace oriel
