// Batch: what a table of factors makes of up to 64 of its rows at a point, as structure of arrays. It is all that the
// linear algebra ever sees of a residual: dimensions, never types.
#pragma once
#include <cstdint>

namespace oriel {

struct Batch {
  static constexpr int kRows = 64;  // lanes; a multiple of Pack::kLanes

  int rows = 0;  // lanes in use
  int dim = 0;   // rows of each residual
  int cols = 0;  // columns of each Jacobian, over all variables that are not constants

  // Whitened and scaled by √ρ'. Component i of lane l: r[i * kRows + l]. Entry (i, c): J[(c * dim + i) * kRows + l].
  // Invalid lanes hold zeros. Both are lent by the caller, 64-byte aligned, J null where only costs are wanted.
  double* r = nullptr;
  double* J = nullptr;
  double cost[kRows];            // ½ρ(‖r‖²); 0 where invalid
  double weight[kRows];          // √ρ', in tables with losses alone
  std::uint64_t valid = 0;       // bit l: lane l is valid at this point
  std::uint64_t not_finite = 0;  // bit l: r or J of lane l was NaN or infinite; then it is not valid either
};

}  // namespace oriel
