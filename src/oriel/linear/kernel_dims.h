// The dimensions of variables for which products have kernels of fixed size, and up to which sums by landmark are made.
#pragma once
#include <cstddef>

namespace oriel {

inline constexpr int kLargestKernelDim = 9, kKernelDims = 6;
inline constexpr int kLargestLandmarkDim = 3;
inline constexpr std::size_t kMostLandmarkArguments = 4;  // of a table, the landmark included

// 1, 2, 3, 6, 7, 9 → 0 … 5; -1 for any other: no kernel.
constexpr int kernel_index(int dim) {
  constexpr int kIndex[kLargestKernelDim + 1] = {-1, 0, 1, 2, -1, -1, 3, 4, -1, 5};
  return dim < 0 || dim > kLargestKernelDim ? -1 : kIndex[dim];
}

}  // namespace oriel
