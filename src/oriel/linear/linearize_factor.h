// The linearization of one factor at the graph's values: for reports, for tests, and for whoever wants to see why a
// factor pulls where it does. The solver never goes this way (linearize.h).
#pragma once
#include <vector>

#include "oriel/base/result.h"
#include "oriel/graph/graph.h"

namespace oriel {

struct FactorLinearization {
  std::vector<VariableKey> variables;  // those with columns, in the order of the residual's
  int rows = 0, cols = 0;
  std::vector<double> residual;  // rows: whitened, and scaled by the robust weight; zeros where it is not valid
  std::vector<double> jacobian;  // rows × cols, column-major, by the tangents at zero; the same scaling
  double cost = 0.0;             // ½ρ
  bool valid = false;            // the factor counts at this point
  bool finite = true;            // false: r or J held a NaN or an infinity; then it is not valid either
};

// Jacobians at first estimates where there are any, if `first_estimates` (decision 9). An error for a stale id.
Result<FactorLinearization> linearize_factor(const Graph& graph, FactorId id, bool first_estimates = true);

}  // namespace oriel
