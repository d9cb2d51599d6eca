// Errors as values, times as integers, and what "finite" means for a plain struct.
#include "oriel/base/result.h"

#include <gtest/gtest.h>

#include <array>
#include <limits>

#include "oriel/base/byte_column.h"
#include "oriel/base/check.h"
#include "oriel/base/finite.h"
#include "oriel/base/time.h"

namespace oriel {
namespace {

Result<int> half(int n) {
  if (n % 2 != 0) return Error{ErrorCode::bad_input, "an even number was expected", "numbers.txt", 3};
  return n / 2;
}

TEST(Result, HoldsAValueOrAnErrorThatNamesFileAndLine) {
  EXPECT_EQ(half(4).value(), 2);
  const Result<int> odd = half(3);
  EXPECT_FALSE(odd);
  EXPECT_EQ(odd.error().text(), "numbers.txt:3: an even number was expected");
  EXPECT_EQ((Error{ErrorCode::io, "no such file", "a.txt"}).text(), "a.txt: no such file");
  EXPECT_EQ((Error{ErrorCode::io, "no such thing"}).text(), "no such thing");
}

TEST(Result, FailsLoudlyWhenTheWrongHalfIsAskedFor) {
  const Result<int> odd = half(3);
  try {
    static_cast<void>(odd.value());
    FAIL() << "value() of an error came back";
  } catch (const ContractViolation& e) {
    EXPECT_NE(std::string(e.what()).find("an even number was expected"), std::string::npos);
  }
  EXPECT_THROW(static_cast<void>(half(4).error()), ContractViolation);
  EXPECT_THROW(static_cast<void>(Result<void>().error()), ContractViolation);
}

struct Inner {
  float weight = 1.0f;
  int count = 0;
};
struct Outer {
  Vec3d v = Vec3d::zero();
  Inner inner;
  bool flag = true;
  double scale = 1.0;
};
struct SaysItself {
  double hidden[2] = {0.0, 0.0};
  bool finite() const { return std::isfinite(hidden[0]) && std::isfinite(hidden[1]); }
};

TEST(AllFinite, FindsANanInAnyMemberOfAPlainStruct) {  // V5
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(all_finite(Outer{}));
  Outer o;
  o.v[2] = nan;
  EXPECT_FALSE(all_finite(o));
  o = {};
  o.inner.weight = std::numeric_limits<float>::infinity();
  EXPECT_FALSE(all_finite(o));
  o = {};
  o.scale = -std::numeric_limits<double>::infinity();
  EXPECT_FALSE(all_finite(o));
  SaysItself s;
  EXPECT_TRUE(all_finite(s));
  s.hidden[1] = nan;
  EXPECT_FALSE(all_finite(s));
  EXPECT_FALSE(all_finite(std::array<double, 3>{0.0, nan, 0.0}));
}

TEST(Time, KeepsStampsOneNanosecondApart) {  // W1
  const Time a{1403715273262142976}, b{1403715273262142977};
  EXPECT_LT(a, b);
  EXPECT_EQ((b - a).ns, 1);
  EXPECT_EQ(a + Duration{1}, b);
  EXPECT_LT(Time{-5}, Time{-4});
  EXPECT_EQ(Duration::from_seconds(-0.25).ns, -250000000);
}

TEST(ByteColumn, KeepsValuesThroughMovesAndResizes) {
  ByteColumn column(sizeof(double));
  for (int i = 0; i < 1000; ++i) {
    const double x = i;
    column.reserve(column.size() + 1);
    column.push_back(&x);
  }
  column.move(999, 0);
  column.resize(10);
  double first = 0.0, last = 0.0;
  std::memcpy(&first, column.at(0), sizeof(first));
  std::memcpy(&last, column.at(9), sizeof(last));
  EXPECT_EQ(first, 999.0);
  EXPECT_EQ(last, 9.0);
  EXPECT_EQ(column.size(), 10u);
}

}  // namespace
}  // namespace oriel
