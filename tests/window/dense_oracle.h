// The whole linear problem of a graph as dense matrices, by Eigen: what marginalization is compared with.
#pragma once
#include <Eigen/Dense>
#include <algorithm>
#include <vector>

#include "oriel/graph/graph.h"
#include "oriel/linear/aligned_buffer.h"
#include "oriel/linear/evaluate_rows.h"

namespace oriel::dense_oracle {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Jᵀr and JᵀJ over all variables that are not fixed, about the graph's values.
struct System {
  std::vector<VariableKey> variables;
  std::vector<int> offsets;  // one more than variables
  MatrixXd H;
  VectorXd g;

  int find(VariableKey id) const {
    for (std::size_t i = 0; i < variables.size(); ++i)
      if (variables[i] == id) return static_cast<int>(i);
    return -1;
  }
  std::vector<int> scalars(const std::vector<VariableKey>& ids) const {
    std::vector<int> all;
    for (const VariableKey& id : ids)
      for (int i = find(id), s = offsets[i]; s < offsets[i + 1]; ++s) all.push_back(s);
    return all;
  }
};

inline VariableKey key_of(const Graph& graph, const VariableRef& ref) {
  const VariablePool& pool = *graph.pools()[ref.pool];
  return {pool.ops().key, pool.slots().key_of_slot(ref.slot)};
}

inline System layout(const Graph& graph) {
  System s;
  s.offsets.push_back(0);
  for (const auto& pool : graph.pools())
    for (std::uint32_t d = 0; d < pool->extent(); ++d) {
      if (!pool->slots().is_live(d) || pool->fixed(d) || pool->ops().dim == 0) continue;
      s.variables.emplace_back(pool->ops().key, pool->slots().key(d));
      s.offsets.push_back(s.offsets.back() + pool->ops().dim);
    }
  s.H = MatrixXd::Zero(s.offsets.back(), s.offsets.back());
  s.g = VectorXd::Zero(s.offsets.back());
  return s;
}

// J over all scalars, r: H += JᵀJ, g += Jᵀr.
inline void add(System& s, const MatrixXd& J, const VectorXd& r) {
  s.H += J.transpose() * J;
  s.g += J.transpose() * r;
}

inline void add_row(System& s, const Graph& graph, const FactorTable& table, std::uint32_t row, bool first_estimates) {
  const int dim = table.ops().dim;
  int cols = 0;
  for (const VariableOps* ops : table.ops().variables) cols += ops->dim;
  AlignedBuffer r, j;
  r.reserve(std::int64_t{Batch::kRows} * dim);
  j.reserve(std::int64_t{Batch::kRows} * dim * cols);
  Batch batch;
  evaluate_rows(graph, table, {&row, 1}, nullptr, first_estimates, r.data(), j.data(), batch);
  if (batch.valid == 0) return;
  MatrixXd J = MatrixXd::Zero(dim, s.H.rows());
  VectorXd e(dim);
  for (int i = 0; i < dim; ++i) e(i) = r.data()[i * Batch::kRows];
  int column = 0;
  for (int a = 0; a < table.arity(); ++a) {
    const int width = table.ops().variables[a]->dim, at = s.find(key_of(graph, table.variables(row)[a]));
    for (int c = 0; c < width && at >= 0; ++c)
      for (int i = 0; i < dim; ++i) J(i, s.offsets[at] + c) += j.data()[((column + c) * dim + i) * Batch::kRows];
    column += width;
  }
  add(s, J, e);
}

inline void add_prior(System& s, const Graph& graph, std::uint32_t row) {
  const LinearPriorView p = graph.priors().numbers(row);
  const double* estimate = graph.priors().estimates(row);
  MatrixXd J = MatrixXd::Zero(p.rows, s.H.rows());
  VectorXd e(p.cols);
  const MatrixXd R = MatrixXd::Map(p.R, p.rows, p.cols);
  int column = 0;
  for (const VariableRef& ref : graph.priors().variables(row)) {
    const VariablePool& pool = *graph.pools()[ref.pool];
    const int dim = pool.ops().dim, at = s.find(key_of(graph, ref));
    pool.ops().minus(pool.value(pool.slots().dense(ref.slot)), estimate, e.data() + column);
    if (at >= 0) J.middleCols(s.offsets[at], dim) = R.middleCols(column, dim);
    column += dim;
    estimate += estimate_doubles(pool.ops());
  }
  add(s, J, VectorXd::Map(p.d, p.rows) + R * e);
}

inline System system(const Graph& graph, bool first_estimates = true) {
  System s = layout(graph);
  for (const auto& table : graph.tables())
    for (std::uint32_t row = 0; row < table->extent(); ++row)
      if (table->slots().is_live(row)) add_row(s, graph, *table, row, first_estimates);
  for (std::uint32_t row = 0; row < graph.priors().extent(); ++row)
    if (graph.priors().slots().is_live(row)) add_prior(s, graph, row);
  return s;
}

// The system of the variables of `rest`, the others of `whole` eliminated: H_rr - H_rl H_ll⁻¹ H_lr, likewise g. By the
// inverse on the range of H_ll, so that a leaving direction without information is allowed.
inline System schur_complement(const System& whole, const System& rest) {
  const std::vector<int> keep = whole.scalars(rest.variables);
  std::vector<int> gone;
  for (int i = 0; i < whole.H.rows(); ++i)
    if (std::find(keep.begin(), keep.end(), i) == keep.end()) gone.push_back(i);
  System s = rest;
  s.H = whole.H(keep, keep);
  s.g = whole.g(keep);
  if (gone.empty()) return s;
  const MatrixXd B = whole.H(keep, gone);
  const Eigen::CompleteOrthogonalDecomposition<MatrixXd> A(MatrixXd(whole.H(gone, gone)));
  s.H -= B * A.solve(MatrixXd(B.transpose()));
  s.g -= B * A.solve(VectorXd(whole.g(gone)));
  return s;
}

inline double difference(const MatrixXd& a, const MatrixXd& b) {
  return (a - b).norm() / std::max(1.0, std::max(a.norm(), b.norm()));
}

}  // namespace oriel::dense_oracle
