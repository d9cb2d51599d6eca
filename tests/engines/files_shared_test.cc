// Both engines on the public data sets.
#include <gtest/gtest.h>

#include <string>

#include "engines/two_engines.h"

namespace oriel {
namespace {

// C8
TEST(CeresEngine, HasTheCostAndTheOptimumOfNativeOnM3500) {
  expect_same_cost_and_optimum(std::string(ORIEL_SHARED_DIR) + "/g2o/2d/M3500.g2o");
}

// C8
TEST(CeresEngine, HasTheCostAndTheOptimumOfNativeOnParkingGarage) {
  expect_same_cost_and_optimum(std::string(ORIEL_SHARED_DIR) + "/g2o/3d/parking-garage.g2o");
}

}  // namespace
}  // namespace oriel
