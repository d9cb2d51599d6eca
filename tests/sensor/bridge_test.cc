// Preintegration across gaps.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <vector>

#include "oriel/sensor/preintegration.h"

namespace oriel {
namespace {

constexpr ImuNoise kNoise{1.7e-3, 2e-2, 1.9e-4, 3e-3};
constexpr std::int64_t kStep = 5'000'000;  // [ns], 200 Hz
constexpr Vec3d kRest = {{0.0, 0.0, 9.81}};

std::vector<ImuSample> motion(int count) {
  std::vector<ImuSample> samples;
  for (int i = 0; i < count; ++i) {
    const double t = 0.005 * i;
    samples.push_back({Time{i * kStep},
                       {{0.5 * std::sin(2 * t), 0.3 * std::cos(3 * t), 0.2}},
                       {{std::cos(4 * t), -0.5 + std::sin(t), 9.81 + std::sin(5 * t)}}});
  }
  return samples;
}

std::vector<ImuSample> without(std::vector<ImuSample> samples, std::int64_t from_ms, std::int64_t to_ms) {
  std::erase_if(samples,
                [=](const ImuSample& s) { return s.time.ns > from_ms * 1'000'000 && s.time.ns < to_ms * 1'000'000; });
  return samples;
}

TEST(Bridge, GivesTheBitsOfPlainPreintegrationWhereThereIsNoGap) {
  const auto samples = motion(300);
  const ImuBiasd bias{{{0.01, -0.02, 0.03}}, {{0.1, 0.0, -0.1}}};
  const auto plain = preintegrate(samples, Time{12'000'000}, Time{903'000'000}, bias, kNoise);
  const auto across = preintegrate_across(samples, Time{12'000'000}, Time{903'000'000}, bias, kNoise, kRest);
  ASSERT_TRUE(plain.ok() && across.ok());
  EXPECT_EQ(across->missing.ns, 0);
  EXPECT_EQ(std::memcmp(&plain->motion, &across->integral.motion, sizeof(PreintegratedImud)), 0);
  EXPECT_EQ(plain->covariance, across->integral.covariance);
}

TEST(Bridge, LiesWithinItsOwnUncertaintyAcrossAGap) {
  const auto samples = motion(400);
  for (const std::int64_t gap_ms : {60, 100, 300, 800}) {
    const auto whole = preintegrate(samples, Time{0}, Time{1'500'000'000}, {}, kNoise);
    const auto across =
        preintegrate_across(without(samples, 400, 400 + gap_ms), Time{0}, Time{1'500'000'000}, {}, kNoise, kRest);
    ASSERT_TRUE(whole.ok() && across.ok());
    EXPECT_EQ(across->missing.ns, gap_ms * 1'000'000);
    const PreintegratedImud &a = whole->motion, &b = across->integral.motion;
    const Mat<double, 15, 15>&P = across->integral.covariance, &P0 = whole->covariance;
    const Vec3d turn = (a.dR.inverse() * b.dR).log();
    for (int i = 0; i < 3; ++i) {
      EXPECT_LT(std::fabs(turn[i]), 2.0 * std::sqrt(P(i, i)));
      EXPECT_LT(std::fabs(a.dv[i] - b.dv[i]), 2.0 * std::sqrt(P(3 + i, 3 + i)));
      EXPECT_LT(std::fabs(a.dp[i] - b.dp[i]), 2.0 * std::sqrt(P(6 + i, 6 + i)));
      const double T = 1e-3 * static_cast<double>(gap_ms);
      EXPECT_NEAR(P(i, i) - P0(i, i), 0.25 * T * T, 0.05 * T * T);  // (σ T)²
    }
  }
}

TEST(Bridge, KeepsAttitudeAndVelocityWhereThereAreNoSamplesAtAll) {
  const Vec3d up = {{3.0, -2.0, std::sqrt(9.81 * 9.81 - 13.0)}};  // a body that is tilted
  const ImuBiasd bias{{{0.01, -0.02, 0.03}}, {{0.1, 0.0, -0.1}}};
  const auto across = preintegrate_across({}, Time{0}, Time{1'000'000'000}, bias, kNoise, up);
  ASSERT_TRUE(across.ok());
  EXPECT_EQ(across->missing.ns, 1'000'000'000);
  EXPECT_LT(across->integral.motion.dR.log().norm(), 1e-12);
  EXPECT_LT((across->integral.motion.dv - up).norm(), 1e-9);  // what gravity takes away
  EXPECT_LT((across->integral.motion.dp - up * 0.5).norm(), 1e-9);
}

TEST(Bridge, CountsWhatIsMissingBeforeTheFirstSampleAndAfterTheLast) {
  const auto samples = motion(100);  // 0 to 495 ms
  const auto across = preintegrate_across(samples, Time{-200'000'000}, Time{700'000'000}, {}, kNoise, kRest);
  ASSERT_TRUE(across.ok());
  EXPECT_EQ(across->missing.ns, 405'000'000);
  EXPECT_NEAR(across->integral.motion.dt, 0.9, 1e-12);
}

TEST(Bridge, RefusesAnIntervalWithoutLengthAndNoiseThatIsNotPositive) {
  const auto samples = motion(100);
  EXPECT_FALSE(preintegrate_across(samples, Time{5}, Time{5}, {}, kNoise, kRest).ok());
  EXPECT_FALSE(preintegrate_across(samples, Time{0}, Time{5'000'000}, {}, {1e-3, 0.0, 1e-4, 1e-3}, kRest).ok());
}

}  // namespace
}  // namespace oriel
