#include "oriel/run/look.h"

#include <gtest/gtest.h>

namespace oriel {
namespace {

constexpr Duration us(std::int64_t n) { return {1000 * n}; }

TEST(UsualTime, LooksShortlyBeforeTheQuickestOfTheLastWouldBeThere) {
  UsualTime usual;
  EXPECT_EQ(usual.look({}, us(500)).time, us(0));  // of nothing that is known: sleeps
  for (const int took : {4000, 1600, 9000}) usual.took(us(took));
  EXPECT_EQ(usual.look({}, us(500)).after, us(1300));
  EXPECT_EQ(usual.look({}, us(500)).time, us(500));
  EXPECT_EQ(usual.look(us(1000), us(500)).after, us(300));
  EXPECT_EQ(usual.look(us(5000), us(500)).after, us(0));
  for (int i = 0; i < 8; ++i) usual.took(us(8000));  // the quick one is long ago
  EXPECT_EQ(usual.look({}, us(500)).after, us(6900));
  EXPECT_EQ(usual.look({}, us(0)).time, us(0));
}

TEST(Look, EndsWithTheWait) {
  const Look look{us(300), us(500)};
  EXPECT_EQ(look.within(us(1000)).time, us(500));
  EXPECT_EQ(look.within(us(400)).after, us(300));
  EXPECT_EQ(look.within(us(400)).time, us(100));
  EXPECT_EQ(look.within(us(200)).after, us(200));
  EXPECT_EQ(look.within(us(200)).time, us(0));
}

TEST(UsualTime, SleepsForWhatComesAtOnce) {
  UsualTime usual;
  usual.took(us(20));
  EXPECT_EQ(usual.look({}, us(500)).after, us(0));
  EXPECT_EQ(usual.look({}, us(500)).time, us(0));
}

}  // namespace
}  // namespace oriel
