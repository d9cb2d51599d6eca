#include "oriel/linear/dense_kernels.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <limits>
#include <random>
#include <vector>

namespace oriel {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Map = Eigen::Map<MatrixXd, 0, Eigen::OuterStride<>>;

MatrixXd random_matrix(int m, int n, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  return MatrixXd::NullaryExpr(m, n, [&] { return uniform(generator); });
}

MatrixXd random_positive_definite(int n, unsigned seed) {
  const MatrixXd a = random_matrix(n, n, seed);
  return a * a.transpose() + MatrixXd::Identity(n, n);
}

// A matrix in the layout of the kernels: padded columns, zeros in the padding.
struct Padded {
  Padded(const MatrixXd& a, int leading_dimension) : ld(leading_dimension), values(ld * (a.cols() + 1), 0.0) {
    map(static_cast<int>(a.rows()), static_cast<int>(a.cols())) = a;
  }
  explicit Padded(const MatrixXd& a) : Padded(a, dense::leading_dimension(static_cast<int>(a.rows()))) {}
  Map map(int m, int n) { return Map(values.data(), m, n, Eigen::OuterStride<>(ld)); }
  double* data() { return values.data(); }
  int ld;
  std::vector<double> values;
};

struct FactoredPanel {
  FactoredPanel(const MatrixXd& a, int pivots)
      : n(static_cast<int>(a.rows())), p(pivots), l(a.leftCols(pivots), dense::leading_dimension(n)) {
    const std::vector<double> threshold(p, 0.0);
    inverse_diagonal.resize(p);
    dense::factor_panel(l.data(), l.ld, n, p, threshold.data(), inverse_diagonal.data());
  }
  MatrixXd lower() {
    MatrixXd full = l.map(n, p);
    full.topRows(p).triangularView<Eigen::StrictlyUpper>().setZero();
    return full;
  }
  int n, p;
  Padded l;
  std::vector<double> inverse_diagonal;
};

TEST(DenseKernels, FactorsThePivotsOfAFrontOfAnySizeAndFormsItsUpdate) {
  for (int n : {1, 2, 3, 6, 7, 8, 9, 15, 16, 17, 24, 25, 31, 33, 48, 63, 65, 71, 96, 130, 200, 340}) {
    for (int p : {1, 2, 3, 5, 6, 8, 9, 12, 16, 23, 64, 65, 72, 130, 200, 330}) {
      if (p > n) continue;
      const MatrixXd a = random_positive_definite(n, 100 * n + p);
      FactoredPanel front(a, p);
      const MatrixXd l = front.lower();
      const MatrixXd product = l * l.transpose();
      EXPECT_LT((product - a).leftCols(p).norm(), 1e-12 * n * n) << n << ' ' << p;
      const int m = n - p, ld = dense::update_leading_dimension(n, p);
      std::vector<double> u(static_cast<std::size_t>(ld) * (m + 1), 1e300);
      dense::form_update(front.l.data(), front.l.ld, n, p, u.data(), ld);
      const MatrixXd want = -(l.bottomRows(m) * l.bottomRows(m).transpose());
      for (int j = 0; j < m; ++j)
        for (int i = j; i < m; ++i) EXPECT_NEAR(u[p % 8 + i + j * ld], want(i, j), 1e-12 * n * n) << n << ' ' << p;
    }
  }
}

TEST(DenseKernels, SolvesWithThePivotsOfAFront) {
  for (int n : {1, 5, 8, 13, 40, 77, 150}) {
    for (int p : {1, 3, 8, 11, 40, 77, 150}) {
      if (p > n) continue;
      FactoredPanel front(random_positive_definite(n, n + p), p);
      const MatrixXd l = front.lower();
      const VectorXd b = random_matrix(n, 1, 7);
      std::vector<double> v(dense::round_up_8(n), 0.0);
      VectorXd::Map(v.data(), n) = b;
      dense::solve_panel_lower(front.l.data(), front.l.ld, n, p, front.inverse_diagonal.data(), v.data());
      const VectorXd y = l.topRows(p).triangularView<Eigen::Lower>().solve(b.head(p));
      EXPECT_LT((VectorXd::Map(v.data(), p) - y).norm(), 1e-11 * n);
      EXPECT_LT((VectorXd::Map(v.data() + p, n - p) - (b.tail(n - p) - l.bottomRows(n - p) * y)).norm(), 1e-11 * n);
      VectorXd::Map(v.data(), n) = b;
      dense::solve_panel_upper(front.l.data(), front.l.ld, n, p, front.inverse_diagonal.data(), v.data());
      const VectorXd right = b.head(p) - l.bottomRows(n - p).transpose() * b.tail(n - p);
      const VectorXd x = l.topRows(p).transpose().triangularView<Eigen::Upper>().solve(right);
      EXPECT_LT((VectorXd::Map(v.data(), p) - x).norm(), 1e-10 * n);
    }
  }
}

TEST(DenseKernels, SubtractsATimesItsTransposeForTallAndWideA) {
  for (int n : {1, 4, 9, 24, 33, 90}) {
    for (int k : {1, 7, 40, 161, 500}) {
      const MatrixXd a = random_matrix(n, k, n + k), c = random_matrix(n, n, 3);
      Padded pa(a), pc(c);
      dense::syrk_lower_minus(pc.data(), pc.ld, n, pa.data(), pa.ld, k);
      const MatrixXd difference = pc.map(n, n) - (c - a * a.transpose());
      EXPECT_LT(MatrixXd(difference.triangularView<Eigen::Lower>()).norm(), 1e-12 * k);
    }
  }
}

TEST(DenseKernels, SubtractsAProductWithATranspose) {
  for (int m : {1, 9, 30, 65}) {
    for (int n : {1, 8, 13}) {
      const int k = 19;
      const MatrixXd a = random_matrix(m, k, m), b = random_matrix(n, k, n), c = random_matrix(m, n, 5);
      Padded pa(a), pc(c);
      dense::gemm_minus(pc.data(), pc.ld, m, n, pa.data(), pa.ld, b.data(), n, k);
      EXPECT_LT((pc.map(m, n) - (c - a * b.transpose())).norm(), 1e-12);
    }
  }
}

TEST(DenseKernels, RemovesAPivotBelowItsThresholdAndDisturbsNoOther) {
  const int n = 21, dead = 10;
  MatrixXd a = random_positive_definite(n, 11);
  a.row(dead) = 2.0 * a.row(4);
  a.col(dead) = 2.0 * a.col(4);
  a(dead, dead) = 4.0 * a(4, 4);  // scalar 10 is scalar 4 once more: nothing is left of its pivot
  Padded l(a);
  std::vector<double> threshold(n), inverse(n);
  for (int j = 0; j < n; ++j) threshold[j] = 1e-12 * a(j, j);
  dense::factor_panel(l.data(), l.ld, n, n, threshold.data(), inverse.data());
  EXPECT_EQ(inverse[dead], 0.0);
  EXPECT_EQ(VectorXd(l.map(n, n).col(dead).tail(n - dead)).norm(), 0.0);
  MatrixXd without = a;
  without.row(dead).setZero();
  without.col(dead).setZero();
  without(dead, dead) = 1.0;
  MatrixXd want = without.llt().matrixL();
  want(dead, dead) = 0.0;
  for (int j = 0; j < n; ++j) {
    for (int i = j; i < n; ++i) {
      if (i != dead) {
        EXPECT_NEAR(l.map(n, n)(i, j), want(i, j), 1e-10);
      }
    }
  }
}

TEST(DenseKernels, LeavesANonFiniteDiagonalBehindForANonFiniteInput) {
  const int n = 30;
  MatrixXd a = random_positive_definite(n, 12);
  a(17, 3) = std::numeric_limits<double>::quiet_NaN();
  FactoredPanel front(a, n);
  EXPECT_FALSE(std::isfinite(front.l.map(n, n)(17, 17)));
}

}  // namespace
}  // namespace oriel
