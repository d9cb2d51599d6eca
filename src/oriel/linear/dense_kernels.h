// Dense kernels of the factorization: column-major, double, one instruction set a build (AVX-512, AVX or SSE2).
//
// Layout that all of them share: a matrix with n rows has a leading dimension that is a multiple of 8 and at least
// round_up_8(n), and starts 64-byte aligned. The kernels work on whole vectors of rows, so they read and write the
// padding rows [n, round_up_8(n)) of a column; what stands there never reaches a row below n, but it should be zero
// (denormals would be slow).
#pragma once
#include <cstdint>

#include "oriel/linear/task_pool.h"

namespace oriel::dense {

constexpr int round_up_8(int n) { return (n + 7) & ~7; }
constexpr int round_down_8(int n) { return n & ~7; }

// An odd number of cache lines from 64 rows on: consecutive columns then fall into different sets of the L1 cache.
constexpr int leading_dimension(int n) {
  const int lines = round_up_8(n > 0 ? n : 1) / 8;
  return 8 * (lines >= 8 && lines % 2 == 0 ? lines + 1 : lines);
}

// The first p columns of a front with n rows: panel = [A11; A21] (n × p, lower) becomes [L11; L21] with
// A11 = L11 L11ᵀ, A21 = L21 L11ᵀ. A pivot that is not above threshold[j] is undetermined: its column of L, diagonal
// included, and inverse_diagonal[j] become 0, which removes the row and column from the system and disturbs no other.
// Non-finite input leaves a non-finite diagonal behind. inverse_diagonal: p values 1/L_jj.
void factor_panel(double* panel, std::int64_t ld, int n, int p, const double* threshold, double* inverse_diagonal,
                  TaskPool* pool = nullptr);

// The update matrix of a front, U = -L21 L21ᵀ (m × m, lower, m = n - p), from the factored panel. Row i of the front
// is row i - round_down_8(p) of U's storage and column j its column j - p, so that rows of panel and U share their
// vector boundaries: element (i, j) of the front, i >= j >= p, is update[(i - round_down_8(p)) + (j - p)·update_ld].
void form_update(const double* panel, std::int64_t ld, int n, int p, double* update, std::int64_t update_ld,
                 TaskPool* pool = nullptr);
constexpr int update_leading_dimension(int n, int p) { return leading_dimension(n - round_down_8(p)); }

// C -= A Aᵀ, lower triangle (whole vector tiles at the diagonal, so some elements above it change, too).
// C: n × n, A: n × k.
void syrk_lower_minus(double* c, std::int64_t ldc, int n, const double* a, std::int64_t lda, int k,
                      TaskPool* pool = nullptr);

// C -= A Bᵀ. C: m × n, A: m × k, B: n × k; rows of C and A padded as above, B is read exactly.
void gemm_minus(double* c, std::int64_t ldc, int m, int n, const double* a, std::int64_t lda, const double* b,
                std::int64_t ldb, int k, TaskPool* pool = nullptr);

// v := [L11⁻¹ v1; v2 - L21 L11⁻¹ v1] for a factored panel; v has n values, padded with zeros to round_up_8(n).
void solve_panel_lower(const double* panel, std::int64_t ld, int n, int p, const double* inverse_diagonal, double* v,
                       TaskPool* pool = nullptr);
// v1 := L11⁻ᵀ (v1 - L21ᵀ v2); same shapes.
void solve_panel_upper(const double* panel, std::int64_t ld, int n, int p, const double* inverse_diagonal, double* v,
                       TaskPool* pool = nullptr);

// y += x and y = x for n values, where n is small: rows of blocks.
void add(double* y, const double* x, int n);
void copy(double* y, const double* x, int n);

}  // namespace oriel::dense
