// Random operations against a dense model. Long: ORIEL_FUZZ_OPERATIONS=10000000 oriel_test_window
// --gtest_filter='WindowFuzz.*'; ORIEL_FUZZ_SEED=... beside it begins with another run, without it is that one again.
#include "window_fuzz.h"

#include <gtest/gtest.h>

#include <cstdlib>

namespace oriel {
namespace {

using namespace linear_world;

std::int64_t from_environment(const char* name, std::int64_t otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::atoll(text);
}

// M1, M10, W4, W5, W6, W7, W8, W9, W11, W12, W13, W15
TEST(WindowFuzz, FindsNoDifferenceFromADenseModelUnderRandomOperations) {
  const std::int64_t wanted = from_environment("ORIEL_FUZZ_OPERATIONS", 10000);
  const std::int64_t seed = from_environment("ORIEL_FUZZ_SEED", -1);
  std::int64_t done = 0;
  double worst = 0.0, worst_prior = 0.0;
  WindowFuzz::Counts all;
  for (unsigned run = seed < 0 ? 1 : static_cast<unsigned>(seed); done < wanted; ++run) {
    WindowFuzz fuzz(run);
    int steps = 0;
    while (!fuzz.is_over() && fuzz.step()) ++steps;
    fuzz.finish();
    ASSERT_EQ(fuzz.difference(), "") << "seed " << run << ", update " << steps << ", " << fuzz.last();
    done += fuzz.operations();
    worst = std::max(worst, fuzz.worst()), worst_prior = std::max(worst_prior, fuzz.worst_prior());
    all.add(fuzz.counts());
    if (seed >= 0 && std::getenv("ORIEL_FUZZ_OPERATIONS") == nullptr) break;
  }
  std::cout << done << " operations, " << all.updates << " updates: " << all.entered << " groups entered, "
            << all.refused << " were refused, " << all.late << " came late (with " << all.late_states
            << " states of their own), " << all.waited << " times one waited; " << all.absorbed << " factors absorbed; "
            << all.marginalized << " states marginalized, " << all.removed << " removed; " << all.closed
            << " landmarks closed, " << all.dropped << " dropped, " << all.asked << " asked to leave; "
            << all.failed_solves << " failed solves, " << all.failed_slides << " failed slides, " << all.resets
            << " resets; " << all.batches << " runs were the batch of all; largest difference " << worst
            << ", of priors " << worst_prior << '\n';
  if (seed >= 0) return;
  for (const std::int64_t n : {all.entered, all.refused, all.marginalized, all.removed, all.failed_solves, all.resets,
                               all.late, all.late_states, all.absorbed, all.dropped, all.asked, all.batches})
    EXPECT_GT(n, 0);
}

}  // namespace
}  // namespace oriel
