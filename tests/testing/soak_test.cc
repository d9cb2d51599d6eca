// The short form of `oriel soak`: every kind of fault once.
#include <gtest/gtest.h>

#include "oriel/testing/allocation_counter.h"
#include "oriel/testing/soak.h"

namespace oriel {
namespace {

TEST(Soak, EveryFaultIsSurvivedOrEndsInAResetThatSaysWhy) {  // W15, W17
  SoakOptions options;
  options.updates = 2050;  // one cycle
  options.seed = 7;
  options.odometry.keep_trajectory = false;
  options.odometry.keyframes.expected_tracks = options.tracks;
  options.allocations = [] { return allocation_count(); };
  const auto report = soak(options);
  ASSERT_TRUE(report) << report.error();
  ASSERT_EQ(report->faults.size(), 12u);
  for (const SoakFault& f : report->faults) {
    EXPECT_NE(f.outcome, SoakFault::Outcome::lost) << f.name << ": off by " << f.error_m << " m within a second";
    EXPECT_EQ(f.outcome == SoakFault::Outcome::reset, !f.reason.empty()) << f.name;
  }
  EXPECT_GE(report->count(SoakFault::Outcome::survived), 10);
  EXPECT_GT(report->refused_samples, 0);
  EXPECT_GE(report->tracking, report->updates * 9 / 10);
}

TEST(Soak, APlanHasEachFaultOnceInACycleAndNoneThatItCannotJudge) {
  EXPECT_EQ(soak_plan(2.0 * kSoakCycle).size(), 24u);
  for (const double seconds : {50.0, 111.0, 190.0})
    for (const SoakFault& f : soak_plan(seconds)) EXPECT_LT(f.when.to_s, seconds - 6.0);
}

TEST(Soak, AQuietWorldNeedsNoMemoryOnceTheWindowIsFull) {  // W13
  SoakOptions options;
  options.updates = 600;
  options.faults = false;
  options.slices = 3;
  options.odometry.keep_trajectory = false;
  options.odometry.keyframes.expected_tracks = options.tracks;
  options.allocations = [] { return allocation_count(); };
  const auto report = soak(options);
  ASSERT_TRUE(report) << report.error();
  ASSERT_EQ(report->slices.size(), 3u);
  if (counts_allocations()) {
    EXPECT_EQ(report->slices.back().allocations, 0);
  }
  EXPECT_EQ(report->failed, 0);
  EXPECT_TRUE(report->resets.empty());
}

}  // namespace
}  // namespace oriel
