// Both engines on whole problems: the three that come with the project.
#include <gtest/gtest.h>

#include <string>

#include "engines/two_engines.h"

namespace oriel {
namespace {

// C8
TEST(CeresEngine, HasTheCostAndTheOptimumOfNativeOnIntel) {
  expect_same_cost_and_optimum(std::string(ORIEL_DATA_DIR) + "/intel.g2o");
}

// C8
TEST(CeresEngine, HasTheCostAndTheOptimumOfNativeOnSphere2500) {
  expect_same_cost_and_optimum(std::string(ORIEL_DATA_DIR) + "/sphere2500.g2o");
}

// C8
TEST(CeresEngine, HasTheCostAndTheOptimumOfNativeOnABundleAdjustment) {
  expect_optimum_confirmed(std::string(ORIEL_DATA_DIR) + "/problem-49-7776-pre.txt");
}

}  // namespace
}  // namespace oriel
