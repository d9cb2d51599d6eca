// How often this program has asked for memory (behaviour of the window and of solves: never in a steady update). Only a
// program that links oriel_allocation_counter has these functions, and an operator new that counts.
#pragma once
#include <cstdint>

namespace oriel {

// False where the operator new is that of a sanitizer, which sees more than a count; then the count stays 0.
bool counts_allocations();
// Calls of operator new by all threads, so far.
std::int64_t allocation_count();

}  // namespace oriel
