// The Ceres engine in step with its graph: one ceres::Problem, taken along edit by edit.
#include <gtest/gtest.h>

#include <set>

#include "engines/two_engines.h"
#include "engines/window_of_ten.h"
#include "graph/random_graph.h"
#include "oriel/engines/ceres/ceres_problem.h"
#include "oriel/graph/fingerprint.h"

namespace oriel {
namespace {

using testing_graph::RandomGraph;

// Its gauge is free and its start far off: damped from the beginning, a step has an answer to many digits.
constexpr double kDamped = 1e-2;

// C7, C8
TEST(CeresFollows, RandomEditsAndHoldsWhatAnEngineMadeAfreshHolds) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    RandomGraph random(seed, true);
    NativeEngine native(random.graph);
    CeresEngine ceres(random.graph), late(random.graph);
    for (int round = 0; round < 150; ++round) {
      ASSERT_TRUE(random.step(round % 50 == 49 ? 60 : 6));
      const auto ok = check(ceres, random.graph);
      ASSERT_TRUE(ok) << "seed " << seed << ", round " << round << ": " << ok.error();
      CeresEngine fresh(random.graph);
      const double cost = ceres.cost();
      ASSERT_LT(relative_difference(cost, fresh.cost()), 1e-12) << "seed " << seed << ", round " << round;
      ASSERT_LT(relative_difference(cost, native.cost()), 1e-12) << "seed " << seed << ", round " << round;
      if (round % 31 == 7) {
        ASSERT_TRUE(check(late, random.graph)) << "seed " << seed << ", round " << round;
      }
      if (round % 10 == 3) {  // either engine moves the values, of which no edit tells the other
        Engine& solver = round % 20 == 3 ? static_cast<Engine&>(native) : ceres;
        ASSERT_FALSE(solver.solve({.max_iterations = 2, .initial_lambda = kDamped}).failed());
        ASSERT_TRUE(check(ceres, random.graph)) << solver.name() << ", seed " << seed << ", round " << round;
      }
    }
  }
}

// C7
TEST(CeresFollows, AndStepsToWhereAnEngineMadeAfreshSteps) {
  const SolveOptions one{.max_iterations = 1, .initial_lambda = kDamped};
  double moved = 0.0;
  for (unsigned seed = 21; seed <= 24; ++seed) {
    RandomGraph random(seed, true), same(seed, true);
    CeresEngine ceres(random.graph);
    for (int round = 0; round < 80; ++round) {
      ASSERT_TRUE(random.step(6));
      ASSERT_TRUE(same.step(6));
      ASSERT_TRUE(ceres.sync());
      if (round % 8 != 7) continue;
      const Summary a = ceres.solve(one), b = CeresEngine(same.graph).solve(one);
      ASSERT_FALSE(a.failed()) << a;
      EXPECT_EQ(a.factors, b.factors);
      EXPECT_EQ(a.kept_dim, b.kept_dim);
      EXPECT_LT(relative_difference(a.final_cost, b.final_cost), 1e-9) << "seed " << seed << ", round " << round;
      moved = std::max(moved, a.initial_cost - a.final_cost);
    }
  }
  EXPECT_GT(moved, 1.0);
}

// C2
TEST(CeresFollows, WithoutTouchingWhatNoEditNames) {
  Graph graph;
  GraphEdit edit = graph.edit();
  std::vector<VariableId<Point3d>> points;
  std::vector<FactorId> factors;
  for (int k = 0; k < 30; ++k) {
    points.push_back(edit.add(Point3d{{{1.0 * k, 0.0, 0.0}}}));
    if (k > 0) factors.push_back(edit.add(Between{Point3d{{{1.0, 0.0, 0.0}}}}, Sigma(0.1), points[k - 1], points[k]));
  }
  edit.add(Prior{Point3d{}}, Sigma(0.1), points[0]);
  ASSERT_TRUE(graph.apply(edit));
  const Subscription follower = graph.subscribe();
  ceres_detail::CeresProblem problem;
  GraphEdit net;
  const auto look = [&] {
    graph.collect(follower, net);
    problem.apply(net);
    problem.take_values(graph);
    std::vector<ceres::ResidualBlockId> blocks;
    problem.problem().GetResidualBlocks(&blocks);
    std::set<std::pair<ceres::ResidualBlockId, const ceres::CostFunction*>> held;
    for (const auto b : blocks) held.emplace(b, problem.problem().GetCostFunctionForResidualBlock(b));
    return held;
  };
  const auto before = look();
  ASSERT_EQ(before.size(), 30u);
  GraphEdit some = graph.edit();
  some.remove(points[10]);  // and with it the two factors there
  some.remove(factors[20]);
  some.set(points[3], Point3d{{{3.5, 0.0, 0.0}}});
  some.set(factors[5], Huber(1.0));
  some.fix(points[0]);
  some.add(Between{Point3d{{{2.0, 0.0, 0.0}}}}, Sigma(0.1), points[9], points[11]);
  ASSERT_TRUE(graph.apply(some));
  const auto after = look();
  EXPECT_EQ(after.size(), 28u);
  std::size_t kept = 0;
  for (const auto& block : before) kept += after.count(block);
  EXPECT_GE(kept, 27u);
  EXPECT_LE(kept, 28u);  // the new one may stand where one was that left
}

// C1: one that falls too far behind is given the whole graph.
TEST(CeresFollows, AlsoWhereItHadFallenTooFarBehind) {
  RandomGraph random(8);
  random.graph.bound_log({.per_live = 0.0, .least = 4});
  CeresEngine ceres(random.graph);
  NativeEngine native(random.graph);
  for (int round = 0; round < 20; ++round) {
    for (int i = 0; i <= round % 5; ++i) ASSERT_TRUE(random.step(20));
    const auto ok = check(ceres, random.graph);
    ASSERT_TRUE(ok) << round << ": " << ok.error();
    ASSERT_LT(relative_difference(ceres.cost(), native.cost()), 1e-12) << round;
  }
}

// Edits of all kinds, a solve now and then.
std::uint64_t run_with_ceres(unsigned seed) {
  RandomGraph random(seed);
  CeresEngine ceres(random.graph);
  for (int round = 0; round < 60; ++round) {
    EXPECT_TRUE(random.step(8));
    if (round % 6 != 5) continue;
    EXPECT_FALSE(ceres.solve({.max_iterations = 3, .initial_lambda = kDamped}).failed());
  }
  return fingerprint(random.graph);
}

TEST(CeresFollows, WithTheSameBitsWhereTheSameCameInTheSameSteps) {
  const std::uint64_t first = run_with_ceres(5);
  const std::vector<std::unique_ptr<int>> elsewhere = [] {  // other addresses for what comes
    std::vector<std::unique_ptr<int>> v;
    for (int i = 0; i < 1001; ++i) v.push_back(std::make_unique<int>(i));
    return v;
  }();
  EXPECT_EQ(run_with_ceres(5), first);
  EXPECT_NE(run_with_ceres(6), first);
}

// C5
TEST(CeresFollows, AndWritesNothingOverAValueThatTheUserSetMeanwhile) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto a = edit.add(Point3d{{{5.0, 0.0, 0.0}}}), b = edit.add(Point3d{{{5.0, 0.0, 0.0}}});
  edit.add(Prior{Point3d{}}, Sigma(1.0), a);
  edit.add(Prior{Point3d{}}, Sigma(1.0), b);
  ASSERT_TRUE(graph.apply(edit));
  CeresEngine ceres(graph);
  bool set = false;
  const Summary summary = ceres.solve({.callback = [&](const IterationReport&) {
    if (set) return true;
    set = true;
    GraphEdit newer = graph.edit();
    newer.set(a, Point3d{{{7.0, 0.0, 0.0}}});
    return graph.apply(newer).ok();
  }});
  EXPECT_TRUE(summary.converged()) << summary;
  EXPECT_EQ(graph.value(a).p[0], 7.0);
  EXPECT_NEAR(graph.value(b).p[0], 0.0, 1e-6);
  EXPECT_NEAR(summary.fresh_cost, 24.5, 1e-9);
  EXPECT_TRUE(check(ceres, graph));
}

// C6
TEST(CeresFollows, FlagsOfVariablesThatHaveFactors) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto a = edit.add(Point3d{}), b = edit.add(Point3d{{{3.0, 0.0, 0.0}}});
  edit.add(Prior{Point3d{}}, Sigma(1.0), a);
  edit.add(Between{Point3d{{{1.0, 0.0, 0.0}}}}, Sigma(1.0), a, b);
  ASSERT_TRUE(graph.apply(edit));
  CeresEngine ceres(graph);
  for (const bool fixed : {true, true, false, true}) {
    GraphEdit flag = graph.edit();
    flag.fix(b, fixed);
    flag.set(b, Point3d{{{3.0, 0.0, 0.0}}});
    ASSERT_TRUE(graph.apply(flag));
    ASSERT_TRUE(check(ceres, graph));
    EXPECT_EQ((*ceres.contents()).parameters.size(), fixed ? 1u : 2u);
    const Summary summary = ceres.solve();
    EXPECT_TRUE(summary.converged()) << summary;
    EXPECT_NEAR(graph.value(a).p[0], fixed ? 1.0 : 0.0, 1e-6);
    EXPECT_NEAR(graph.value(b).p[0], fixed ? 3.0 : 1.0, 1e-6);
  }
}

struct Saturating {  // x / √(1 + x²): from 3, Gauss–Newton steps to -27
  static constexpr std::string_view kName = "test.saturating/1";
  using Variables = Types<VectorNd<1>>;
  double measured = 0.0;
  template <class S>
  S operator()(const VectorN<S, 1>& x) const {
    using std::sqrt;
    return x.v[0] / sqrt(1.0 + x.v[0] * x.v[0]) - measured;
  }
};

TEST(CeresEngine, SaysThatGaussNewtonDivergesAndLeavesTheGraphAsItWas) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto x = edit.add(VectorNd<1>{{{3.0}}});
  edit.add(Saturating{}, Sigma(1.0), x);
  ASSERT_TRUE(graph.apply(edit));
  for (const bool native : {true, false}) {
    const SolveOptions options{.method = Method::gauss_newton};
    const Summary s = native ? NativeEngine(graph).solve(options) : CeresEngine(graph).solve(options);
    EXPECT_EQ(s.reason, Reason::diverged) << s;
    EXPECT_GT(s.reason_value, s.reason_bound) << s;
    EXPECT_EQ(graph.value(x).v[0], 3.0);
  }
}

TEST(CeresEngine, RefusesInWordsWhatItCannotDo) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto x = edit.add(VectorNd<1>{{{3.0}}});
  edit.add(Saturating{}, Sigma(1.0), x);
  ASSERT_TRUE(graph.apply(edit));
  const std::uint64_t before = fingerprint(graph);
  CeresEngine ceres(graph);
  const Summary cg = ceres.solve({.linear_solver = LinearSolver::conjugate_gradient});
  EXPECT_EQ(cg.reason, Reason::refused);
  EXPECT_EQ(cg.reason_text(), "the engine ceres has no conjugate gradients");
  EXPECT_EQ(ceres.solve({.ordering = OrderingMethod::nested_dissection}).reason_text(),
            "the engine ceres has no choice of orderings");
  EXPECT_EQ(fingerprint(graph), before);
  EXPECT_TRUE(ceres.solve().converged());
}

}  // namespace
}  // namespace oriel
