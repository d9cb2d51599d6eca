// Powell's dogleg: shorter steps without a new linearization, and the minima that Levenberg–Marquardt finds.
#include "oriel/solve/dogleg.h"

#include <gtest/gtest.h>

#include <cmath>

#include "linear/random_problem.h"
#include "oriel/solve/native_engine.h"
#include "solve/curved_residuals.h"

namespace oriel {
namespace {

using testing::ArcTangent;
using testing::Markd;
using testing::RandomProblem;
using testing::Rosenbrock;
using testing::Scalar;

// L7
TEST(Dogleg, FindsTheMinimumOfRosenbrocksValley) {
  for (const double radius : {0.0, 1e-3, 1.0, 1e4}) {
    Graph graph;
    GraphEdit edit = graph.edit();
    const auto x = edit.add(VectorNd<2>{{-1.2, 1.0}});
    edit.add(Rosenbrock{}, Sigma(1.0), x);
    ASSERT_TRUE(graph.apply(edit));
    SolveOptions options;
    options.method = Method::dogleg;
    options.initial_radius = radius;
    const Summary summary = NativeEngine(graph).solve(options);
    EXPECT_TRUE(summary.converged()) << summary;
    EXPECT_LT((graph.value(x).v - Vec2d{1.0, 1.0}).norm(), 1e-8);
  }
}

// L4
TEST(Dogleg, ShortensItsStepWithoutLinearizingAgain) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto x = edit.add(Scalar{{20.0}});
  edit.add(ArcTangent{}, Sigma(1.0), x);
  ASSERT_TRUE(graph.apply(edit));
  SolveOptions options;
  options.method = Method::dogleg;
  const Summary summary = NativeEngine(graph).solve(options);
  EXPECT_TRUE(summary.converged()) << summary;
  EXPECT_GT(summary.rejected, 0);
  EXPECT_LE(summary.linearizations, summary.accepted + 1);
  EXPECT_LT(std::fabs(graph.value(x).v[0]), 1e-6);
  for (std::size_t i = 1; i < summary.trace.size(); ++i) EXPECT_LE(summary.trace[i].cost, summary.trace[i - 1].cost);
}

// L7
TEST(Dogleg, FindsWhatLevenbergMarquardtFindsWithLandmarksAndWithout) {
  for (const bool landmarks : {false, true}) {
    RandomProblem p(5), q(5);
    for (RandomProblem* r : {&p, &q}) {
      const auto c = r->variables<VectorNd<6>>(5);
      for (int i = 0; i < 60; ++i) r->factor<2>(Cauchy(2.0), r->any(c), r->any(c));
      if (landmarks) {
        const auto l = r->variables<Markd<3>>(10);
        for (int i = 0; i < 60; ++i) r->factor<2>(r->any(c), r->any(l));
      }
      for (const auto& id : c) r->factor<3>(id);
      ASSERT_TRUE(r->apply());
    }
    SolveOptions options;
    options.max_iterations = 500;
    const Summary lm = NativeEngine(p.graph).solve(options);
    options.method = Method::dogleg;
    const Summary dogleg = NativeEngine(q.graph).solve(options);
    EXPECT_TRUE(dogleg.converged()) << dogleg;
    EXPECT_NEAR(dogleg.final_cost, lm.final_cost, 1e-7 * lm.final_cost);
  }
}

}  // namespace
}  // namespace oriel
