#include "oriel/io/tum.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

namespace oriel {
namespace {

std::int64_t ns_of(const std::string& token) {
  Time t;
  EXPECT_TRUE(parse_seconds(token, t)) << token;
  return t.ns;
}

// W1
TEST(Tum, ReadsStampsExactlyToTheNanosecond) {
  EXPECT_EQ(ns_of("1403715273.26214"), 1403715273262140000);
  EXPECT_EQ(ns_of("1403715273.262142976"), 1403715273262142976);
  EXPECT_EQ(ns_of("1403715273.262142977") - ns_of("1403715273.262142976"), 1);
  EXPECT_EQ(ns_of("1.413393212255760431e+09"), 1413393212255760431);
  EXPECT_EQ(ns_of("1.4e+09"), 1400000000000000000);
  EXPECT_EQ(ns_of("-0.000000001"), -1);
  EXPECT_EQ(ns_of("+.5"), 500000000);
  EXPECT_EQ(ns_of("12345e-9"), 12345);
  EXPECT_EQ(ns_of("0e999999999"), 0);
  EXPECT_EQ(ns_of("1e-999999999"), 0);
  EXPECT_EQ(ns_of("9223372036.854775807"), std::numeric_limits<std::int64_t>::max());
}

TEST(Tum, RoundsBelowANanosecondToTheNearest) {
  EXPECT_EQ(ns_of("0.0000000014"), 1);
  EXPECT_EQ(ns_of("0.0000000015"), 2);
  EXPECT_EQ(ns_of("5e-10"), 1);
  EXPECT_EQ(ns_of("4.9e-10"), 0);
  EXPECT_EQ(ns_of("9e-11"), 0);
  EXPECT_EQ(ns_of("-5e-10"), -1);
}

TEST(Tum, RefusesStampsThatAreNoneOrOutOfRange) {
  Time t;
  for (const char* token : {"", "abc", ".", "1.2.3", "1e", "1e+x", "nan", "inf", "--1", "9223372036.854775808",
                            "1403715273262142976", "1e300", "1e999999999999999999999"})
    EXPECT_FALSE(parse_seconds(token, t)) << token;
}

TEST(Tum, WritesNineDecimals) {
  EXPECT_EQ(format_seconds({1403715273262142976}), "1403715273.262142976");
  EXPECT_EQ(format_seconds({5}), "0.000000005");
  EXPECT_EQ(format_seconds({-1500000000}), "-1.500000000");
  EXPECT_EQ(format_seconds({std::numeric_limits<std::int64_t>::min()}), "-9223372036.854775808");
}

TEST(Tum, ReadsBackWhatItWrote) {
  const auto once =
      parse_trajectory("# t x y z qx qy qz qw\n1.5 1 2 3 0 0 0 2\n\n2.000000001 0.1 0 0 0 0.6 0 0.8\n", "f");
  ASSERT_TRUE(once) << once.error();
  ASSERT_EQ(once->poses.size(), 2u);
  EXPECT_EQ(once->poses[0].qw, 1) << "normalised";
  const auto twice = parse_trajectory(format_tum(once->poses), "g");
  ASSERT_TRUE(twice) << twice.error();
  EXPECT_EQ(twice->poses[1].time.ns, 2000000001);
  EXPECT_EQ(twice->poses[1].p, once->poses[1].p);
  EXPECT_EQ(twice->poses[1].qy, once->poses[1].qy);
}

TEST(Tum, ReadsKittiMatricesByLine) {
  const auto file =
      parse_trajectory("1 0 0 5 0 1 0 6 0 0 1 7\n0 -1 0 5 1 0 0 6 0 0 1 7\n0 0 1 0 0 -1 0 0 1 0 0 0\n", "f");
  ASSERT_TRUE(file) << file.error();
  EXPECT_FALSE(file->stamped);
  EXPECT_EQ(file->poses[0].p, (Vec3d{5, 6, 7}));
  EXPECT_EQ(file->poses[1].time.ns, 1);
  EXPECT_NEAR(file->poses[1].qz, std::sqrt(0.5), 1e-15) << "90 degrees about z";
  EXPECT_NEAR(file->poses[1].qw, std::sqrt(0.5), 1e-15);
  EXPECT_NEAR(std::abs(file->poses[2].qx), std::sqrt(0.5), 1e-15) << "half a turn about (1, 0, 1)";
  EXPECT_NEAR(file->poses[2].qx, file->poses[2].qz, 1e-15);
}

TEST(Tum, NamesFileLineAndExpectationForBadInput) {
  const auto error_of = [](const std::string& text, StampOrder order = StampOrder::any) {
    const auto file = parse_trajectory(text, "f.tum", order);
    return file ? "no error" : file.error().text();
  };
  EXPECT_EQ(error_of("1 0 0 0 0 0 0 1\nx 0 0 0 0 0 0 1\n"), "f.tum:2: expected a stamp in seconds, found 'x'");
  EXPECT_EQ(error_of("1 0 0 0 0 0 0\n"), "f.tum:1: expected a finite number for qw, found the end of the line");
  EXPECT_EQ(error_of("1 0 0 0 0 0 0 1 9\n"), "f.tum:1: expected the end of the line, found '9'");
  EXPECT_EQ(error_of("1 0 nan 0 0 0 0 1\n"), "f.tum:1: expected a finite number for y, found 'nan'");
  EXPECT_EQ(error_of("1 0 0 0 0 0 0 0\n"), "f.tum:1: expected a quaternion that is not zero");
  EXPECT_EQ(error_of("# nothing\n"), "f.tum: expected poses `t x y z qx qy qz qw`, found none");
  EXPECT_EQ(error_of("2 0 0 5 0 1 0 6 0 0 1 7\n"), "f.tum:1: expected a rotation matrix");
  EXPECT_EQ(error_of("2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n"), "no error");
  EXPECT_EQ(error_of("2 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n", StampOrder::rising),
            "f.tum:2: expected a later stamp than 2.000000000, found '2'");
}

}  // namespace
}  // namespace oriel
