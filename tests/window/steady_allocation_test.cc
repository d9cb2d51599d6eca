// Memory that a steady window asks for: none.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "oriel/window/inertial_odometry.h"
#include "simulated_flight.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define ORIEL_COUNTS_ALLOCATIONS 0  // the sanitizer has an operator new of its own
#else
#define ORIEL_COUNTS_ALLOCATIONS 1
#endif

#if ORIEL_COUNTS_ALLOCATIONS
namespace {
std::atomic<long> g_allocations{0};
void* counted(std::size_t n) {
  ++g_allocations;
  if (void* p = std::malloc(n == 0 ? 1 : n)) return p;
  throw std::bad_alloc();
}
void* counted(std::size_t n, std::align_val_t a) {
  ++g_allocations;
  const auto align = static_cast<std::size_t>(a);
  if (void* p = std::aligned_alloc(align, (n + align - 1) / align * align)) return p;
  throw std::bad_alloc();
}
}  // namespace
void* operator new(std::size_t n) { return counted(n); }
void* operator new[](std::size_t n) { return counted(n); }
void* operator new(std::size_t n, std::align_val_t a) { return counted(n, a); }
void* operator new[](std::size_t n, std::align_val_t a) { return counted(n, a); }
void operator delete(void* p) noexcept { std::free(p); }
void operator delete[](void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }
void operator delete[](void* p, std::size_t) noexcept { std::free(p); }
void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete[](void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }
void operator delete[](void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }

namespace oriel {
namespace {

struct Count {
  long allocations = 0;
  int updates = 0;  // after the one in which the first state left
};

// Samples and updates from when the window is full.
Count steady_allocations(const SimulatedFlight& flight, bool stereo = true) {
  InertialOdometry odometry(flight.rig, stereo, flight.noise, {});
  Count count;
  std::size_t next = 0;
  for (const auto& frame : flight.frames) {
    const bool steady = odometry.left() > 0;
    const long before = g_allocations.load();
    for (; next < flight.imu.size() && flight.imu[next].time <= frame.time; ++next)
      EXPECT_TRUE(odometry.add_imu(flight.imu[next]).ok());
    const UpdateReport report = odometry.update({frame.time, frame.features});
    if (!steady) continue;
    EXPECT_EQ(report.status, UpdateReport::Status::tracking);
    count.allocations += g_allocations.load() - before;
    ++count.updates;
  }
  return count;
}

TEST(SteadyWindow, AsksForNoMemoryOnceTheFirstStateHasLeft) {
  const Count count = steady_allocations(SimulatedFlight({.rest_s = 1.2, .duration_s = 18.0, .points = 500}));
  EXPECT_GT(count.updates, 30);
  EXPECT_EQ(count.allocations, 0);
}

TEST(SteadyWindow, AsksForNoMemoryWithOneCamera) {
  const Count count = steady_allocations(SimulatedFlight({.rest_s = 1.2, .duration_s = 18.0, .points = 500}), false);
  EXPECT_GT(count.updates, 30);
  EXPECT_EQ(count.allocations, 0);
}

TEST(SteadyWindow, AsksForNoMemoryWithGrossErrorsAndAGapInTheImu) {
  SimulatedFlight flight({.rest_s = 1.2, .duration_s = 18.0, .gross_errors = 0.1, .points = 500, .seed = 4});
  const Time a = SimulatedFlight::time_of(15.02), b = SimulatedFlight::time_of(15.53);
  std::erase_if(flight.imu, [&](const ImuSample& s) { return s.time > a && s.time < b; });
  const Count count = steady_allocations(flight);
  EXPECT_GT(count.updates, 30);
  EXPECT_EQ(count.allocations, 0);
}

}  // namespace
}  // namespace oriel
#endif
