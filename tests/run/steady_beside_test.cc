// Memory that a caller asks for whose steady window is solved in a process: hardly any.
#include <gtest/gtest.h>

#include "oriel/run/beside_engine.h"
#include "oriel/testing/allocation_counter.h"
#include "oriel/window/inertial_odometry.h"
#include "window/simulated_flight.h"

namespace oriel {
namespace {

TEST(SteadyWindowBeside, AsksForHardlyAnyMemoryWhereAProcessSolvesIt) {
  if (!counts_allocations()) GTEST_SKIP() << "a sanitizer has an operator new of its own";
  Zygote zygote = Zygote::start({&SolveBeside::kTask}).value();
  const SimulatedFlight flight({.rest_s = 1.2, .duration_s = 18.0, .points = 500});
  InertialOdometry odometry(flight.rig, true, flight.noise, {});
  ExecutorOptions options;
  options.zygote = &zygote;
  auto engine = BesideEngine::make(odometry.window().followed(), ExecutorKind::process, options);
  ASSERT_TRUE(engine) << engine.error();
  ASSERT_TRUE(odometry.window().use(std::move(*engine)));
  std::int64_t asked = 0;
  int updates = 0;
  std::size_t next = 0;
  for (std::size_t k = 0; k < flight.frames.size(); ++k) {
    const bool counts = k > flight.frames.size() * 2 / 3;  // most messages have reached their sizes
    const std::int64_t before = allocation_count();
    for (; next < flight.imu.size() && flight.imu[next].time <= flight.frames[k].time; ++next)
      EXPECT_TRUE(odometry.add_imu(flight.imu[next]));
    const UpdateReport report = odometry.update({flight.frames[k].time, flight.frames[k].features});
    if (!counts) continue;
    EXPECT_EQ(report.status, UpdateReport::Status::tracking);
    asked += allocation_count() - before;
    ++updates;
  }
  EXPECT_GT(updates, 50);
  EXPECT_LE(asked, updates / 2);
}

}  // namespace
}  // namespace oriel
