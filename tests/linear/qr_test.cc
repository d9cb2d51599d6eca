#include "oriel/linear/qr.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <limits>
#include <random>
#include <vector>

#include "oriel/linear/dense_kernels.h"

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

std::vector<double> padded(const MatrixXd& a) {
  const int ld = dense::round_up_8(static_cast<int>(a.rows()));
  std::vector<double> values(ld * a.cols(), 0.0);
  Map(values.data(), a.rows(), a.cols(), Eigen::OuterStride<>(ld)) = a;
  return values;
}

TEST(HouseholderQr, KeepsTheNormOfEveryResidual) {
  for (int m : {1, 3, 8, 9, 20, 50, 131}) {
    for (int n : {1, 2, 7, 8, 9, 17, 40, 60}) {
      const MatrixXd a = random_matrix(m, n, 100 * m + n);
      const VectorXd b = random_matrix(m, 1, 5);
      std::vector<double> values = padded(a), right = padded(b), workspace(qr_workspace_size(m, n));
      const int ld = dense::round_up_8(m), k = std::min(m, n);
      ASSERT_TRUE(householder_qr(values.data(), ld, m, n, right.data(), workspace.data()));
      const MatrixXd full = Map(values.data(), m, n, Eigen::OuterStride<>(ld));
      const MatrixXd r = full.topRows(k);
      EXPECT_EQ(MatrixXd(full.triangularView<Eigen::StrictlyLower>()).norm(), 0.0);
      EXPECT_LT((r.transpose() * r - a.transpose() * a).norm(), 1e-13 * m) << m << ' ' << n;
      const VectorXd x = random_matrix(n, 1, 6), qb = VectorXd::Map(right.data(), m);
      const double want = (a * x - b).squaredNorm();
      EXPECT_NEAR((full * x - qb).squaredNorm(), want, 1e-12 * (1.0 + want)) << m << ' ' << n;
    }
  }
}

TEST(HouseholderQr, LeavesAZeroForAColumnOfZerosAndSaysWhatIsNotFinite) {
  MatrixXd a = random_matrix(12, 5, 1);
  a.col(2).setZero();
  std::vector<double> values = padded(a), workspace(qr_workspace_size(12, 5));
  ASSERT_TRUE(householder_qr(values.data(), 16, 12, 5, nullptr, workspace.data()));
  const MatrixXd r = Map(values.data(), 5, 5, Eigen::OuterStride<>(16));
  EXPECT_LT((r.transpose() * r - a.transpose() * a).norm(), 1e-13);
  a(3, 4) = std::numeric_limits<double>::quiet_NaN();
  values = padded(a);
  EXPECT_FALSE(householder_qr(values.data(), 16, 12, 5, nullptr, workspace.data()));
}

TEST(HouseholderQr, SurvivesEntriesWhoseSquaresOverflowOrVanish) {
  for (double scale : {1e200, 1e-200}) {
    const MatrixXd a = random_matrix(10, 4, 2);
    std::vector<double> values = padded(scale * a), workspace(qr_workspace_size(10, 4));
    ASSERT_TRUE(householder_qr(values.data(), 16, 10, 4, nullptr, workspace.data()));
    const MatrixXd r = Map(values.data(), 4, 4, Eigen::OuterStride<>(16)) / scale;
    EXPECT_LT((r.transpose() * r - a.transpose() * a).norm(), 1e-13);
  }
}

TEST(SquareRootOfInformation, ReproducesInformationAndGradientOfAnyRank) {
  for (int n : {1, 6, 15, 33, 80}) {
    for (int rank : {0, 1, n / 2, n}) {
      const MatrixXd a = random_matrix(rank, n, 10 * n + rank);
      const MatrixXd h = a.transpose() * a;
      const VectorXd g = a.transpose() * random_matrix(rank, 1, 3);
      std::vector<double> values = padded(h), gradient = padded(g), r(n * n), d(n);
      std::vector<double> workspace(square_root_workspace_size(n));
      const SquareRoot root = square_root_of_information(values.data(), dense::round_up_8(n), n, gradient.data(), 1e-11,
                                                         r.data(), n, d.data(), workspace.data());
      EXPECT_TRUE(root.finite);
      ASSERT_EQ(root.rank, rank) << n;
      const MatrixXd big_r = Map(r.data(), rank, n, Eigen::OuterStride<>(n));
      EXPECT_LT((big_r.transpose() * big_r - h).norm(), 1e-7 * (1.0 + h.norm()));
      EXPECT_LT((big_r.transpose() * VectorXd::Map(d.data(), rank) - g).norm(), 1e-7 * (1.0 + g.norm()));
    }
  }
}

TEST(SquareRootOfInformation, SaysThatTheInputIsNotFinite) {
  MatrixXd h = MatrixXd::Identity(9, 9);
  h(4, 1) = std::numeric_limits<double>::infinity();
  std::vector<double> values = padded(h), gradient(16, 0.0), r(81), d(9), workspace(square_root_workspace_size(9));
  EXPECT_FALSE(
      square_root_of_information(values.data(), 16, 9, gradient.data(), 1e-12, r.data(), 9, d.data(), workspace.data())
          .finite);
}

}  // namespace
}  // namespace oriel
