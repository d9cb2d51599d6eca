// What a solve promises: when a step is taken, what a cost means, and what is said at the end.
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <sstream>

#include "linear/random_problem.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/solve/native_engine.h"
#include "solve/curved_residuals.h"

namespace oriel {
namespace {

using testing::ArcTangent;
using testing::Markd;
using testing::RandomProblem;
using testing::Rosenbrock;
using testing::Scalar;

struct InFront {  // x + 3, valid in front of the camera alone: its pull leads behind it
  static constexpr std::string_view kName = "test.in_front/1";
  using Variables = Types<Scalar>;
  double offset = 3.0;
  template <class S>
  std::optional<S> operator()(const VectorN<S, 1>& x) const {
    if (!(x.v[0] > S(0.0))) return std::nullopt;
    return x.v[0] + S(offset);
  }
};

struct Steep {  // finite r and J, whose JᵀJ overflows
  static constexpr std::string_view kName = "test.steep/1";
  static constexpr int kDim = 1;
  using Variables = Types<Scalar>;
  double slope = 1e160;
  bool evaluate(const Scalar& x, Vec1d& r, Mat<double, 1, 1>* j) const {
    r[0] = 1e-160 * (1.0 + x.v[0]);
    if (j != nullptr) (*j)(0, 0) = slope;
    return true;
  }
};

struct Wrong {  // whose Jacobian has the wrong sign: no step lowers the cost
  static constexpr std::string_view kName = "test.wrong/1";
  static constexpr int kDim = 1;
  using Variables = Types<Scalar>;
  double m = 0.0;
  bool evaluate(const Scalar& x, Vec1d& r, Mat<double, 1, 1>* j) const {
    r[0] = x.v[0] - m;
    if (j != nullptr) (*j)(0, 0) = -1.0;
    return true;
  }
};

// A graph with one scalar at x0 and one factor on it.
template <class R>
struct One {
  Graph graph;
  VariableId<Scalar> x;
  explicit One(const R& residual, double x0, double sigma = 1.0) {
    GraphEdit edit = graph.edit();
    x = edit.add(Scalar{{{x0}}});
    edit.add(residual, Sigma(sigma), x);
    EXPECT_TRUE(graph.apply(edit));
  }
  double value() const { return graph.value(x).v[0]; }
};

TEST(Minimizer, FindsTheMinimumOfRosenbrocksValley) {  // L7
  for (const Method method : {Method::levenberg_marquardt, Method::gauss_newton}) {
    Graph graph;
    GraphEdit edit = graph.edit();
    const auto x = edit.add(VectorNd<2>{{{-1.2, 1.0}}});
    edit.add(Rosenbrock{}, Sigma(1.0), x);
    ASSERT_TRUE(graph.apply(edit));
    NativeEngine engine(graph);
    SolveOptions options;
    options.method = method;
    const Summary s = engine.solve(options);
    if (method == Method::gauss_newton && s.reason == Reason::diverged) continue;  // its first step is uphill; said so
    EXPECT_TRUE(s.converged()) << s;
    EXPECT_NEAR(graph.value(x).v[0], 1.0, 1e-6);
    EXPECT_NEAR(graph.value(x).v[1], 1.0, 1e-6);
  }
}

TEST(Minimizer, RejectsAnUphillStepThatTheLinearModelWouldLike) {  // L4
  One<ArcTangent> p(ArcTangent{}, 3.0);
  const std::uint64_t before = fingerprint(p.graph);
  NativeEngine engine(p.graph);
  SolveOptions options;
  options.max_iterations = 1;
  options.initial_lambda = 1e-8;  // a leap
  const Summary first = engine.solve(options);
  EXPECT_EQ(first.rejected, 1);
  EXPECT_EQ(first.accepted, 0);
  EXPECT_FALSE(first.converged());
  EXPECT_EQ(first.final_cost, first.initial_cost);
  EXPECT_EQ(fingerprint(p.graph), before);  // bit-identical
  options.max_iterations = 100;
  const Summary s = engine.solve(options);
  EXPECT_TRUE(s.converged()) << s;
  EXPECT_GT(s.rejected, 0);
  EXPECT_LE(s.linearizations, s.accepted + 1);  // none for a rejected step
  EXPECT_NEAR(p.value(), 0.0, 1e-5);
}

TEST(Minimizer, SaysThatGaussNewtonDivergesAndLeavesTheGraphAsItWas) {  // L7, L3
  One<ArcTangent> p(ArcTangent{}, 3.0);
  const std::uint64_t before = fingerprint(p.graph);
  NativeEngine engine(p.graph);
  SolveOptions options;
  options.method = Method::gauss_newton;
  const Summary s = engine.solve(options);
  EXPECT_EQ(s.reason, Reason::diverged);
  EXPECT_FALSE(s.converged());
  EXPECT_EQ(fingerprint(p.graph), before);
}

TEST(Minimizer, AcceptsAStepExactlyWhenTheWholeCostFalls) {  // L3
  for (unsigned seed = 1; seed <= 6; ++seed) {
    RandomProblem p(seed);
    p.curvature = 0.4;
    const auto x = p.variables<VectorNd<3>>(6);
    const auto m = p.variables<Markd<2>>(8);
    for (int i = 0; i < 60; ++i)
      p.factor<2>(i % 3 == 0 ? Huber(0.5) : i % 3 == 1 ? Cauchy(0.5) : Loss::none(), p.any(x), p.any(m));
    for (const auto id : x) p.factor<3>(id);
    if (seed % 2 == 0) p.prior({x[0], x[1]}, {3, 3}, 6);
    ASSERT_TRUE(p.apply());
    NativeEngine engine(p.graph);
    SolveOptions options;
    options.first_estimates = false;
    const Summary s = engine.solve(options);
    double cost = s.initial_cost;
    int accepted = 0, rejected = 0;
    for (std::size_t i = 1; i < s.trace.size(); ++i) {
      (s.trace[i].accepted ? accepted : rejected)++;
      if (s.trace[i].accepted) {
        EXPECT_LT(s.trace[i].cost, cost);
      } else {
        EXPECT_EQ(s.trace[i].cost, cost);
      }
      cost = s.trace[i].cost;
    }
    EXPECT_EQ(accepted, s.accepted);
    EXPECT_EQ(rejected, s.rejected);
    EXPECT_EQ(s.final_cost, cost);
    EXPECT_EQ(engine.cost(), s.final_cost);  // priors, losses and whitening included
    LinearStructure structure;
    ASSERT_TRUE(structure.build(p.graph, {}));
    EXPECT_NEAR(p.dense(structure).cost, s.final_cost, 1e-12 * s.final_cost);
    if (s.converged()) {
      EXPECT_LE(p.dense(structure).g.norm(), 1e-2 * (1.0 + s.final_cost));
    }
  }
}

TEST(Minimizer, SolvesALinearProblemLikeDenseAlgebra) {  // L3
  RandomProblem p(77);
  p.curvature = 0.0;
  const auto x = p.variables<VectorNd<3>>(6);
  const auto m = p.variables<Markd<2>>(8);
  for (int i = 0; i < 60; ++i) p.factor<2>(p.any(x), p.any(m));
  for (const auto id : x) p.factor<3>(id);
  ASSERT_TRUE(p.apply());
  LinearStructure structure;
  ASSERT_TRUE(structure.build(p.graph, {}));
  const auto d = p.dense(structure);
  const Eigen::VectorXd best = d.h.ldlt().solve(-d.g);
  for (const Method method : {Method::gauss_newton, Method::levenberg_marquardt}) {
    NativeEngine engine(p.graph);
    SolveOptions options;
    options.method = method;
    options.function_tolerance = 1e-14;
    const Summary s = engine.solve(options);
    EXPECT_TRUE(s.converged()) << s;
    EXPECT_NEAR(s.final_cost, d.cost + 0.5 * d.g.dot(best), 1e-10 * d.cost);
  }
}

TEST(Minimizer, HasNothingToDoInAnEmptyGraph) {  // L3
  Graph graph;
  NativeEngine engine(graph);
  for (const int threads : {1, 2}) {
    SolveOptions options;
    options.threads = threads;
    const Summary s = engine.solve(options);
    EXPECT_EQ(s.reason, Reason::nothing_to_do);
    EXPECT_TRUE(s.converged());
    EXPECT_EQ(s.final_cost, 0.0);
  }
  EXPECT_EQ(engine.cost(), 0.0);
}

TEST(Minimizer, SolvesAGraphOfPriorsAlone) {  // L3
  RandomProblem p(4);
  const auto x = p.variable<VectorNd<3>>();
  p.prior({x}, {3}, 3);
  ASSERT_TRUE(p.apply());
  NativeEngine engine(p.graph);
  const Summary s = engine.solve();
  EXPECT_TRUE(s.converged()) << s;
  EXPECT_NEAR(s.final_cost, 0.0, 1e-12);
  const Summary again = engine.solve();
  EXPECT_TRUE(again.converged());
  EXPECT_EQ(again.accepted + again.rejected, again.iterations - (again.reason == Reason::step_tolerance ? 1 : 0));
}

TEST(Minimizer, SolvesAroundFixedVariables) {  // L3
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto a = edit.add(Scalar{{{1.0}}}), b = edit.add(Scalar{{{9.0}}});
  edit.add(Between{Scalar{{{2.0}}}}, Sigma(1.0), a, b);
  edit.fix(a);
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  EXPECT_TRUE(engine.solve().converged());
  EXPECT_EQ(graph.value(a).v[0], 1.0);
  EXPECT_NEAR(graph.value(b).v[0], 3.0, 1e-9);
  GraphEdit all = graph.edit();
  all.fix(b);
  ASSERT_TRUE(graph.apply(all));
  EXPECT_EQ(engine.solve().reason, Reason::nothing_to_do);
}

TEST(Minimizer, IsNotConvergedAfterANumericalFailure) {  // L3
  for (const Method method : {Method::levenberg_marquardt, Method::gauss_newton}) {
    One<Steep> p(Steep{}, 1.0);
    const std::uint64_t before = fingerprint(p.graph);
    NativeEngine engine(p.graph);
    SolveOptions options;
    options.method = method;
    const Summary s = engine.solve(options);
    EXPECT_FALSE(s.converged()) << s;
    EXPECT_TRUE(s.failed()) << s;
    EXPECT_EQ(fingerprint(p.graph), before);
  }
}

TEST(Minimizer, GivesUpWhereNoStepLowersTheCost) {  // L4
  One<Wrong> p(Wrong{}, 1.0);
  const std::uint64_t before = fingerprint(p.graph);
  NativeEngine engine(p.graph);
  const Summary s = engine.solve();
  EXPECT_TRUE(s.reason == Reason::no_descending_step || s.reason == Reason::step_tolerance) << s;
  EXPECT_EQ(s.accepted, 0);
  EXPECT_EQ(s.linearizations, 1);
  EXPECT_EQ(fingerprint(p.graph), before);
}

TEST(Minimizer, HoldsUnderPriorsAndResidualsOfAnySize) {  // L5
  {
    Graph graph;  // information 1e24 against 1
    GraphEdit edit = graph.edit();
    const auto x = edit.add(Scalar{{{0.0}}});
    edit.add(Prior{Scalar{{{0.0}}}}, Sigma(1e-12), x);
    edit.add(Prior{Scalar{{{1.0}}}}, Sigma(1.0), x);
    ASSERT_TRUE(graph.apply(edit));
    NativeEngine engine(graph);
    EXPECT_TRUE(engine.solve().converged());
    EXPECT_LT(std::fabs(graph.value(x).v[0]), 1e-20);
  }
  {
    One<Prior<Scalar>> p(Prior{Scalar{{{5.0}}}}, 0.0, 1e12);  // information 1e-24
    NativeEngine engine(p.graph);
    const Summary s = engine.solve();
    EXPECT_TRUE(s.converged());
    EXPECT_TRUE(std::isfinite(p.value()) && std::isfinite(s.final_cost));
  }
  {
    RandomProblem p(3);
    const auto x = p.variables<VectorNd<3>>(4);
    for (int i = 0; i < 20; ++i) p.factor<3>(p.any(x), p.any(x));
    ASSERT_TRUE(p.apply());
    GraphEdit far = p.graph.edit();
    for (const auto id : x) far.set(id, VectorNd<3>{{{1e3, -2e3, 3e3}}});
    ASSERT_TRUE(p.graph.apply(far));
    NativeEngine engine(p.graph);
    const Summary s = engine.solve();
    EXPECT_GT(s.initial_cost, 1e12);
    EXPECT_LT(s.final_cost, 1e-3 * s.initial_cost);
  }
}

TEST(Minimizer, NeverGainsByStepsThatMakeAFactorInvalid) {  // V8
  One<InFront> p(InFront{}, 2.0);
  NativeEngine engine(p.graph);
  const Summary s = engine.solve();
  EXPECT_GT(p.value(), 0.0) << s;
  EXPECT_EQ(s.invalid_factors, 0);
  EXPECT_LT(s.final_cost, s.initial_cost);
  EXPECT_GE(s.final_cost, 0.5 * 9.0);  // 0 would be behind
  EXPECT_EQ(s.fresh_cost, s.final_cost);
}

TEST(Minimizer, CountsFactorsThatAreInvalidAtTheEnd) {  // V8
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto x = edit.add(Scalar{{{-2.0}}});
  edit.add(InFront{}, Sigma(1.0), x);
  edit.add(Prior{Scalar{{{-1.0}}}}, Sigma(1.0), x);
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  const Summary s = engine.solve();
  EXPECT_EQ(s.factors, 2);
  EXPECT_EQ(s.invalid_factors, 1);
  EXPECT_NEAR(graph.value(x).v[0], -1.0, 1e-9);
  EXPECT_NEAR(s.final_cost, 0.0, 1e-12);
}

TEST(Minimizer, StopsWhenTheCallbackSaysSo) {
  One<ArcTangent> p(ArcTangent{}, 1.0);
  NativeEngine engine(p.graph);
  SolveOptions options;
  options.callback = [](const IterationReport& r) { return r.iteration < 1; };
  const Summary s = engine.solve(options);
  EXPECT_EQ(s.reason, Reason::stopped_by_callback);
  EXPECT_EQ(s.iterations, 1);
  EXPECT_EQ(engine.cost(), s.final_cost);
}

TEST(Summary, TellsItsReasonAsAnInequality) {
  One<ArcTangent> p(ArcTangent{}, 1.0);
  NativeEngine engine(p.graph);
  const Summary s = engine.solve();
  std::ostringstream text;
  text << s;
  EXPECT_NE(text.str().find("converged"), std::string::npos);
  EXPECT_NE(text.str().find(s.reason_text()), std::string::npos);
  EXPECT_NE(s.reason_text().find("<="), std::string::npos);
  EXPECT_LE(s.reason_value, s.reason_bound);
}

}  // namespace
}  // namespace oriel
