#include "oriel/base/chi_squared.h"

#include <gtest/gtest.h>

#include <cmath>

namespace oriel {
namespace {

TEST(ChiSquared, HasTheProbabilitiesThatClosedFormsGive) {
  for (double x = 0.01; x < 60.0; x *= 1.3) {
    EXPECT_NEAR(chi_squared_probability(x, 1), std::erf(std::sqrt(0.5 * x)), 1e-14);
    EXPECT_NEAR(chi_squared_probability(x, 2), 1.0 - std::exp(-0.5 * x), 1e-14);
    const double h = 0.5 * x;  // even: 1 - e^-h Σ h^k / k!, k < dof / 2
    EXPECT_NEAR(chi_squared_probability(x, 6), 1.0 - std::exp(-h) * (1.0 + h + 0.5 * h * h), 1e-14);
  }
  EXPECT_EQ(chi_squared_probability(0.0, 3), 0.0);
}

TEST(ChiSquared, HasTheQuantilesOfTheTables) {
  EXPECT_NEAR(chi_squared_threshold(0.95, 1), 3.841459, 1e-6);
  EXPECT_NEAR(chi_squared_threshold(0.99, 2), 9.210340, 1e-6);
  EXPECT_NEAR(chi_squared_threshold(0.999, 3), 16.26624, 1e-5);
  EXPECT_NEAR(chi_squared_threshold(0.95, 29), 42.55697, 1e-5);
  EXPECT_NEAR(chi_squared_threshold(0.05, 100), 77.92947, 1e-5);
}

}  // namespace
}  // namespace oriel
