#include "oriel/evaluate/nees.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace oriel {
namespace {

TEST(Nees, IsTheSquaredLengthInSigmas) {
  const double error[] = {1.0, 2.0}, diagonal[] = {4.0, 0.0, 0.0, 0.25};
  EXPECT_NEAR(*normalized_error_squared(error, diagonal), 0.25 + 16.0, 1e-12);
  const double full[] = {2.0, 1.0, 1.0, 3.0};  // its inverse: [3, -1; -1, 2] / 5
  EXPECT_NEAR(*normalized_error_squared(error, full), (3.0 - 4.0 + 8.0) / 5.0, 1e-12);
}

TEST(Nees, RefusesWhatIsNoCovariance) {
  const double error[] = {1.0, 2.0}, indefinite[] = {1.0, 2.0, 2.0, 1.0}, small[] = {1.0};
  EXPECT_EQ(normalized_error_squared(error, indefinite).error().code, ErrorCode::indefinite);
  EXPECT_EQ(normalized_error_squared(error, small).error().code, ErrorCode::size_mismatch);
  const double nan[] = {std::nan(""), 1.0}, unit[] = {1.0, 0.0, 0.0, 1.0};
  EXPECT_EQ(normalized_error_squared(nan, unit).error().code, ErrorCode::not_finite);
  const double infinite[] = {std::numeric_limits<double>::infinity(), 0.0, 0.0, 1.0};
  EXPECT_FALSE(normalized_error_squared(error, infinite).ok());
}

// Tables: χ² with 30 degrees of freedom has 95 % in [16.791, 46.979], with 100 in [74.222, 129.561], with 1000 in
// [914.257, 1089.531].
TEST(Nees, HasTheIntervalsOfTheTables) {
  EXPECT_NEAR(nees_interval(3, 10).low * 10, 16.791, 0.02);
  EXPECT_NEAR(nees_interval(3, 10).high * 10, 46.979, 0.02);
  EXPECT_NEAR(nees_interval(1, 100).low * 100, 74.222, 0.03);
  EXPECT_NEAR(nees_interval(1, 100).high * 100, 129.561, 0.03);
  EXPECT_NEAR(nees_interval(10, 100).low * 100, 914.257, 0.1);
  EXPECT_NEAR(nees_interval(10, 100).high * 100, 1089.531, 0.1);
}

// Errors that are drawn from the covariance that is claimed are consistent; claimed a fifth too small, they are not.
TEST(Nees, TellsAnHonestCovarianceFromOneThatIsTooSmall) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  NeesTable honest("honest", 3, 2), proud("proud", 3, 2);
  const double P[] = {1.0, 0.5, 0.0, 0.5, 2.0, 0.3, 0.0, 0.3, 0.7};
  double small[9];
  for (int i = 0; i < 9; ++i) small[i] = P[i] * 0.8;
  for (int run = 0; run < 500; ++run)
    for (std::size_t epoch = 0; epoch < 2; ++epoch) {
      const double a = normal(random), b = normal(random), c = normal(random);
      // e = L [a b c] with P = L Lᵀ
      const double l11 = std::sqrt(1.75), l21 = 0.3 / l11, l22 = std::sqrt(0.7 - l21 * l21);
      const double e[] = {a, 0.5 * a + l11 * b, l21 * b + l22 * c};
      honest.add(epoch, *normalized_error_squared(e, P));
      proud.add(epoch, *normalized_error_squared(e, small));
    }
  EXPECT_TRUE(honest.consistent_at_end()) << honest.mean(1);
  EXPECT_NEAR(honest.mean(), 3.0, 0.2);
  EXPECT_FALSE(proud.consistent_at_end());
  EXPECT_NEAR(proud.mean() / honest.mean(), 1.25, 1e-9);
  EXPECT_EQ(honest.runs(0), 500u);
}

}  // namespace
}  // namespace oriel
