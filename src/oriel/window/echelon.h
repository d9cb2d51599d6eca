// Householder reflections of stacked rows to echelon form: what QR marginalization, untying and the late ledger share.
#pragma once
#include <cstddef>

namespace oriel {

// Columns stand `stride` apart; `rows` of each are in use.
struct StackedColumns {
  double* data = nullptr;
  std::size_t stride = 0;
  int rows = 0;
  double* column(int c) const { return data + static_cast<std::size_t>(c) * stride; }
};

// What is left of a column, against all of it, is rounding error at this ratio: nothing determines it.
inline constexpr double kNegligibleColumn = 1e-13;

// Brings columns [from, to) to echelon form, by reflections of the rows from `used` on that are applied to all columns
// up to `end`. A column without a pivot takes no row, so what it says about later columns stays; empty[c] tells it.
// Returns the rows used. Golub & Van Loan, Matrix Computations, algorithm 5.1.1, without pivoting.
int reduce_to_echelon(const StackedColumns& a, int from, int to, int end, int used, char* empty);

// Entries of a column that are rounding error against all of it become zeros: they would tie a variable to rows that
// say nothing of it, and these would be lost when it leaves.
void forget_rounding(double* x, int n, double whole);
// Of rows [first, last) of columns [from, to) of echelon form.
void forget_rounding(const StackedColumns& a, int from, int to, int first, int last);

// n triangular rows above m others, in columns of n + m: reflections of row j with the m bring their first n columns to
// zero, and are applied to all `columns`. Where what the m rows have in column j is rounding error against whole[j],
// there is no reflection.
void eliminate_rows(double* a, int n, int m, int columns, const double* whole);

// x := -R⁻¹ x for the upper triangle in the first n rows of columns of `stride`; 0 where its diagonal is.
void solve_upper_minus(const double* R, int stride, int n, double* x);

}  // namespace oriel
