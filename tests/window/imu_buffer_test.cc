#include "oriel/window/imu_buffer.h"

#include <gtest/gtest.h>

#include <cmath>

namespace oriel {
namespace {

ImuSample at(std::int64_t ns) { return {{ns}, {{0.0, 0.0, 0.1}}, {{0.0, 0.0, 9.8}}}; }

TEST(ImuBuffer, RefusesAStampThatIsNotLaterAndNamesBoth) {
  ImuBuffer b;
  ASSERT_TRUE(b.add(at(10)).ok());
  const Result<void> refused = b.add(at(10));
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("10 ns: expected a stamp after 10 ns"), std::string::npos);
  EXPECT_EQ(b.samples().size(), 1u);
}

TEST(ImuBuffer, RefusesAReadingThatIsNotFinite) {
  ImuBuffer b;
  ImuSample s = at(10);
  s.accel[1] = NAN;
  EXPECT_EQ(b.add(s).error().code, ErrorCode::not_finite);
  EXPECT_TRUE(b.samples().empty());
}

TEST(ImuBuffer, KeepsTheLastSampleBeforeWhatItForgets) {
  ImuBuffer b;
  for (int k = 0; k < 100; ++k) ASSERT_TRUE(b.add(at(k * 5)).ok());
  b.forget_before({402});
  EXPECT_EQ(b.samples().front().time.ns, 400);
  b.forget_before({400});
  EXPECT_EQ(b.samples().front().time.ns, 400);
  EXPECT_EQ(b.samples().back().time.ns, 495);
}

TEST(ImuBuffer, HoldsNoMoreThanTwiceWhatIsNeededOverALongRun) {
  ImuBuffer b;
  for (int k = 0; k < 10'000; ++k) {
    ASSERT_TRUE(b.add(at(k)).ok());
    b.forget_before({k - 20});
    ASSERT_LE(b.samples().size(), 22u);
  }
}

}  // namespace
}  // namespace oriel
