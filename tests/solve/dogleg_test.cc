// Powell's dogleg: shorter steps without a new linearization, and the minima that Levenberg–Marquardt finds.
#include "oriel/solve/dogleg.h"

#include <gtest/gtest.h>

#include <cmath>

#include "linear/random_problem.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

using testing::Markd;
using testing::RandomProblem;
using Scalar = VectorNd<1>;

struct Rosenbrock {  // r = [10 (y - x²), 1 - x], minimum 0 at (1, 1)
  static constexpr std::string_view kName = "test.dogleg_rosenbrock/1";
  using Variables = Types<VectorNd<2>>;
  double scale = 10.0;
  template <class S>
  Vec<S, 2> operator()(const VectorN<S, 2>& x) const {
    return {S(scale) * (x.v[1] - x.v[0] * x.v[0]), S(1.0) - x.v[0]};
  }
};

struct ArcTangent {  // Gauss–Newton diverges from |x| > 1.39
  static constexpr std::string_view kName = "test.dogleg_arc_tangent/1";
  static constexpr int kDim = 1;
  using Variables = Types<Scalar>;
  double shift = 0.0;
  bool evaluate(const Scalar& x, Vec1d& r, Mat<double, 1, 1>* j) const {
    const double z = x.v[0] - shift;
    r[0] = std::atan(z);
    if (j != nullptr) (*j)(0, 0) = 1.0 / (1.0 + z * z);
    return true;
  }
};

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
