#include "oriel/window/stacked_rows.h"

#include <algorithm>

#include "oriel/window/echelon.h"

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

void StackedRows::copy_rows(int first_row, int rows, int first_column, int columns, std::vector<double>& R,
                            std::vector<double>& d) const {
  R.resize(static_cast<std::size_t>(rows) * columns);
  for (int c = 0; c < columns; ++c)
    std::copy_n(column(first_column + c) + first_row, rows, R.begin() + static_cast<std::ptrdiff_t>(c) * rows);
  const double* const right = column(component_->landmark_dim + component_->dim()) + first_row;
  d.assign(right, right + rows);
}

void StackedRows::finish(SquareRootRows& out) {
  const int landmarks = component_->landmark_dim, staying = landmarks + component_->leaving_dim;
  const int right = staying + component_->staying_dim;
  const StackedColumns a{a_.data(), static_cast<std::size_t>(capacity_), rows_};
  const int first = reduce_to_echelon(a, 0, landmarks, right + 1, 0, empty_.data());
  const int used = reduce_to_echelon(a, landmarks, staying, right + 1, first, empty_.data());
  const int rank = reduce_to_echelon(a, staying, right, right + 1, used, empty_.data()) - used;
  forget_rounding(a, staying, right, first, used + rank);
  out.undetermined.clear();
  for (std::uint32_t o = component_->variables_begin; o < component_->variables_end; ++o) {
    const MarginalVariable& v = scope_->variables()[scope_->ordered()[o]];
    if (!v.eliminated && v.column >= component_->leaving_dim) break;
    const int column = (v.eliminated ? 0 : landmarks) + v.column;
    for (int i = 0; i < v.dim; ++i)
      if (empty_[column + i]) out.undetermined.push_back({scope_->ordered()[o], i});
  }
  out.rows = rank, out.cols = component_->staying_dim;
  copy_rows(used, rank, staying, out.cols, out.R, out.d);
  out.conditional_rows = out.keep_conditional ? used - first : 0;
  copy_rows(first, out.conditional_rows, landmarks, component_->dim(), out.conditional_R, out.conditional_d);
}

}  // namespace oriel
