// A factorization that follows a pattern that changes, against one that is made anew: the same bits.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <numeric>
#include <random>
#include <set>
#include <vector>

#include "oriel/linear/multifrontal.h"

namespace oriel {
namespace {

// A pattern that grows and shrinks at its end, and whose blocks are tied and untied anywhere.
struct Changing {
  explicit Changing(unsigned seed) : random(seed) {}
  int below(int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); }

  void grow(int n, int ties, int near) {
    for (; n > 0; --n) {
      const int b = static_cast<int>(dims.size());
      dims.push_back(1 + below(6));
      order.push_back(b);
      touched.insert(b);
      for (int k = 0; k < ties && b > 0; ++k) tie(b, k == 0 ? b - 1 : std::max(0, b - 1 - below(near)));
    }
  }
  void shrink(int n) {
    for (; n > 0 && !dims.empty(); --n) {
      const int b = static_cast<int>(dims.size()) - 1;
      for (auto it = pairs.begin(); it != pairs.end();) {
        if (it->second == b) {
          touched.insert(it->first);
          it = pairs.erase(it);
        } else {
          ++it;
        }
      }
      dims.pop_back();
      order.erase(std::find(order.begin(), order.end(), b));
    }
  }
  void tie(int a, int b) {
    if (a == b) return;
    pairs.insert({std::min(a, b), std::max(a, b)});
    touched.insert({a, b});
  }
  void untie() {
    if (pairs.empty()) return;
    auto it = pairs.begin();
    std::advance(it, below(static_cast<int>(pairs.size())));
    touched.insert({it->first, it->second});
    pairs.erase(it);
  }
  BlockPattern pattern() const {
    BlockPattern p;
    p.reset(dims);
    for (auto [i, j] : pairs) p.connect(i, j);
    p.finish();
    return p;
  }
  std::vector<int> take_changed() {
    std::vector<int> changed(touched.begin(), touched.end());
    touched.clear();
    return changed;
  }

  std::mt19937 random;
  std::vector<int> dims, order;
  std::set<std::pair<int, int>> pairs;  // (less, greater)
  std::set<int> touched;
};

// A value for each element of the matrix, by its place in it; diagonally dominant.
std::vector<double> matrix_of(const BlockPattern& pattern, const Multifrontal& f) {
  std::vector<double> h(static_cast<std::size_t>(f.storage_size()), 0.0);
  for (int i = 0; i < pattern.blocks(); ++i) {
    auto write = [&](int j) {
      const BlockAddress at = f.address(i, j);
      for (int c = 0; c < pattern.dim(j); ++c)
        for (int r = 0; r < pattern.dim(i); ++r) {
          const int row = pattern.offset(i) + r, column = pattern.offset(j) + c;
          const double v =
              row == column ? 200.0 : std::sin(row * 1.7 + column * 2.3) + std::sin(column * 1.7 + row * 2.3);
          h[static_cast<std::size_t>(at.transposed ? at.offset + static_cast<std::int64_t>(r) * at.ld + c
                                                   : at.offset + static_cast<std::int64_t>(c) * at.ld + r)] = v;
        }
    };
    write(i);
    for (const int j : pattern.neighbours(i))
      if (j < i) write(j);
  }
  return h;
}

void expect_same(const BlockPattern& pattern, Multifrontal& kept, Multifrontal& fresh, unsigned seed) {
  ASSERT_EQ(kept.symbolic().sequence().size(), fresh.symbolic().sequence().size()) << seed;
  ASSERT_EQ(kept.symbolic().flops(), fresh.symbolic().flops()) << seed;
  ASSERT_EQ(kept.symbolic().fill(), fresh.symbolic().fill()) << seed;
  ASSERT_EQ(kept.symbolic().subtrees().size(), fresh.symbolic().subtrees().size()) << seed;
  const std::vector<double> a = matrix_of(pattern, kept), b = matrix_of(pattern, fresh);
  const FactorReport x = kept.factor(a.data()), y = fresh.factor(b.data());
  ASSERT_EQ(x.status, y.status) << seed;
  ASSERT_EQ(x.smallest_ratio, y.smallest_ratio) << seed;
  ASSERT_EQ(x.smallest.block, y.smallest.block) << seed;
  ASSERT_EQ(x.smallest.row, y.smallest.row) << seed;
  const auto n = static_cast<std::size_t>(pattern.total_dim());
  std::vector<double> right(n), u(n), v(n);
  for (std::size_t i = 0; i < n; ++i) right[i] = std::cos(0.3 * static_cast<double>(i));
  kept.solve(right.data(), u.data());
  fresh.solve(right.data(), v.data());
  ASSERT_EQ(u, v) << seed;
}

// C-oracle: `fresh` is analyzed from nothing with the same order, after each change.
int follow_changes(unsigned seed, int blocks, int steps, int near) {
  Changing c(seed);
  c.grow(blocks, 3, near);
  Multifrontal kept, fresh;
  FactorOptions options;
  options.ordering = OrderingMethod::given;
  MinimumDegree().order(c.pattern(), c.order);
  c.take_changed();
  EXPECT_TRUE(kept.analyze(c.pattern(), options, c.order));
  for (int k = 0; k < steps; ++k) {
    const int what = c.below(5);
    if (what <= 1) c.grow(1 + c.below(1 + blocks / 50), 1 + c.below(3), near);
    if (what == 2) c.shrink(1 + c.below(1 + blocks / 50));
    if (what == 3)
      for (int i = 0; i < 3; ++i) c.untie();
    if (what == 4)
      for (int i = 0; i < 2; ++i)
        c.tie(c.below(static_cast<int>(c.dims.size())), c.below(static_cast<int>(c.dims.size())));
    const BlockPattern pattern = c.pattern();
    kept.follow(pattern, options, c.order, c.take_changed());
    EXPECT_TRUE(fresh.analyze(pattern, options, c.order));
    expect_same(pattern, kept, fresh, seed * 1000 + static_cast<unsigned>(k));
    if (::testing::Test::HasFatalFailure()) return 0;
  }
  return static_cast<int>(kept.updates());
}

int longer(int n) {
  const char* times = std::getenv("ORIEL_FOLLOW_TIMES");
  return times == nullptr ? n : n * std::atoi(times);
}

// L10
TEST(MultifrontalFollow, HasTheBitsOfOneThatIsAnalyzedAnew) {
  int updates = 0;
  for (int seed = 1; seed <= longer(12); ++seed) updates += follow_changes(static_cast<unsigned>(seed), 150, 25, 40);
  EXPECT_GT(updates, longer(12) * 5) << "what follows nearly always begins anew";
}

// L10: large enough that subtrees are factored apart.
TEST(MultifrontalFollow, HasTheSameBitsWhereSubtreesAreFactoredApart) {
  int updates = 0;
  for (int seed = 1; seed <= longer(2); ++seed) updates += follow_changes(static_cast<unsigned>(seed), 900, 12, 30);
  EXPECT_GT(updates, longer(2) * 3);
}

TEST(MultifrontalFollow, MakesAnewOnlyWhatAChangeReaches) {
  Changing c(3);
  c.grow(3000, 2, 20);
  MinimumDegree().order(c.pattern(), c.order);
  c.take_changed();
  Multifrontal kept;
  FactorOptions options;
  options.ordering = OrderingMethod::given;
  ASSERT_TRUE(kept.analyze(c.pattern(), options, c.order));
  for (int k = 0; k < 20; ++k) {
    c.grow(10, 2, 20);
    kept.follow(c.pattern(), options, c.order, c.take_changed());
  }
  EXPECT_EQ(kept.analyses(), 1);
  EXPECT_EQ(kept.updates(), 20);
}

}  // namespace
}  // namespace oriel
