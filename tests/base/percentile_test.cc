#include "oriel/base/percentile.h"

#include <gtest/gtest.h>

#include <numeric>
#include <vector>

namespace oriel {
namespace {

TEST(Percentile, IsTheLeastSampleThatSoManyDoNotExceed) {
  std::vector<double> samples(1000);
  std::iota(samples.begin(), samples.end(), 1.0);
  EXPECT_EQ(percentile(samples, 0.5), 500.0);
  EXPECT_EQ(percentile(samples, 0.99), 990.0);
  EXPECT_EQ(percentile(samples, 0.999), 999.0);
  EXPECT_EQ(percentile(samples, 0.9991), 1000.0);
  EXPECT_EQ(percentile(samples, 0.0), 1.0);
  EXPECT_EQ(percentile(samples, 1.0), 1000.0);
  EXPECT_EQ(percentile(std::vector<double>{7.0}, 0.5), 7.0);
}

TEST(Percentile, OfNothingIsNotANumber) { EXPECT_TRUE(std::isnan(percentile({}, 0.5))); }

}  // namespace
}  // namespace oriel
