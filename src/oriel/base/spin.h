// To look for something again and again instead of sleeping: a core that sleeps is tens of microseconds late, and
// whoever wakes it pays as much.
#pragma once
#include <chrono>
#include <thread>
#if defined(__x86_64__) || defined(__i386__)
#include <immintrin.h>
#endif

namespace oriel {

// Leaves what two hardware threads of one core share to the other one.
inline void relax() {
#if defined(__x86_64__) || defined(__i386__)
  _mm_pause();
#endif
}

struct Pace {
  int looks = 32;  // until it gives way: where there are more threads than cores, another may have the work
  int pauses = 1;  // between two looks; more where a look costs more
};

// Whether there() came true within that time.
template <class F>
bool spin_until(std::chrono::nanoseconds time, Pace pace, F&& there) {
  const auto end = std::chrono::steady_clock::now() + time;
  do {
    for (int i = 0; i < pace.looks; ++i) {
      if (there()) return true;
      for (int k = 0; k < pace.pauses; ++k) relax();
    }
    std::this_thread::yield();
  } while (std::chrono::steady_clock::now() < end);
  return there();
}

}  // namespace oriel
