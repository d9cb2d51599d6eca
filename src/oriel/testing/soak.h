// Hours of visual-inertial odometry in a simulated world that goes wrong all the time: does it last? Every fault must
// be survived or end in a reset that says why; memory and latency must not grow.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "oriel/base/function.h"
#include "oriel/testing/simulated_world.h"
#include "oriel/window/inertial_odometry.h"

namespace oriel {

struct SoakOptions {
  std::int64_t updates = 100'000;
  std::uint64_t seed = 1;
  double camera_rate_hz = 10.0;
  int tracks = 100;
  bool stereo = true;
  bool faults = true;
  int slices = 10;  // of the run, that are compared
  OdometryOptions odometry;
  Function<std::int64_t()> allocations =
      {};  // of the process so far (testing/allocation_counter.h); empty: not counted
};

// Updates that follow each other.
struct SoakSlice {
  std::int64_t updates = 0, allocations = 0;
  double p50_ms = 0.0, p99_ms = 0.0, p999_ms = 0.0, max_ms = 0.0;  // of an update, CPU time of the thread
  double resident_mb = 0.0;  // of the whole process at the end of the slice, the simulated world included
};

struct SoakFault {
  enum class Outcome { survived, reset, lost };
  std::string name;
  Interval when;  // [s]
  Outcome outcome = Outcome::lost;
  std::string reason;    // of the reset
  double error_m = 0.0;  // of the motion within one second, some seconds after the fault; NaN: there is no estimate
};

struct SoakReport {
  std::vector<SoakSlice> slices;
  std::vector<SoakFault> faults;
  std::int64_t updates = 0, tracking = 0, failed = 0, refused_samples = 0;
  std::vector<std::pair<std::string, std::int64_t>> resets;  // by reason

  int count(SoakFault::Outcome outcome) const;
  // NaN where there are fewer than three slices.
  double latency_growth() const;    // p99.9 of the last slice by that of the second: the first asks for memory
  double memory_growth_mb() const;  // from the end of the first slice on
};

// The faults of a run of so many seconds: each kind once in a cycle of kSoakCycle.
inline constexpr double kSoakCycle = 200.0;  // [s]
std::vector<SoakFault> soak_plan(double seconds);

// `progress` is called after each slice; may be empty. Error: options that make no world.
Result<SoakReport> soak(const SoakOptions& options, const Function<void(const SoakReport&)>& progress = {});

}  // namespace oriel
