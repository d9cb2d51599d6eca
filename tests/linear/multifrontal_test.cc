#include "oriel/linear/multifrontal.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <limits>
#include <numeric>
#include <random>
#include <thread>
#include <vector>

namespace oriel {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// A pattern with a random symmetric positive definite matrix on it, dense and in the layout of the factorization.
struct Problem {
  Problem(std::vector<int> dims, const std::vector<std::pair<int, int>>& pairs, unsigned seed) {
    pattern.reset(dims);
    for (auto [i, j] : pairs) pattern.connect(i, j);
    pattern.finish();
    std::mt19937 generator(seed);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    const int n = pattern.total_dim();
    dense = MatrixXd::Zero(n, n);
    for (int i = 0; i < pattern.blocks(); ++i)
      for (int j : pattern.neighbours(i))
        if (j < i)
          for (int r = 0; r < pattern.dim(i); ++r)
            for (int c = 0; c < pattern.dim(j); ++c) {
              dense(pattern.offset(i) + r, pattern.offset(j) + c) = uniform(generator);
              dense(pattern.offset(j) + c, pattern.offset(i) + r) = dense(pattern.offset(i) + r, pattern.offset(j) + c);
            }
    for (int k = 0; k < n; ++k) dense(k, k) = 1.0 + dense.row(k).cwiseAbs().sum();
    right = VectorXd::NullaryExpr(n, [&] { return uniform(generator); });
  }

  // The blocks of `dense` through address(): from either side, as callers have them.
  std::vector<double> values(const Multifrontal& factorization) const {
    std::vector<double> h(factorization.storage_size(), 0.0);
    for (int i = 0; i < pattern.blocks(); ++i) {
      write(factorization, h, i, i);
      for (int j : pattern.neighbours(i))
        if ((i + j) % 2 == 0 ? i < j : i > j) write(factorization, h, i, j);
    }
    return h;
  }

  void write(const Multifrontal& factorization, std::vector<double>& h, int i, int j) const {
    const BlockAddress at = factorization.address(i, j);
    for (int c = 0; c < pattern.dim(j); ++c)
      for (int r = 0; r < pattern.dim(i); ++r)
        h[at.transposed ? at.offset + static_cast<std::int64_t>(r) * at.ld + c
                        : at.offset + static_cast<std::int64_t>(c) * at.ld + r] =
            dense(pattern.offset(i) + r, pattern.offset(j) + c);
  }

  BlockPattern pattern;
  MatrixXd dense;
  VectorXd right;
};

Problem random_problem(int blocks, int pairs, unsigned seed) {
  std::mt19937 generator(seed);
  std::vector<int> dims(blocks);
  for (int& d : dims) d = 1 + static_cast<int>(generator() % 9);
  std::vector<std::pair<int, int>> connected;
  for (int k = 0; k < pairs; ++k)
    connected.emplace_back(static_cast<int>(generator() % blocks), static_cast<int>(generator() % blocks));
  return Problem(dims, connected, seed);
}

Problem grid_problem(int width, int height, int dim) {
  std::vector<std::pair<int, int>> pairs;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      if (x + 1 < width) pairs.emplace_back(y * width + x, y * width + x + 1);
      if (y + 1 < height) pairs.emplace_back(y * width + x, (y + 1) * width + x);
    }
  return Problem(std::vector<int>(width * height, dim), pairs, 5);
}

FactorOptions with(OrderingMethod method) {
  FactorOptions options;
  options.ordering = method;
  return options;
}

// Runs each call on its own threads, tasks dealt out in an order that differs from call to call.
class ThreadPool final : public TaskPool {
 public:
  explicit ThreadPool(int workers) : workers_(workers) {}
  int workers() const override { return workers_; }
  void parallel_for(int count, TaskRef body) noexcept override {
    std::vector<int> tasks(count);
    std::iota(tasks.begin(), tasks.end(), 0);
    std::shuffle(tasks.begin(), tasks.end(), generator_);
    std::vector<std::thread> threads;
    for (int w = 0; w < workers_; ++w)
      threads.emplace_back([&, w] {
        for (int k = w; k < count; k += workers_) body(tasks[k], w);
      });
    for (std::thread& thread : threads) thread.join();
  }

 private:
  int workers_;
  std::mt19937 generator_{1};
};

TEST(Multifrontal, SolvesTheSameSystemAsDenseCholesky) {
  Multifrontal factorization;
  for (OrderingMethod method :
       {OrderingMethod::automatic, OrderingMethod::minimum_degree, OrderingMethod::nested_dissection}) {
    for (unsigned seed = 0; seed < 60; ++seed) {
      const int blocks = 1 + static_cast<int>(seed % 40);
      const Problem problem = random_problem(blocks, static_cast<int>(seed * 3 % 90), seed);
      ASSERT_TRUE(factorization.analyze(problem.pattern, with(method)));
      std::vector<double> h = problem.values(factorization);
      const std::vector<double> untouched = h;
      const FactorReport& report = factorization.factor(h.data());
      EXPECT_EQ(report.status, FactorReport::Status::ok);
      EXPECT_EQ(h, untouched);
      VectorXd x(problem.right.size());
      factorization.solve(problem.right.data(), x.data());
      const VectorXd want = problem.dense.llt().solve(problem.right);
      EXPECT_LT((x - want).norm(), 1e-12 * (1.0 + want.norm())) << "seed " << seed;
    }
  }
}

TEST(Multifrontal, EliminatesInAGivenOrderAndSaysWhatIsWrongWithOne) {
  const Problem problem = random_problem(12, 30, 3);
  Multifrontal factorization;
  std::vector<int> order(12);
  std::iota(order.rbegin(), order.rend(), 0);
  ASSERT_TRUE(factorization.analyze(problem.pattern, with(OrderingMethod::given), order));
  factorization.factor(problem.values(factorization).data());
  VectorXd x(problem.right.size());
  factorization.solve(problem.right.data(), x.data());
  EXPECT_LT((problem.dense * x - problem.right).norm(), 1e-12);
  order[3] = order[4];
  EXPECT_FALSE(factorization.analyze(problem.pattern, with(OrderingMethod::given), order));
  order.pop_back();
  EXPECT_EQ(factorization.analyze(problem.pattern, with(OrderingMethod::given), order).error().message,
            "elimination order: expected 12 blocks, got 11");
  BlockPattern bad;
  bad.reset(std::vector<int>{3, 0});
  bad.finish();
  EXPECT_EQ(factorization.analyze(bad, {}).error().message, "block 1: expected a dimension of at least 1, got 0");
}

TEST(Multifrontal, TakesAnEmptyPatternAndASingleBlock) {
  Multifrontal factorization;
  BlockPattern pattern;
  pattern.reset({});
  pattern.finish();
  ASSERT_TRUE(factorization.analyze(pattern, {}));
  EXPECT_EQ(factorization.factor(nullptr).status, FactorReport::Status::ok);
  factorization.solve(nullptr, nullptr);
  EXPECT_EQ(factorization.symbolic().total_dim(), 0);
  const Problem one({1}, {}, 1);
  ASSERT_TRUE(factorization.analyze(one.pattern, {}));
  const double h = 4.0, b = 2.0;
  factorization.factor(&h);
  double x = 0.0;
  factorization.solve(&b, &x);
  EXPECT_EQ(x, 0.5);
}

TEST(Multifrontal, AddsDampingInTheOrderOfTheInput) {
  const Problem problem = random_problem(20, 40, 8);
  Multifrontal factorization;
  ASSERT_TRUE(factorization.analyze(problem.pattern, {}));
  const std::vector<double> h = problem.values(factorization);
  VectorXd damping(problem.right.size());
  for (int k = 0; k < damping.size(); ++k) damping[k] = 0.1 * k;
  factorization.factor(h.data(), damping.data());
  VectorXd x(problem.right.size());
  factorization.solve(problem.right.data(), x.data());
  const MatrixXd damped = problem.dense + MatrixXd(damping.asDiagonal());
  EXPECT_LT((damped * x - problem.right).norm(), 1e-12);
}

TEST(Multifrontal, KnowsWhichBlocksHaveAPlace) {
  const Problem problem = random_problem(15, 20, 2);
  Multifrontal factorization;
  ASSERT_TRUE(factorization.analyze(problem.pattern, {}));
  for (int i = 0; i < 15; ++i) {
    const auto list = problem.pattern.neighbours(i);
    for (int j = 0; j < 15; ++j)
      EXPECT_EQ(factorization.has(i, j), i == j || std::find(list.begin(), list.end(), j) != list.end());
  }
}

TEST(Multifrontal, GivesTheSameBitsForAnyNumberOfThreads) {  // L10
  const Problem problem = grid_problem(28, 28, 3);
  Multifrontal one;
  ASSERT_TRUE(one.analyze(problem.pattern, with(OrderingMethod::minimum_degree)));
  ASSERT_GT(one.symbolic().subtrees().size(), 2u);
  const std::vector<double> h = problem.values(one);
  VectorXd x(problem.right.size()), y(problem.right.size());
  one.factor(h.data());
  one.solve(problem.right.data(), x.data());
  EXPECT_LT((problem.dense * x - problem.right).norm(), 1e-11);
  for (int workers : {1, 2, 3, 7}) {
    ThreadPool pool(workers);
    Multifrontal many;
    ASSERT_TRUE(many.analyze(problem.pattern, with(OrderingMethod::minimum_degree)));
    for (int repeat = 0; repeat < 3; ++repeat) {
      many.factor(h.data(), nullptr, &pool);
      many.solve(problem.right.data(), y.data());
      EXPECT_EQ(x, y) << workers << " workers";
    }
  }
}

TEST(Multifrontal, SharesTheTilesOfALargeFrontWithTheSameBits) {  // L10
  std::vector<std::pair<int, int>> all;
  for (int i = 0; i < 60; ++i)
    for (int j = 0; j < i; ++j) all.emplace_back(i, j);
  const Problem problem(std::vector<int>(60, 6), all, 6);
  Multifrontal one, two;
  ASSERT_TRUE(one.analyze(problem.pattern, {}));
  ASSERT_TRUE(two.analyze(problem.pattern, {}));
  const std::vector<double> h = problem.values(one);
  ThreadPool pool(2);
  one.factor(h.data());
  two.factor(h.data(), nullptr, &pool);
  VectorXd x(problem.right.size()), y(problem.right.size());
  one.solve(problem.right.data(), x.data());
  two.solve(problem.right.data(), y.data());
  EXPECT_EQ(x, y);
}

TEST(Multifrontal, NamesWhatNothingDeterminesAndSolvesTheRest) {  // L6
  // A chain of relative measurements without a prior, and a block that no factor touches.
  const int n = 6;
  std::vector<std::pair<int, int>> chain;
  for (int i = 0; i + 2 < n; ++i) chain.emplace_back(i, i + 1);
  Problem problem(std::vector<int>(n, 2), chain, 4);
  problem.dense.setZero();
  for (int i = 0; i + 2 < n; ++i)
    for (int c = 0; c < 2; ++c) {
      const int a = 2 * i + c, b = a + 2;
      problem.dense(a, a) += 1.0, problem.dense(b, b) += 1.0;
      problem.dense(a, b) -= 1.0, problem.dense(b, a) -= 1.0;
    }
  const std::vector<int> order{0, 1, 2, 3, 4, 5};
  Multifrontal factorization;
  ASSERT_TRUE(factorization.analyze(problem.pattern, with(OrderingMethod::given), order));
  const FactorReport& report = factorization.factor(problem.values(factorization).data());
  EXPECT_EQ(report.status, FactorReport::Status::undetermined);
  ASSERT_EQ(report.undetermined_count, 4);
  int untouched = 0, gauge = 0;
  for (int k = 0; k < 4; ++k) (report.undetermined[k].block == 5 ? untouched : gauge) += 1;
  EXPECT_EQ(untouched, 2);
  EXPECT_EQ(gauge, 2);
  // Consistent right-hand side: differences along the chain.
  VectorXd truth(2 * n), x(2 * n);
  for (int k = 0; k < 2 * n; ++k) truth[k] = 0.3 * k * k;
  const VectorXd right = problem.dense * truth;
  factorization.solve(right.data(), x.data());
  EXPECT_TRUE(x.allFinite());
  EXPECT_LT((problem.dense * x - right).norm(), 1e-10);
  EXPECT_EQ(x[10], 0.0);
  EXPECT_EQ(x[11], 0.0);
}

TEST(Multifrontal, ReportsTheSmallestPivotRatioAndWhere) {
  Problem problem({1, 1}, {{0, 1}}, 1);
  problem.dense << 1.0, 1.0, 1.0, 1.0 + 1e-6;
  const std::vector<int> order{0, 1};
  Multifrontal factorization;
  ASSERT_TRUE(factorization.analyze(problem.pattern, with(OrderingMethod::given), order));
  const FactorReport& report = factorization.factor(problem.values(factorization).data());
  EXPECT_NEAR(report.smallest_ratio, 1e-6, 1e-11);
  EXPECT_EQ(report.smallest.block, 1);
  EXPECT_EQ(report.smallest.row, 0);
}

TEST(Multifrontal, ReportsInputThatIsNotFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  for (double bad : {nan, infinity, -infinity}) {
    Problem problem = random_problem(10, 20, 5);
    const int i = problem.pattern.offset(4);
    problem.dense(i, i) = bad;
    Multifrontal factorization;
    ASSERT_TRUE(factorization.analyze(problem.pattern, {}));
    const FactorReport& report = factorization.factor(problem.values(factorization).data());
    EXPECT_EQ(report.status, FactorReport::Status::not_finite);
    EXPECT_GE(report.not_finite.block, 0);
  }
}

TEST(Multifrontal, SolvesInHalvesThatGiveTheMarginalCovariance) {
  const Problem problem = random_problem(12, 30, 9);
  Multifrontal factorization;
  ASSERT_TRUE(factorization.analyze(problem.pattern, {}));
  factorization.factor(problem.values(factorization).data());
  const MatrixXd inverse = problem.dense.inverse();
  const int n = problem.pattern.total_dim();
  for (int k = 0; k < n; ++k) {
    VectorXd unit = VectorXd::Unit(n, k), y(n), column(n);
    factorization.to_elimination_order(unit.data(), y.data());
    factorization.solve_lower(y.data());
    EXPECT_NEAR(y.squaredNorm(), inverse(k, k), 1e-12);
    factorization.solve_upper(y.data());
    factorization.from_elimination_order(y.data(), column.data());
    EXPECT_LT((column - inverse.col(k)).norm(), 1e-12);
  }
}

TEST(Multifrontal, FollowsAPatternThatChanges) {
  Multifrontal factorization;
  for (int blocks : {30, 4, 90, 1, 50}) {
    const Problem problem = random_problem(blocks, 2 * blocks, static_cast<unsigned>(blocks));
    ASSERT_TRUE(factorization.analyze(problem.pattern, {}));
    factorization.factor(problem.values(factorization).data());
    VectorXd x(problem.right.size());
    factorization.solve(problem.right.data(), x.data());
    EXPECT_LT((problem.dense * x - problem.right).norm(), 1e-11);
  }
}

}  // namespace
}  // namespace oriel
