#include "oriel/io/text.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <limits>
#include <random>
#include <string>

namespace oriel {
namespace {

TEST(Text, ReadsNumbersAsTheFilesOfTheFieldWriteThem) {
  double v = 0;
  EXPECT_EQ(parse_number("1.07e+001", v), NumberFault::none);
  EXPECT_EQ(v, 10.7);
  EXPECT_EQ(parse_number("+3.5", v), NumberFault::none);
  EXPECT_EQ(v, 3.5);
  EXPECT_EQ(parse_number("-1e-400", v), NumberFault::none) << "too small for a double is zero";
  EXPECT_EQ(v, 0.0);
}

// Against strtod, which is exact too: digits, points and exponents of any count.
TEST(Text, ReadsNumbersToTheNearestDouble) {
  std::mt19937 random(8);
  const auto below = [&](unsigned n) { return static_cast<int>(random() % n); };
  const auto digits = [&](std::string& text, int count) {
    for (int k = 0; k < count; ++k) text += static_cast<char>('0' + below(10));
  };
  for (int round = 0; round < 100000; ++round) {
    std::string text = below(3) == 0 ? "-" : "";
    digits(text, 1 + below(round % 2 == 0 ? 4 : 20));
    if (below(4) != 0) {
      text += '.';
      digits(text, below(round % 2 == 0 ? 8 : 20));
    }
    if (below(2) == 0) {
      text += below(2) == 0 ? "e" : "E";
      text += below(3) == 0 ? "" : below(2) == 0 ? "+" : "-";
      digits(text, 1 + below(3));
    }
    const double expected = std::strtod(text.c_str(), nullptr);
    if (!std::isfinite(expected)) continue;
    const std::string line = text + (below(2) == 0 ? " 1" : "");
    TextScanner scanner(line);
    double found = -1;
    ASSERT_TRUE(scanner.next_line());
    ASSERT_EQ(scanner.number(found), NumberFault::none) << text;
    ASSERT_EQ(std::memcmp(&found, &expected, sizeof found), 0) << text << ": " << found << ", " << expected;
  }
}

TEST(Text, TellsFaultsOfNumbersApart) {
  double v = 0;
  std::int64_t i = 0;
  EXPECT_EQ(parse_number("", v), NumberFault::missing);
  EXPECT_EQ(parse_number("abc", v), NumberFault::not_a_number);
  EXPECT_EQ(parse_number("1.5x", v), NumberFault::not_a_number);
  EXPECT_EQ(parse_number("+-1", v), NumberFault::not_a_number);
  EXPECT_EQ(parse_number("nan", v), NumberFault::not_finite);
  EXPECT_EQ(parse_number("-inf", v), NumberFault::not_finite);
  EXPECT_EQ(parse_number("1e999", v), NumberFault::overflow);
  EXPECT_EQ(parse_integer("99999999999999999999999", i), NumberFault::overflow);
  EXPECT_EQ(parse_integer("1.0", i), NumberFault::not_a_number);
}

TEST(Text, CountsLinesOverBlanksCommentsAndCarriageReturns) {
  TextScanner scanner("# head\r\n\r\n  a 1 # tail\r\n\n b");
  ASSERT_TRUE(scanner.next_line());
  EXPECT_EQ(scanner.line(), 3);
  EXPECT_EQ(scanner.token(), "a");
  double v = 0;
  EXPECT_EQ(scanner.number(v), NumberFault::none);
  EXPECT_TRUE(scanner.at_end_of_line());
  ASSERT_TRUE(scanner.next_line());
  EXPECT_EQ(scanner.line(), 5);
  EXPECT_EQ(scanner.token(), "b");
  EXPECT_FALSE(scanner.next_line());
  EXPECT_FALSE(scanner.next_line()) << "the end stays the end";
}

TEST(Text, LeavesAFaultyTokenForTheMessage) {
  TextScanner scanner("1 abc");
  double v = 0;
  ASSERT_TRUE(scanner.next_line());
  EXPECT_EQ(scanner.number(v), NumberFault::none);
  EXPECT_EQ(scanner.number(v), NumberFault::not_a_number);
  EXPECT_EQ(scanner.token(), "abc");
}

TEST(Text, QuotesBinaryTokensOfAnyLengthAsShortPrintableText) {
  EXPECT_EQ(quote_token(std::string("a\x01\xff\n")), "'a" + std::string(3, '?') + "'");
  EXPECT_EQ(quote_token(std::string(1000, 'x')), "'" + std::string(24, 'x') + "...'");
}

TEST(Text, WritesNumbersThatReadBackToTheSameBits) {
  for (double value : {0.1, 1.0 / 3.0, 1e300, 5e-324, -2.5, std::numeric_limits<double>::max()}) {
    std::string text;
    append_number(text, value);
    double back = 0;
    EXPECT_EQ(parse_number(text, back), NumberFault::none);
    EXPECT_EQ(back, value);
  }
}

TEST(Text, RefusesAFolderAndAnAbsentFileByName) {
  const std::string folder = testing::TempDir();
  const auto is_folder = read_text_file(folder);
  ASSERT_FALSE(is_folder);
  EXPECT_NE(is_folder.error().text().find("directory"), std::string::npos);
  const auto absent = read_text_file(folder + "/absent.g2o");
  ASSERT_FALSE(absent);
  EXPECT_EQ(absent.error().code, ErrorCode::not_found);
  EXPECT_NE(absent.error().text().find("absent.g2o"), std::string::npos);
}

TEST(Text, LeavesNothingBehindWhereItCannotWrite) {
  const std::string path = testing::TempDir() + "/oriel_no_such_folder/out.txt";
  EXPECT_FALSE(write_text_file(path, "x"));
  EXPECT_FALSE(std::filesystem::exists(testing::TempDir() + "/oriel_no_such_folder"));
}

TEST(Text, SplitsFieldsAndKeepsEmptyOnes) {
  std::string_view fields[3];
  EXPECT_EQ(split_fields("1, 2 ,,", fields, 3), 4);
  EXPECT_EQ(fields[1], "2");
  EXPECT_TRUE(fields[2].empty());
}

}  // namespace
}  // namespace oriel
