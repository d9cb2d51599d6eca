// The sparse block matrix: random operations equal dense ones, and systems add.
#include "oriel/linear/block_matrix.h"

#include <gtest/gtest.h>

#include "linear/random_problem.h"

namespace oriel {
namespace {

using testing::Markd;
using testing::RandomProblem;
using testing::System;

std::span<double> span(Eigen::MatrixXd& m) { return {m.data(), static_cast<std::size_t>(m.size())}; }

TEST(BlockMatrix, DoesWhatADenseMatrixDoesUnderRandomOperations) {  // L12
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  BlockMatrix a;
  std::vector<VariableKey> ids;
  std::vector<int> dims;
  Eigen::MatrixXd dense(0, 0);
  std::uint32_t next = 0;
  const auto offset = [&](std::size_t k) {
    int o = 0;
    for (std::size_t i = 0; i < k; ++i) o += dims[i];
    return o;
  };
  for (int step = 0; step < 600; ++step) {
    const auto action = random() % 8;
    if (ids.size() < 3 || action == 0) {
      const int d = 1 + static_cast<int>(random() % 9);
      ids.push_back({random() % 3, {next++, 1}});
      dims.push_back(d);
      a.add_variable(ids.back(), d);
      const int n = static_cast<int>(dense.rows());
      dense.conservativeResizeLike(Eigen::MatrixXd::Zero(n + d, n + d));
    } else if (action == 1 && ids.size() > 6) {
      const std::size_t k = random() % ids.size();
      const int o = offset(k), d = dims[k], rest = static_cast<int>(dense.rows()) - o - d;
      ASSERT_TRUE(a.remove_variable(ids[k]));
      ASSERT_FALSE(a.remove_variable(ids[k]));
      dense.middleRows(o, rest) = dense.bottomRows(rest).eval();
      dense.middleCols(o, rest) = dense.rightCols(rest).eval();
      dense.conservativeResize(dense.rows() - d, dense.cols() - d);
      ids.erase(ids.begin() + static_cast<std::ptrdiff_t>(k));
      dims.erase(dims.begin() + static_cast<std::ptrdiff_t>(k));
    } else if (action == 2 && step % 40 == 0) {
      const std::size_t blocks = a.block_count();
      a.set_zero();
      dense.setZero();
      ASSERT_EQ(a.block_count(), blocks);  // the pattern stays
    } else {
      const std::size_t i = random() % ids.size(), j = random() % ids.size();
      Eigen::MatrixXd block = Eigen::MatrixXd::NullaryExpr(dims[i], dims[j], [&] { return normal(random); });
      if (i == j) block = (block + block.transpose()).eval();
      a.set(ids[i], ids[j], span(block));
      dense.block(offset(i), offset(j), dims[i], dims[j]) = block;
      dense.block(offset(j), offset(i), dims[j], dims[i]) = block.transpose();
      Eigen::MatrixXd back(dims[j], dims[i]);
      ASSERT_TRUE(a.get(ids[j], ids[i], span(back)));
      ASSERT_EQ(back, block.transpose());
    }
    ASSERT_EQ(a.dim(), dense.rows());
    ASSERT_EQ(a.variables(), ids);
    Eigen::MatrixXd x = Eigen::MatrixXd::NullaryExpr(dense.rows(), 3, [&] { return normal(random); }),
                    y(dense.rows(), 3);
    a.multiply(span(x), 3, span(y));
    ASSERT_LE((y - dense * x).norm(), 1e-11 * (1.0 + dense.norm() * x.norm()));
  }
}

TEST(BlockMatrix, NamesBlocksByTypedIds) {  // L12
  RandomProblem p(1);
  const auto x = p.variable<VectorNd<3>>();
  const auto m = p.variable<Markd<2>>();
  BlockMatrix a;
  a.add_variable(x);
  a.add_variable(m);
  EXPECT_FALSE(a.get(x, m).has_value());
  const Mat<double, 3, 2> block{{1, 2, 3, 4, 5, 6}};
  a.set(x, m, block);
  EXPECT_EQ(a.get(x, m), block);
  EXPECT_EQ(a.get(m, x), block.transposed());
  EXPECT_EQ(a.offset(m), 3);
  EXPECT_TRUE(a.remove_variable(x));
  EXPECT_EQ(a.offset(m), 0);
  EXPECT_EQ(a.block_count(), 0u);
  EXPECT_THROW(static_cast<void>(a.offset(x)), ContractViolation);
}

TEST(BlockMatrix, AddsSystemsOverOneOrderingToTheSystemOfTheUnion) {  // L10
  // Small whole numbers everywhere, so that sums have no rounding to hide behind: the bits are equal.
  const auto build = [](int which) {
    Graph graph;
    GraphEdit edit = graph.edit();
    std::vector<VariableId<VectorNd<2>>> x;
    for (int i = 0; i < 6; ++i) x.push_back(edit.add(VectorNd<2>{}));
    for (int f = 0; f < 24; ++f) {
      LinearPrior p;
      const auto a = x[static_cast<std::size_t>(f % 6)], b = x[static_cast<std::size_t>((f * 5 + 1) % 6)];
      p.variables = {a, b};
      p.estimates.assign(4, 0.0);
      p.rows = 2, p.cols = 4;
      p.d = {double(f % 3), 1.0};
      for (int k = 0; k < 8; ++k) p.R.push_back((f * 7 + k * 3) % 5 - 2.0);
      if (!(a == b) && (which == 2 || f % 2 == which)) edit.add(p);
    }
    EXPECT_TRUE(graph.apply(edit));
    System system(graph);
    return hessian(graph, system.structure, system.numbers);
  };
  BlockMatrix sum = build(0);
  ASSERT_TRUE(sum.add(build(1)));
  const BlockMatrix both = build(2);
  ASSERT_EQ(sum.variables(), both.variables());
  Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(both.dim(), both.dim()), a = unit, b = unit;
  sum.multiply(span(unit), both.dim(), span(a));
  both.multiply(span(unit), both.dim(), span(b));
  EXPECT_EQ(a, b);
  BlockMatrix other;
  other.add_variable(VariableKey{1, {0, 1}}, 2);
  EXPECT_FALSE(sum.add(other));
}

}  // namespace
}  // namespace oriel
