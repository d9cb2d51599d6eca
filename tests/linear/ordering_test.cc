#include "oriel/linear/ordering.h"

#include <gtest/gtest.h>

#include <Eigen/OrderingMethods>
#include <Eigen/Sparse>
#include <algorithm>
#include <numeric>
#include <random>
#include <vector>

#include "oriel/linear/symbolic.h"

namespace oriel {
namespace {

BlockPattern grid(int width, int height, int dim) {
  BlockPattern pattern;
  pattern.reset(std::vector<int>(width * height, dim));
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      if (x + 1 < width) pattern.connect(y * width + x, y * width + x + 1);
      if (y + 1 < height) pattern.connect(y * width + x, (y + 1) * width + x);
    }
  pattern.finish();
  return pattern;
}

BlockPattern random_pattern(int blocks, int pairs, unsigned seed) {
  std::mt19937 generator(seed);
  std::vector<int> dims(blocks);
  for (int& d : dims) d = 1 + static_cast<int>(generator() % 9);
  BlockPattern pattern;
  pattern.reset(dims);
  for (int k = 0; k < pairs; ++k)
    pattern.connect(static_cast<int>(generator() % blocks), static_cast<int>(generator() % blocks));
  pattern.finish();
  return pattern;
}

void expect_permutation(std::vector<int> order, int blocks) {
  std::sort(order.begin(), order.end());
  std::vector<int> all(blocks);
  std::iota(all.begin(), all.end(), 0);
  EXPECT_EQ(order, all);
}

double flops_of(const BlockPattern& pattern, const std::vector<int>& order) {
  Symbolic symbolic;
  symbolic.analyze(pattern, order);
  return symbolic.flops();
}

std::vector<int> order_of_eigen(const BlockPattern& pattern) {
  std::vector<Eigen::Triplet<double>> entries;
  for (int i = 0; i < pattern.blocks(); ++i) {
    entries.emplace_back(i, i, 1.0);
    for (int j : pattern.neighbours(i)) entries.emplace_back(i, j, 1.0);
  }
  Eigen::SparseMatrix<double> a(pattern.blocks(), pattern.blocks());
  a.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic> permutation;
  Eigen::AMDOrdering<int>()(a, permutation);
  const auto& indices = permutation.indices();
  return {indices.data(), indices.data() + indices.size()};
}

TEST(BlockPattern, MergesDuplicatesAndSortsNeighbours) {
  BlockPattern pattern;
  for (int round = 0; round < 2; ++round) {  // the second reuses the buffers of the first
    pattern.reset(std::vector<int>{2, 3, 1, 6});
    pattern.connect(3, 1);
    pattern.connect(1, 3);
    pattern.connect(2, 2);
    pattern.connect_all(std::vector<int>{3, 0, 1});
    pattern.finish();
    const auto of = [&](int i) {
      const auto list = pattern.neighbours(i);
      return std::vector<int>(list.begin(), list.end());
    };
    EXPECT_EQ(of(0), (std::vector<int>{1, 3}));
    EXPECT_EQ(of(1), (std::vector<int>{0, 3}));
    EXPECT_EQ(of(2), (std::vector<int>{}));
    EXPECT_EQ(of(3), (std::vector<int>{0, 1}));
    EXPECT_EQ(pattern.neighbour_count(), 6);
    EXPECT_EQ(pattern.total_dim(), 12);
    EXPECT_EQ(pattern.offset(2), 5);
  }
}

TEST(MinimumDegree, OrdersEachBlockOnceWhateverTheGraph) {
  MinimumDegree minimum_degree;
  std::vector<int> order;
  for (unsigned seed = 0; seed < 200; ++seed) {
    const int blocks = 1 + static_cast<int>(seed % 60);
    const BlockPattern pattern = random_pattern(blocks, static_cast<int>(seed * 7 % 300), seed);
    minimum_degree.order(pattern, order);
    expect_permutation(order, blocks);
  }
  const BlockPattern empty = random_pattern(0, 0, 1);
  minimum_degree.order(empty, order);
  EXPECT_TRUE(order.empty());
}

TEST(MinimumDegree, EliminatesATreeWithoutFill) {
  const int n = 500;
  std::mt19937 generator(4);
  BlockPattern pattern;
  pattern.reset(std::vector<int>(n, 1));
  for (int i = 1; i < n; ++i) pattern.connect(i, static_cast<int>(generator() % i));
  pattern.finish();
  std::vector<int> order, position(n);
  MinimumDegree().order(pattern, order);
  for (int k = 0; k < n; ++k) position[order[k]] = k;
  for (int i = 0; i < n; ++i) {
    int later = 0;
    for (int j : pattern.neighbours(i)) later += position[j] > position[i];
    EXPECT_LE(later, 1);
  }
}

TEST(MinimumDegree, LeavesAboutAsMuchWorkAsEigensAmd) {
  for (const BlockPattern& pattern : {grid(30, 30, 3), grid(60, 20, 6), random_pattern(300, 600, 9)}) {
    std::vector<int> order;
    MinimumDegree().order(pattern, order);
    EXPECT_LT(flops_of(pattern, order), 1.3 * flops_of(pattern, order_of_eigen(pattern)));
  }
}

TEST(MinimumDegree, GivesTheSameOrderAgainAndAfterOtherPatterns) {
  const BlockPattern pattern = random_pattern(200, 500, 3);
  MinimumDegree minimum_degree;
  std::vector<int> first, second;
  minimum_degree.order(pattern, first);
  minimum_degree.order(grid(10, 10, 2), second);
  minimum_degree.order(pattern, second);
  EXPECT_EQ(first, second);
}

TEST(MinimumDegree, PutsABlockThatAllOthersTouchLast) {
  BlockPattern pattern;
  const int n = 400;
  pattern.reset(std::vector<int>(n, 6));
  for (int i = 0; i + 1 < n; ++i) pattern.connect(i, i + 1);
  for (int i = 0; i < n; ++i) pattern.connect(i, 17);
  pattern.finish();
  std::vector<int> order;
  MinimumDegree().order(pattern, order);
  expect_permutation(order, n);
  EXPECT_EQ(order.back(), 17);
}

TEST(MinimumDegree, EliminatesTheNewestOfAChainLastWhereAsked) {
  BlockPattern pattern;
  const int n = 400, first_late = 375;
  pattern.reset(std::vector<int>(n, 3));
  for (int i = 0; i + 1 < n; ++i) pattern.connect(i * 7 % n, (i + 1) * 7 % n);  // the newest stand all along it
  pattern.finish();
  std::vector<int> order;
  MinimumDegree().order(pattern, order, first_late);
  expect_permutation(order, n);
  for (int k = 0; k < n; ++k) EXPECT_EQ(order[k] >= first_late, k >= first_late) << k;
  MinimumDegree().order(pattern, order);
  EXPECT_FALSE(std::all_of(order.begin() + first_late, order.end(), [&](int b) { return b >= first_late; }))
      << "it would have been so unasked";
}

TEST(NestedDissection, OrdersEachBlockOnceWhereTheBuildHasIt) {
  const BlockPattern pattern = grid(40, 40, 3);
  std::vector<int> order, again;
  if (!nested_dissection(pattern, order)) GTEST_SKIP() << "built without METIS";
  expect_permutation(order, pattern.blocks());
  EXPECT_TRUE(nested_dissection(pattern, again));
  EXPECT_EQ(order, again);
}

TEST(Symbolic, CountsTheFlopsOfADenseMatrixExactly) {
  BlockPattern pattern;
  pattern.reset(std::vector<int>{6, 6, 6, 6, 6});
  pattern.connect_all(std::vector<int>{0, 1, 2, 3, 4});
  pattern.finish();
  Symbolic symbolic;
  symbolic.analyze(pattern, std::vector<int>{3, 1, 4, 0, 2});
  ASSERT_EQ(symbolic.fronts().size(), 1u);
  EXPECT_DOUBLE_EQ(symbolic.flops(), 30.0 * 31.0 * 61.0 / 6.0);
}

}  // namespace
}  // namespace oriel
