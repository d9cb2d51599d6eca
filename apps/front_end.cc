#include "apps/front_end.h"

#include <ctime>

namespace oriel::apps {
namespace {

double thread_cpu_ms() {
  timespec t{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

}  // namespace

void burn_cpu(double ms) {
  if (ms <= 0.0) return;
  for (const double end = thread_cpu_ms() + ms; thread_cpu_ms() < end;) {
  }
}

}  // namespace oriel::apps
