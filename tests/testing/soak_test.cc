// The short form of `oriel soak`: every kind of fault once.
#include <gtest/gtest.h>

#include <cmath>

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
  if (counts_allocations()) {  // a sanitizer keeps what is freed
    EXPECT_LT(report->memory_growth_mb(), 1.0);
  }
}

TEST(Soak, OneCameraSurvivesEveryFaultAndALongRestToo) {  // W15, W17
  SoakOptions options;
  options.updates = 2450;  // a cycle, and the first faults after its rest
  options.seed = 2;
  options.stereo = false;
  options.odometry.keep_trajectory = false;
  options.odometry.keyframes.expected_tracks = options.tracks;
  const auto report = soak(options);
  ASSERT_TRUE(report) << report.error();
  ASSERT_GE(report->faults.size(), 14u);
  for (const SoakFault& f : report->faults)
    EXPECT_NE(f.outcome, SoakFault::Outcome::lost) << f.name << ": off by " << f.error_m << " m within a second";
}

TEST(Soak, GrowthIsOfTheLastSliceSinceTheFirstHadItsMemory) {
  SoakReport r;
  for (const double mb : {30.0, 31.0, 29.5, 33.0}) {
    SoakSlice s;
    s.resident_mb = mb, s.p999_ms = mb / 10.0;
    r.slices.push_back(s);
  }
  EXPECT_DOUBLE_EQ(r.memory_growth_mb(), 3.0);
  EXPECT_DOUBLE_EQ(r.latency_growth(), 33.0 / 31.0);
  r.slices.resize(2);
  EXPECT_TRUE(std::isnan(r.memory_growth_mb()) && std::isnan(r.latency_growth()));
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
