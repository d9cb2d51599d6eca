// From the second iteration on a solve asks for no memory; nor does a second solve of the same structure but for what
// its summary carries away.
#include <gtest/gtest.h>

#include "linear/random_problem.h"
#include "oriel/solve/native_engine.h"
#include "oriel/testing/allocation_counter.h"

namespace oriel {
namespace {

using testing::Markd;
using testing::RandomProblem;

void fill(RandomProblem& p, bool landmarks) {
  const auto x = p.variables<VectorNd<6>>(40);
  const auto v = p.variables<VectorNd<3>>(20);
  const auto m = p.variables<Markd<3>>(80);
  for (int i = 0; landmarks && i < 700; ++i) p.factor<2>(Huber(0.9), p.any(x), p.any(m));
  for (int i = 0; i < 100; ++i) p.factor<3>(p.any(x), p.any(v));
  for (const auto id : x) p.factor<6>(id);
  for (const auto id : v) p.factor<3>(id);
  p.prior({x[0], v[0]}, {6, 3}, 9);
  ASSERT_TRUE(p.apply());
}

TEST(NativeEngine, AllocatesNothingFromTheSecondIterationOn) {
  if (!counts_allocations()) GTEST_SKIP() << "the sanitizer has an operator new of its own";
  for (const bool landmarks : {false, true})
    for (const int threads : {1, 2}) {
      RandomProblem p(3);
      p.curvature = 0.2;
      fill(p, landmarks);
      NativeEngine engine(p.graph);
      std::int64_t at[40] = {};
      SolveOptions options;
      options.threads = threads;
      options.max_iterations = 30;
      options.function_tolerance = 0.0;
      options.callback = [&](const IterationReport& r) {
        at[r.iteration] = allocation_count();
        return true;
      };
      const Summary s = engine.solve(options);
      ASSERT_GE(s.iterations, 4);
      for (int i = 3; i <= s.iterations && at[i] > 0; ++i) EXPECT_EQ(at[i] - at[1], 0) << "iteration " << i;
      EXPECT_GT(at[1] - at[0], 0) << "the counter counts";
    }
}

}  // namespace
}  // namespace oriel
