// What marginalization hands from the graph to its sums: evaluated rows, old priors; and what it gets back.
#pragma once
#include <cstdint>
#include <vector>

#include "oriel/residual/batch.h"
#include "oriel/residual/loss.h"
#include "oriel/window/marginal_scope.h"

namespace oriel {

// Evaluated rows of one table. Invalid lanes hold zeros.
struct AbsorbedBatch {
  static constexpr int kLargestArity = 16;
  struct Argument {
    int dim = 0, column = 0;  // of J; constants are left out
  };
  const Batch* batch = nullptr;
  int arguments = 0;
  Argument argument[kLargestArity];
  // Place in the scope's variables of argument a of lane l: variable[l * kLargestArity + a].
  std::int32_t variable[Batch::kRows * kLargestArity];
};

// Is the whitened residual of lane l longer than t? A loss grows with the residual, so a cost above the threshold's
// says so; where the loss has ended, and gives it no weight, it is out in any case.
inline bool is_outlier(const Batch& batch, int l, const Loss& loss, double t) {
  if (batch.cost[l] > 0.5 * evaluate_loss(loss, t * t).rho) return true;
  return loss.kind != LossKind::none && batch.weight[l] == 0.0;
}

// An old prior at the point of linearization: r + R δ, column by column of the scope's component (-1: no column).
struct AbsorbedPrior {
  int rows = 0, cols = 0;
  const double* R = nullptr;  // rows × cols
  const double* r = nullptr;  // rows
  const std::int32_t* target = nullptr;
};

// A scalar that no absorbed factor determines, given all that are eliminated before it.
struct UndeterminedColumn {
  std::uint32_t variable = 0;  // in the scope
  int tangent = 0;
};

// r = d + R δ of what stays.
struct SquareRootRows {
  int rows = 0, cols = 0;
  std::vector<double> R, d;                      // rows × cols, column-major; rows
  std::vector<UndeterminedColumn> undetermined;  // leaving scalars
  // Where asked for, the rows that leave, p(leaving | staying): r = d + R δ over all columns of the component, leaving
  // ones first. What landmarks that are eliminated on their own said is in them; the landmarks themselves are not.
  bool keep_conditional = false;
  int conditional_rows = 0;
  std::vector<double> conditional_R, conditional_d;
};

}  // namespace oriel
