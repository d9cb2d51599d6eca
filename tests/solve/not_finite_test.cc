// A factor whose residual is a number and whose Jacobian is not: invalid, named, and in no cost (decision 12).
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

using Scalar = VectorNd<1>;

struct Root {  // √|x| - m: finite everywhere, its slope is infinite at 0
  static constexpr std::string_view kName = "test.root/1";
  static constexpr int kDim = 1;
  using Variables = Types<Scalar>;
  double m = 0.0;
  bool evaluate(const Scalar& x, Vec1d& r, Mat<double, 1, 1>* j) const {
    r[0] = std::sqrt(std::fabs(x.v[0])) - m;
    if (j != nullptr) (*j)(0, 0) = std::copysign(0.5, x.v[0]) / std::sqrt(std::fabs(x.v[0]));
    return true;
  }
};

struct NoSlope {  // a Jacobian that is never a number
  static constexpr std::string_view kName = "test.no_slope/1";
  static constexpr int kDim = 1;
  using Variables = Types<Scalar>;
  double m = 0.0;
  bool evaluate(const Scalar& x, Vec1d& r, Mat<double, 1, 1>* j) const {
    r[0] = x.v[0] - m;
    if (j != nullptr) (*j)(0, 0) = std::numeric_limits<double>::quiet_NaN();
    return true;
  }
};

TEST(NotFinite, AFactorWithoutAFiniteJacobianIsNamedAndInNoCost) {
  for (const Method method : {Method::levenberg_marquardt, Method::gauss_newton})
    for (const int threads : {1, 2}) {
      Graph graph;
      GraphEdit edit = graph.edit();
      std::vector<VariableId<Scalar>> x;
      for (int i = 0; i < 100; ++i) x.push_back(edit.add(Scalar{{{0.1 * i}}}));
      std::vector<FactorId> bad;
      for (int i = 0; i < 100; ++i) {
        edit.add(Prior{Scalar{{{1.0}}}}, Sigma(1.0), x[static_cast<std::size_t>(i)]);
        if (i % 33 == 7) bad.push_back(edit.add(NoSlope{100.0}, Sigma(0.1), x[static_cast<std::size_t>(i)]));
      }
      ASSERT_TRUE(graph.apply(edit));
      NativeEngine engine(graph);
      const Summary s = engine.solve({.method = method, .threads = threads});
      EXPECT_TRUE(s.converged()) << s;
      EXPECT_EQ(s.not_finite_factors, 3);
      EXPECT_EQ(s.invalid_factors, 3);
      EXPECT_EQ(s.not_finite, bad);
      EXPECT_NEAR(s.final_cost, 0.0, 1e-9);
      double start = 0.0;
      for (int i = 0; i < 100; ++i) start += 0.5 * (0.1 * i - 1.0) * (0.1 * i - 1.0);
      EXPECT_NEAR(s.initial_cost, start, 1e-9 * start);
      EXPECT_EQ(s.trace.front().cost, s.initial_cost);
      for (const auto id : x) EXPECT_NEAR(graph.value(id).v[0], 1.0, 1e-6);
      EXPECT_EQ(s.fresh_cost, engine.cost());  // L3: with them, as their residuals are numbers
      EXPECT_NEAR(s.fresh_cost, 3 * 0.5 * 990.0 * 990.0, 1e-6 * s.fresh_cost);
      EXPECT_TRUE(check(engine, graph));
    }
}

TEST(NotFinite, AFactorThatHasAJacobianAgainCountsFromThereOn) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto x = edit.add(Scalar{});
  const FactorId root = edit.add(Root{1.0}, Sigma(0.1), x);
  edit.add(Prior{Scalar{{{4.0}}}}, Sigma(1.0), x);
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  const Summary first = engine.solve({.max_iterations = 1, .initial_lambda = 1e-8});
  EXPECT_EQ(first.initial_cost, 8.0);  // of the prior alone
  EXPECT_EQ(first.accepted, 1);
  EXPECT_NEAR(graph.value(x).v[0], 4.0, 1e-6);
  const Summary s = engine.solve();
  EXPECT_TRUE(s.converged()) << s;
  EXPECT_EQ(s.not_finite_factors, 0);
  EXPECT_TRUE(s.not_finite.empty());
  // The minimum of ½ (x - 4)² + 50 (√x - 1)²: (x - 4) + 50 (1 - 1/√x) = 0.
  const double at = graph.value(x).v[0];
  EXPECT_NEAR((at - 4.0) + 50.0 * (1.0 - 1.0 / std::sqrt(at)), 0.0, 1e-3);
  EXPECT_EQ(engine.cost(), s.final_cost);
  // The same in one solve: the factor comes back at the first point that has a Jacobian for it.
  GraphEdit back = graph.edit();
  back.set(x, Scalar{});
  ASSERT_TRUE(graph.apply(back));
  const Summary whole = engine.solve();
  EXPECT_TRUE(whole.converged()) << whole;
  EXPECT_EQ(whole.initial_cost, 8.0);
  EXPECT_TRUE(whole.not_finite.empty());
  EXPECT_NEAR(whole.final_cost, s.final_cost, 1e-9 * s.final_cost);
  EXPECT_TRUE(graph.contains(root));
}

TEST(NotFinite, AStepToWhereAJacobianIsInfiniteIsJudgedByTheSameFactorsAtBothEnds) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto x = edit.add(Scalar{{{2.0}}});
  edit.add(Root{0.0}, Sigma(1.0), x);  // pulls to 0, where it has no Jacobian
  edit.add(Prior{Scalar{}}, Sigma(1.0), x);
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  const Summary s = engine.solve({.max_iterations = 200});
  double cost = s.initial_cost;
  for (const IterationReport& r : s.trace) {
    EXPECT_LE(r.cost, cost);
    cost = r.cost;
  }
  EXPECT_FALSE(s.failed()) << s;
  EXPECT_LT(std::fabs(graph.value(x).v[0]), 2.0);
}

}  // namespace
}  // namespace oriel
