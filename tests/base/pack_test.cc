#include "oriel/base/pack.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace oriel {
namespace {

double ulp(double x) { return std::nextafter(std::fabs(x), std::numeric_limits<double>::infinity()) - std::fabs(x); }

TEST(Pack, TakesTheArcTangentWithinTwoUnitsInTheLastPlace) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> angle(-3.2, 3.2), log_radius(-3.0, 3.0);
  double worst = 0.0;
  for (int k = 0; k < 30000; ++k) {
    Pack x, y;
    for (int l = 0; l < Pack::kLanes; ++l) {
      // All around, close to zero, and close to the axes, where the quadrant changes.
      const double a = k % 3 == 0   ? angle(random)
                       : k % 3 == 1 ? 1e-6 * angle(random)
                                    : (l % 5 - 2) * 1.5707963267948966 + 1e-9 * angle(random);
      const double radius = std::exp(log_radius(random));
      x.set(l, radius * std::cos(a));
      y.set(l, radius * std::sin(a));
    }
    const Pack r = atan2(y, x);
    for (int l = 0; l < Pack::kLanes; ++l) {
      const double expected = std::atan2(y[l], x[l]);
      worst = std::fmax(worst, std::fabs(r[l] - expected) / ulp(expected));
    }
  }
  EXPECT_LE(worst, 2.0);
}

TEST(Pack, KnowsTheArcTangentOnTheAxes) {
  EXPECT_EQ(atan2(Pack(0.0), Pack(0.0))[0], 0.0);
  EXPECT_EQ(atan2(Pack(0.0), Pack(2.0))[0], 0.0);
  EXPECT_EQ(atan2(Pack(2.0), Pack(0.0))[0], std::atan2(2.0, 0.0));
  EXPECT_EQ(atan2(Pack(-2.0), Pack(0.0))[0], std::atan2(-2.0, 0.0));
  EXPECT_EQ(atan2(Pack(0.0), Pack(-2.0))[0], std::atan2(0.0, -2.0));
  EXPECT_TRUE(std::isnan(atan2(Pack(std::numeric_limits<double>::infinity()), Pack(1.0))[0]));
  EXPECT_TRUE(std::isnan(atan2(Pack(1.0), Pack(std::nan("")))[0]));
}

// Whatever registers it is made of: each lane has the bits of the same operation on one double.
TEST(Pack, IsEightDoubles) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> number(-2.0, 2.0);
  for (int k = 0; k < 100; ++k) {
    double x[Pack::kLanes], y[Pack::kLanes], back[Pack::kLanes + 1];
    for (int l = 0; l < Pack::kLanes; ++l) x[l] = number(random), y[l] = l % 3 == 0 ? x[l] : number(random);
    const Pack a = Pack::load(x), b = Pack::load(y);
    const Pack sum = a + b, difference = a - b, product = a * b, quotient = a / b, negative = -a;
    const auto less = a<b, at_most = a <= b, greater = a> b, at_least = a >= b;
    const Pack chosen = select(less | !at_least, a, b), root = sqrt(a * a);
    for (int l = 0; l < Pack::kLanes; ++l) {
      EXPECT_EQ(sum[l], x[l] + y[l]);
      EXPECT_EQ(difference[l], x[l] - y[l]);
      EXPECT_EQ(product[l], x[l] * y[l]);
      EXPECT_EQ(quotient[l], x[l] / y[l]);
      EXPECT_EQ(negative[l], -x[l]);
      EXPECT_EQ(root[l], std::sqrt(x[l] * x[l]));
      EXPECT_EQ(less[l], x[l] < y[l]);
      EXPECT_EQ(at_most[l], x[l] <= y[l]);
      EXPECT_EQ(greater[l], x[l] > y[l]);
      EXPECT_EQ(at_least[l], x[l] >= y[l]);
      EXPECT_EQ(chosen[l], x[l] < y[l] ? x[l] : y[l]);
      EXPECT_EQ(bits(less) >> l & 1u, x[l] < y[l] ? 1u : 0u);
    }
    EXPECT_EQ(bits(less & greater), 0u);
    const unsigned some = static_cast<unsigned>(random() & 0xff);
    EXPECT_EQ(bits(mask_of(some)), some);
    back[Pack::kLanes] = 7.0;
    product.store(back);
    for (int l = 0; l < Pack::kLanes; ++l) EXPECT_EQ(back[l], product[l]);
    EXPECT_EQ(back[Pack::kLanes], 7.0);
  }
}

TEST(Pack, ComputesEachLaneWithoutItsNeighbours) {
  Pack a(0.3), b(0.3);
  for (int l = 1; l < Pack::kLanes; ++l) b.set(l, std::nan(""));
  EXPECT_EQ(atan2(a, Pack(0.7))[0], atan2(b, Pack(0.7))[0]);
  EXPECT_EQ(sqrt(a)[0], sqrt(b)[0]);
}

}  // namespace
}  // namespace oriel
