// How often this program has asked for memory: its operator new counts (behaviour of the window: none in a steady
// update).
#pragma once
#include <cstdint>

namespace oriel::apps {

std::int64_t allocation_count();  // by all threads, so far

}  // namespace oriel::apps
