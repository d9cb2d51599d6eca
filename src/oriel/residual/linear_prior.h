// LinearPrior: the Gaussian that marginalization leaves, in square-root form about a linearization point x̂:
//   r(x) = d + R (x ⊟ x̂),   cost ½‖r‖².
// R is trapezoidal or any m × n; its ⊟ is linearized once, at x̂, so the Jacobian is R wherever x goes (first estimates;
// Demmel et al., "Square Root Marginalization for Sliding-Window Bundle Adjustment", ICCV 2021, section 4).
#pragma once
#include <cstddef>
#include <span>
#include <vector>

namespace oriel {

// The numbers of a prior, in memory that someone else owns. Variable k has tangent columns [column_k, column_k +
// dim_k).
struct LinearPriorView {
  int rows = 0, cols = 0;
  const double* R = nullptr;  // rows × cols, column-major
  const double* d = nullptr;  // rows
};

// r = d + R e with e = x ⊟ x̂ of all variables.
inline void evaluate_prior(const LinearPriorView& p, const double* e, double* r) {
  for (int i = 0; i < p.rows; ++i) r[i] = p.d[i];
  for (int j = 0; j < p.cols; ++j)
    for (int i = 0; i < p.rows; ++i) r[i] += p.R[static_cast<std::size_t>(j) * p.rows + i] * e[j];
}

// Removes columns by marginalizing them: the rows that Householder reflections leave without those columns are the
// prior of the rest (exact; nothing is lost and nothing invented). `leaves[j]` marks column j. A column that no row
// touches leaves no trace. R and d are replaced by (rows', cols'); returns rows'.
int marginalize_columns(int rows, int cols, const std::vector<char>& leaves, std::vector<double>& R,
                        std::vector<double>& d);

}  // namespace oriel
