// Square roots for priors: R and d with cost ½‖d + R x‖² or ½‖R x - d‖², by orthogonal transformation of stacked rows
// or by Cholesky of an information matrix. No allocation: the caller gives the workspace.
#pragma once
#include <cstdint>

namespace oriel {

// Doubles that householder_qr needs beside its arguments.
std::int64_t qr_workspace_size(int m, int n);

// A = Q [R; 0] by Householder reflections, eight to a block (R. Schreiber, C. Van Loan, "A storage-efficient WY
// representation for products of Householder transformations", SIAM J. Sci. Stat. Comput. 10, 1989, eq. 3).
// In: A, m × n, lda a multiple of 8 and >= m, rows [m, round_up_8(m)) zero; b, round_up_8(m) values, zero from m on,
// or null. Out: R in the first min(m, n) rows of A, upper trapezoidal, zeros below; its diagonal has either sign;
// b := Qᵀ b, so that ‖A x - b‖² = ‖R x - b1‖² + ‖b2‖². Without pivoting: a dependent column leaves a diagonal entry
// near 0. Returns false if the result is not finite.
bool householder_qr(double* a, std::int64_t lda, int m, int n, double* b, double* workspace);

struct SquareRoot {
  int rank = 0;                 // rows of R
  bool finite = true;           // false: the input was not, R and d mean nothing
  double smallest_ratio = 1.0;  // pivot / diagonal, over the pivots that were kept
};

// Doubles that square_root_of_information needs beside its arguments.
std::int64_t square_root_workspace_size(int n);

// H = RᵀR and Rᵀd = g for a positive semidefinite H (n × n, lower triangle read, ldh a multiple of 8; overwritten) and
// a g in its range (round_up_8(n) values, zero from n on; overwritten). R: rank × n, column-major with ldr >= n, upper
// trapezoidal: a pivot at or below `relative_pivot` times its diagonal is a direction without information, whose row is
// left out. d: rank values.
SquareRoot square_root_of_information(double* h, std::int64_t ldh, int n, double* g, double relative_pivot, double* r,
                                      std::int64_t ldr, double* d, double* workspace);

}  // namespace oriel
