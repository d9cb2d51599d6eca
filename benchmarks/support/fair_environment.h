// One thread for every BLAS. The libraries read these variables when they are loaded, so a program that was started
// without them starts itself again: CHOLMOD ignores OMP_NUM_THREADS, and with two threads Ceres gets 2 to 4 times
// slower here, which would be a figure at the rival's worst setting.
#pragma once
#include <unistd.h>

#include <cstdlib>
#include <cstring>

namespace oriel::benchmark {

inline void require_single_threaded_blas(char** argv) {
  const char* limit = std::getenv("OMP_THREAD_LIMIT");
  const char* blas = std::getenv("OPENBLAS_NUM_THREADS");
  if (limit != nullptr && blas != nullptr && std::strcmp(limit, "1") == 0 && std::strcmp(blas, "1") == 0) return;
  setenv("OMP_THREAD_LIMIT", "1", 1);
  setenv("OMP_NUM_THREADS", "1", 1);
  setenv("OPENBLAS_NUM_THREADS", "1", 1);
  execv("/proc/self/exe", argv);  // comes back only if it fails; then the figures are what they are
}

}  // namespace oriel::benchmark
