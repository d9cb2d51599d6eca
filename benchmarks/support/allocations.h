// How often this program has asked for memory: every operator new counts (allocations.cc replaces it).
#pragma once
#include <cstdint>

namespace oriel::benchmark {

std::int64_t allocation_count();

}  // namespace oriel::benchmark
