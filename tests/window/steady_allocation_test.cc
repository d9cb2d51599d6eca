// Memory that a steady window asks for: none.
#include <gtest/gtest.h>

#include "oriel/testing/allocation_counter.h"
#include "oriel/window/inertial_odometry.h"
#include "simulated_flight.h"

namespace oriel {
namespace {

class SteadyWindow : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!counts_allocations()) GTEST_SKIP() << "a sanitizer has an operator new of its own";
  }
};

struct Count {
  std::int64_t allocations = 0;
  int updates = 0;  // after the one in which the first state left
};

// Samples and updates from when the window is full.
Count steady_allocations(const SimulatedFlight& flight, bool stereo = true, const OdometryOptions& options = {}) {
  InertialOdometry odometry(flight.rig, stereo, flight.noise, options);
  Count count;
  std::size_t next = 0;
  for (const auto& frame : flight.frames) {
    const bool steady = odometry.left() > 0;
    const std::int64_t before = allocation_count();
    for (; next < flight.imu.size() && flight.imu[next].time <= frame.time; ++next)
      EXPECT_TRUE(odometry.add_imu(flight.imu[next]).ok());
    const UpdateReport report = odometry.update({frame.time, frame.features});
    if (!steady) continue;
    EXPECT_EQ(report.status, UpdateReport::Status::tracking);
    count.allocations += allocation_count() - before;
    ++count.updates;
  }
  return count;
}

TEST_F(SteadyWindow, AsksForNoMemoryOnceTheFirstStateHasLeft) {
  const Count count = steady_allocations(SimulatedFlight({.rest_s = 1.2, .duration_s = 18.0, .points = 500}));
  EXPECT_GT(count.updates, 30);
  EXPECT_EQ(count.allocations, 0);
}

TEST_F(SteadyWindow, AsksForNoMemoryWithOneCamera) {
  const Count count = steady_allocations(SimulatedFlight({.rest_s = 1.2, .duration_s = 18.0, .points = 500}), false);
  EXPECT_GT(count.updates, 30);
  EXPECT_EQ(count.allocations, 0);
}

TEST_F(SteadyWindow, AsksForNoMemoryWithTwoCamerasWhereLandmarksArePoints) {
  OdometryOptions options;
  options.visual.landmarks = LandmarkModel::point;
  const Count count = steady_allocations(
      SimulatedFlight({.rest_s = 1.2, .duration_s = 18.0, .gross_errors = 0.05, .points = 500}), true, options);
  EXPECT_GT(count.updates, 30);
  EXPECT_EQ(count.allocations, 0);
}

TEST_F(SteadyWindow, AsksForNoMemoryWithGrossErrorsAndAGapInTheImu) {
  SimulatedFlight flight({.rest_s = 1.2, .duration_s = 18.0, .gross_errors = 0.1, .points = 500, .seed = 4});
  const Time a = SimulatedFlight::time_of(15.02), b = SimulatedFlight::time_of(15.53);
  std::erase_if(flight.imu, [&](const ImuSample& s) { return s.time > a && s.time < b; });
  const Count count = steady_allocations(flight);
  EXPECT_GT(count.updates, 30);
  EXPECT_EQ(count.allocations, 0);
}

}  // namespace
}  // namespace oriel
