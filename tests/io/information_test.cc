#include "oriel/io/information.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>
#include <vector>

#include "oriel/io/g2o.h"
#include "oriel/residual/noise.h"

namespace oriel {
namespace {

std::vector<double> upper(const Eigen::MatrixXd& a) {
  std::vector<double> out;
  for (int i = 0; i < a.rows(); ++i)
    for (int j = i; j < a.cols(); ++j) out.push_back(a(i, j));
  return out;
}

Eigen::MatrixXd full(const std::vector<double>& v, int n) {
  Eigen::MatrixXd a(n, n);
  for (int i = 0, k = 0; i < n; ++i)
    for (int j = i; j < n; ++j) a(i, j) = a(j, i) = v[static_cast<std::size_t>(k++)];
  return a;
}

class Random {
 public:
  Eigen::MatrixXd symmetric(int n) {
    Eigen::MatrixXd a(n, n);
    for (int i = 0; i < n * n; ++i) a.data()[i] = normal_(engine_);
    return a + a.transpose();
  }

 private:
  std::mt19937 engine_{3};
  std::normal_distribution<double> normal_;
};

// V5
TEST(InformationOfFiles, IsIndefiniteWhereAnEigenvalueIsNegative) {
  Random random;
  int negative = 0;
  for (int round = 0; round < 2000; ++round) {
    const int n = 1 + round % 6;
    Eigen::MatrixXd a = random.symmetric(n) + (round % 7) * Eigen::MatrixXd::Identity(n, n);
    const double least = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(a).eigenvalues()[0];
    if (std::abs(least) < 1e-6) continue;
    negative += least < 0;
    EXPECT_EQ(positive_semidefinite(upper(a).data(), n), least > 0) << a;
    const Eigen::VectorXd units = Eigen::VectorXd::LinSpaced(n, -4, 4).array().exp();  // other units: the same answer
    const Eigen::MatrixXd scaled = units.asDiagonal() * a * units.asDiagonal();
    EXPECT_EQ(positive_semidefinite(upper(scaled).data(), n), least > 0) << scaled;
  }
  EXPECT_GT(negative, 200);
}

TEST(InformationOfFiles, IsProjectedToTheNearestSemidefiniteMatrix) {
  Random random;
  for (int round = 0; round < 500; ++round) {
    const int n = 1 + round % 6;
    const double size = std::pow(10.0, round % 9 - 4);
    const Eigen::MatrixXd a = size * random.symmetric(n);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(a);
    const Eigen::MatrixXd nearest =
        eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).asDiagonal() * eigen.eigenvectors().transpose();
    std::vector<double> v = upper(a);
    project_to_semidefinite(v.data(), n);
    EXPECT_LT((full(v, n) - nearest).norm(), 1e-12 * a.norm()) << a;
    EXPECT_TRUE(positive_semidefinite(v.data(), n));
  }
}

template <int N>
void expect_a_noise_takes_what_was_projected() {
  Random random;
  for (int round = 0; round < 300; ++round) {
    const Eigen::VectorXd units = (6.0 * Eigen::VectorXd::Random(N)).array().exp();  // metres beside radians
    std::vector<double> v = upper(units.asDiagonal() * random.symmetric(N) * units.asDiagonal());
    project_to_semidefinite(v.data(), N);
    EXPECT_TRUE(Information(from_upper<N>(v.data())).valid()) << full(v, N);
  }
}
TEST(InformationOfFiles, IsANoiseOnceItIsProjected) {
  expect_a_noise_takes_what_was_projected<2>();
  expect_a_noise_takes_what_was_projected<3>();
  expect_a_noise_takes_what_was_projected<6>();
}

TEST(InformationOfFiles, SurvivesEntriesNearTheEndsOfDoubles) {
  for (const double size : {1e-300, 1e300}) {
    std::vector<double> v = {size, 0.5 * size, 0, -size, 0, size};
    project_to_semidefinite(v.data(), 3);
    for (double x : v) EXPECT_TRUE(std::isfinite(x));
    EXPECT_TRUE(positive_semidefinite(v.data(), 3));
  }
  std::vector<double> nothing(6, 0.0);
  project_to_semidefinite(nothing.data(), 3);
  EXPECT_EQ(nothing, std::vector<double>(6, 0.0));
}

TEST(IndefiniteInformation, IsRefusedWithItsEdgesOrRepairedAndCounted) {
  std::string text;
  for (int i = 0; i < 10; ++i)
    text +=
        "EDGE_SE2 " + std::to_string(i) + " " + std::to_string(i + 1) + " 1 0 0 1 0 0 1 0 " + (i % 2 ? "1\n" : "-1\n");
  const auto refused = parse_g2o(text, "f.g2o");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::indefinite);
  EXPECT_EQ(
      refused.error().text(),
      "f.g2o:1: EDGE_SE2 0 1 and 4 more (in line 3, 5, 7, 9): expected positive semidefinite information, found a "
      "negative eigenvalue");
  PoseGraphReading reading;
  reading.project_information = true;
  const auto repaired = parse_g2o(text, "f.g2o", reading);
  ASSERT_TRUE(repaired) << repaired.error();
  EXPECT_EQ(repaired->information_repaired, 5);
  EXPECT_NEAR(information_matrix(repaired->planar_edges[0])(2, 2), 0, 1e-12);
  EXPECT_EQ(information_matrix(repaired->planar_edges[1])(2, 2), 1);
}

}  // namespace
}  // namespace oriel
