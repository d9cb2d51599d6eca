// Clocks of the benchmarks, in seconds.
#pragma once
#include <time.h>

namespace oriel::benchmark {

inline double seconds_of(clockid_t clock) {
  timespec t{};
  clock_gettime(clock, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}
inline double wall_seconds() { return seconds_of(CLOCK_MONOTONIC); }
// CPU time of this thread alone: what other processes of the machine take is not in it.
inline double cpu_seconds() { return seconds_of(CLOCK_THREAD_CPUTIME_ID); }

}  // namespace oriel::benchmark
