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

// Solves where it is finished, and counts what it asks for itself.
class SolvesLater final : public DeferredSolver {
 public:
  SolvesLater(Graph& graph, std::int64_t& allocations) : engine_(graph), allocations_(&allocations) {}
  std::string_view name() const override { return "later"; }
  Result<void> begin(const SolveOptions& options) noexcept override {
    options_ = options;
    return {};
  }
  bool is_running() noexcept override { return true; }
  Summary finish() noexcept override {
    const std::int64_t before = allocation_count();
    Summary summary = engine_.solve(options_);
    *allocations_ += allocation_count() - before;
    return summary;
  }

 private:
  NativeEngine engine_;
  SolveOptions options_;
  std::int64_t* allocations_;
};

// Samples and updates from when the window is full.
Count steady_allocations(const SimulatedFlight& flight, bool stereo = true, const OdometryOptions& options = {},
                         bool defer = false) {
  InertialOdometry odometry(flight.rig, stereo, flight.noise, options);
  std::int64_t by_solver = 0;
  if (defer) {
    WindowCore& window = odometry.window();
    EXPECT_TRUE(window.defer_to(std::make_unique<SolvesLater>(window.followed(), by_solver)));
  }
  Count count;
  std::size_t next = 0;
  for (const auto& frame : flight.frames) {
    const bool steady = odometry.left() > 0;
    const std::int64_t before = allocation_count() - by_solver;
    for (; next < flight.imu.size() && flight.imu[next].time <= frame.time; ++next)
      EXPECT_TRUE(odometry.add_imu(flight.imu[next]).ok());
    const UpdateReport report = odometry.update({frame.time, frame.features});
    if (!steady) continue;
    EXPECT_EQ(report.status, UpdateReport::Status::tracking);
    EXPECT_EQ(report.predicted, defer);
    count.allocations += allocation_count() - by_solver - before;
    ++count.updates;
  }
  return count;
}

TEST_F(SteadyWindow, AsksForNoMemoryOnceTheFirstStateHasLeft) {
  const Count count = steady_allocations(SimulatedFlight({.rest_s = 1.2, .duration_s = 18.0, .points = 500}));
  EXPECT_GT(count.updates, 30);
  EXPECT_EQ(count.allocations, 0);
}

TEST_F(SteadyWindow, AsksForNoMemoryBesidesItsSolversWhereSolvesAreDeferred) {
  const Count count =
      steady_allocations(SimulatedFlight({.rest_s = 1.2, .duration_s = 18.0, .points = 500}), true, {}, true);
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
