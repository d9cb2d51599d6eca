// Inverse depth under steps of any size, and what a rejected step leaves behind: nothing.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "oriel/graph/fingerprint.h"
#include "oriel/manifold/inverse_depth.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/prior.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

// Depth of a landmark seen from two places [m], which pulls hard towards zero and behind.
struct Parallax {
  static constexpr std::string_view kName = "test.parallax/1";
  using Variables = Types<InverseDepthd, VectorNd<1>>;
  double shift = 0.0;
  template <class S>
  S operator()(const InverseDepth<S>& d, const VectorN<S, 1>& scale) const {
    using std::exp;
    return d.rho * scale.v[0] * exp(d.rho) - S(shift);
  }
};

TEST(InverseDepth, StaysPositiveUnderAnyStep) {  // V4
  std::mt19937 random(3);
  std::uniform_real_distribution<double> exponent(-12.0, 12.0);
  for (int i = 0; i < 20000; ++i) {
    const InverseDepthd x{std::pow(10.0, exponent(random) / 2.0)};
    const double d = (i % 2 == 0 ? 1.0 : -1.0) * std::pow(10.0, exponent(random));
    const double rho = x.plus({{d}}).rho;
    ASSERT_GT(rho, 0.0) << x.rho << " and " << d;
    ASSERT_TRUE(std::isfinite(rho));
  }
  for (const double d : {-1e308, -1e100, -1.0, 0.0, 1e100}) EXPECT_GT(InverseDepthd{0.2}.plus({{d}}).rho, 0.0) << d;
}

Graph problem(double shift) {
  Graph graph;
  GraphEdit edit = graph.edit();
  for (int i = 0; i < 6; ++i) {
    const auto depth = edit.add(InverseDepthd{0.5 + 0.5 * i});
    const auto scale = edit.add(VectorNd<1>{{{1.0 + i}}});
    edit.add(Parallax{shift * (1.0 + i)}, Sigma(0.01), depth, scale);
    edit.add(Prior{VectorNd<1>{{{0.1}}}}, Sigma(0.3), scale);
  }
  EXPECT_TRUE(graph.apply(edit));
  return graph;
}

TEST(InverseDepth, StaysPositiveThroughoutASolveThatPullsItBehind) {  // V4
  Graph graph = problem(-4.0);
  NativeEngine engine(graph);
  const Summary s = engine.solve({.max_iterations = 60});
  EXPECT_FALSE(s.failed()) << s;
  EXPECT_GT(s.accepted, 0);
  graph.for_each<InverseDepthd>([](auto, const InverseDepthd& d) { EXPECT_GT(d.rho, 0.0); });
}

// The solve is run to its k-th iteration for each k: one that was rejected leaves the bits of the one before.
TEST(RejectedStep, IsUndoneExactly) {  // V4, L4
  int rejected = 0;
  for (const double shift : {-4.0, 3.0}) {
    Graph first = problem(shift);
    const Summary whole = NativeEngine(first).solve({.max_iterations = 40});
    std::uint64_t before = value_fingerprint(problem(shift));
    for (int k = 1; k <= whole.iterations; ++k) {
      Graph graph = problem(shift);
      NativeEngine engine(graph);
      const Summary s = engine.solve({.max_iterations = k});
      ASSERT_EQ(s.trace.size(), static_cast<std::size_t>(k) + 1);
      const std::uint64_t after = value_fingerprint(graph);
      if (!s.trace.back().accepted) {
        ++rejected;
        EXPECT_EQ(after, before) << "iteration " << k << " of shift " << shift;
      } else {
        EXPECT_NE(after, before);
      }
      before = after;
    }
  }
  EXPECT_GT(rejected, 2);
}

}  // namespace
}  // namespace oriel
