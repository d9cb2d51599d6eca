// RᵀR of a square-root prior: what it adds to H, wherever its variables stand.
#pragma once
#include "oriel/linear/aligned_buffer.h"
#include "oriel/residual/linear_prior.h"

namespace oriel {

// Rows of R at once, turned over; the product. Both grow and are kept.
struct PriorProduct {
  AlignedBuffer rows, product;

  // product := -RᵀR (cols × cols, lower triangle, column-major with the leading dimension that is returned).
  int subtract(const LinearPriorView& prior);
};

}  // namespace oriel
