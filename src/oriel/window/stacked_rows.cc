#include "oriel/window/stacked_rows.h"

#include <algorithm>
#include <cmath>

#include "oriel/linear/dot.h"

namespace oriel {

void StackedRows::begin(const MarginalScope& scope, const MarginalComponent& component, int rows) {
  scope_ = &scope, component_ = &component;
  capacity_ = (rows + 7) / 8 * 8;
  rows_ = 0;
  const int columns = component.landmark_dim + component.dim() + 1;
  a_.assign(static_cast<std::size_t>(capacity_) * columns, 0.0);
  empty_.assign(columns, 0);
}

void StackedRows::add(const AbsorbedBatch& b) {
  const Batch& batch = *b.batch;
  const int landmarks = component_->landmark_dim, right = landmarks + component_->dim();
  for (int l = 0; l < batch.rows; ++l) {
    if (((batch.valid >> l) & 1) == 0) continue;
    for (int a = 0; a < b.arguments; ++a) {
      const MarginalVariable& v = scope_->variables()[b.variable[l * AbsorbedBatch::kLargestArity + a]];
      if (!v.has_columns()) continue;
      for (int i = 0; i < v.dim; ++i) {
        double* const to = column((v.eliminated ? 0 : landmarks) + v.column + i) + rows_;
        const double* const from = batch.J + (b.argument[a].column + i) * batch.dim * Batch::kRows + l;
        for (int r = 0; r < batch.dim; ++r) to[r] += from[r * Batch::kRows];
      }
    }
    for (int r = 0; r < batch.dim; ++r) column(right)[rows_ + r] = batch.r[r * Batch::kRows + l];
    rows_ += batch.dim;
  }
}

void StackedRows::add(const AbsorbedPrior& p) {
  const int landmarks = component_->landmark_dim, right = landmarks + component_->dim();
  for (int c = 0; c < p.cols; ++c)
    if (p.target[c] >= 0)
      std::copy_n(p.R + static_cast<std::size_t>(c) * p.rows, p.rows, column(landmarks + p.target[c]) + rows_);
  std::copy_n(p.r, p.rows, column(right) + rows_);
  rows_ += p.rows;
}

// Golub & Van Loan, Matrix Computations, algorithm 5.1.1, without pivoting: a column without a pivot takes no row, so
// what it says about later columns stays.
int StackedRows::reduce(int from, int to, int used) {
  const int right = component_->landmark_dim + component_->dim();
  for (int c = from; c < to; ++c) {
    double* const v = column(c);
    const double whole = std::sqrt(dot(v, v, rows_)), norm = std::sqrt(dot(v + used, v + used, rows_ - used));
    if (!(norm > kNegligible * whole)) {
      empty_[c] = 1;
      std::fill(v + used, v + rows_, 0.0);
      continue;
    }
    const double beta = v[used] > 0.0 ? -norm : norm, v0 = v[used] - beta, scale = 1.0 / (beta * v0);
    v[used] = v0;
    for (int j = c + 1; j <= right; ++j) {
      double* const x = column(j) + used;
      const double s = scale * dot(v + used, x, rows_ - used);
      if (s == 0.0) continue;
      for (int i = 0; i < rows_ - used; ++i) x[i] += s * v[used + i];
    }
    v[used] = beta;
    std::fill(v + used + 1, v + rows_, 0.0);
    if (++used == rows_) {
      std::fill(empty_.begin() + c + 1, empty_.begin() + to, 1);
      break;
    }
  }
  return used;
}

void StackedRows::finish(SquareRootRows& out) {
  const int first = component_->landmark_dim + component_->leaving_dim, right = first + component_->staying_dim;
  const int used = reduce(0, first, 0);
  const int rank = used < rows_ ? reduce(first, right, used) - used : 0;
  out.undetermined.clear();
  for (std::uint32_t o = component_->variables_begin; o < component_->variables_end; ++o) {
    const MarginalVariable& v = scope_->variables()[scope_->ordered()[o]];
    if (!v.eliminated && v.column >= component_->leaving_dim) break;
    const int column = (v.eliminated ? 0 : component_->landmark_dim) + v.column;
    for (int i = 0; i < v.dim; ++i)
      if (empty_[column + i]) out.undetermined.push_back({scope_->ordered()[o], i});
  }
  out.rows = rank, out.cols = component_->staying_dim;
  out.R.resize(static_cast<std::size_t>(rank) * out.cols);
  for (int c = 0; c < out.cols; ++c)
    std::copy_n(column(first + c) + used, rank, out.R.begin() + static_cast<std::ptrdiff_t>(c) * rank);
  out.d.assign(column(right) + used, column(right) + used + rank);
}

}  // namespace oriel
