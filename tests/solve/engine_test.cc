// An engine and its graph: what is written back, the same bits whatever is dropped, and no surprise in between.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <random>

#include "linear/random_problem.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

using testing::Markd;
using testing::Mix;
using testing::RandomProblem;
using Scalar = VectorNd<1>;

struct Fragile {  // ⊞ of a long step is not a number
  static constexpr std::string_view kName = "test.fragile/1";
  static constexpr int kDim = 1;
  double x = 0.0;
  Fragile plus(const Vec1d& d) const {
    return {std::fabs(d[0]) > 1.0 ? std::numeric_limits<double>::quiet_NaN() : x + d[0]};
  }
  Vec1d minus(const Fragile& o) const { return {x - o.x}; }
};
struct Far {
  static constexpr std::string_view kName = "test.far/1";
  static constexpr int kDim = 1;
  using Variables = Types<Fragile>;
  double m = 0.0;
  bool evaluate(const Fragile& x, Vec1d& r, Mat<double, 1, 1>* j) const {
    r[0] = x.x - m;
    if (j != nullptr) (*j)(0, 0) = 1.0;
    return true;
  }
};

std::unique_ptr<RandomProblem> problem(unsigned seed) {
  auto p = std::make_unique<RandomProblem>(seed);
  const auto x = p->variables<VectorNd<6>>(25);
  const auto v = p->variables<VectorNd<3>>(20);
  const auto m = p->variables<Markd<3>>(60);
  for (int i = 0; i < 500; ++i) p->factor<2>(i % 2 == 0 ? Huber(0.9) : Loss::none(), p->any(x), p->any(m));
  for (int i = 0; i < 60; ++i) p->factor<3>(p->any(x), p->any(v));
  for (const auto id : x) p->factor<6>(id);
  for (const auto id : v) p->factor<3>(id);
  p->prior({x[0], v[0]}, {6, 3}, 9);
  EXPECT_TRUE(p->apply());
  return p;
}

// A pose graph and a bundle adjustment that are large enough for slices and subtrees: kept variables along a chain with
// loops, or each landmark seen from some.
std::unique_ptr<RandomProblem> large_problem(bool landmarks) {
  auto p = std::make_unique<RandomProblem>(6);
  const auto x = p->variables<VectorNd<6>>(landmarks ? 110 : 1800);
  for (std::size_t i = 0; i + 1 < x.size(); ++i) p->factor<6>(x[i], x[i + 1]);
  for (std::size_t i = 0; i + 20 < x.size(); ++i) p->factor<6>(Huber(1.0), x[i], x[i + 20]);
  for (const auto id : x) p->factor<6>(id);
  const auto m = p->variables<Markd<3>>(landmarks ? 600 : 1);
  for (int i = 0; i < (landmarks ? 9600 : 3); ++i) p->factor<3>(Huber(0.9), p->any(x), p->any(m));
  for (const auto id : m) p->factor<3>(id);
  EXPECT_TRUE(p->apply());
  return p;
}

// The window is small, with priors; the others are sliced.
TEST(NativeEngine, GivesTheSameBitsForAnyNumberOfThreadsAndInTwoRuns) {  // L10
  const std::function<std::unique_ptr<RandomProblem>()> problems[] = {
      [] { return problem(5); }, [] { return large_problem(false); }, [] { return large_problem(true); }};
  std::size_t sliced = 0;
  for (const auto& make : problems) {
    std::vector<std::uint64_t> prints;
    std::vector<std::vector<double>> costs;
    for (const int threads : {1, 2, 3, 1}) {
      auto p = make();
      NativeEngine engine(p->graph);
      SolveOptions options;
      options.threads = threads;
      options.max_iterations = 12;
      const Summary s = engine.solve(options);
      EXPECT_GT(s.accepted, 3) << s;
      prints.push_back(fingerprint(p->graph));
      costs.emplace_back();
      for (const auto& r : s.trace) costs.back().push_back(r.cost);
      for (std::size_t t = 0; t < engine.structure().plan_count(); ++t)
        sliced += !engine.structure().plans()[t].slices.empty();
    }
    for (std::size_t i = 1; i < prints.size(); ++i) {
      EXPECT_EQ(prints[i], prints[0]);
      EXPECT_EQ(costs[i], costs[0]);
    }
  }
  EXPECT_GE(sliced, 4u);
}

// Edits of a random window and solves of a few iterations; `drop` decides when caches go.
std::vector<std::uint64_t> run_window(const std::function<bool(int)>& drop) {
  RandomProblem p(9);
  std::vector<VariableId<VectorNd<3>>> x = p.variables<VectorNd<3>>(3);
  std::vector<VariableId<Markd<2>>> m = p.variables<Markd<2>>(5);
  for (const auto id : x) p.factor<3>(id);
  p.prior({x[0], x[1]}, {3, 3}, 6);
  EXPECT_TRUE(p.apply());
  NativeEngine engine(p.graph);
  std::vector<std::uint64_t> prints;
  for (int round = 0; round < 25; ++round) {
    GraphEdit edit = p.graph.edit();
    const auto next = edit.add(VectorNd<3>{{{0.1 * round, 0.2, 0.3}}});
    edit.add(Between{VectorNd<3>{{{0.1, 0.0, 0.0}}}}, Sigma(0.5), x.back(), next);
    x.push_back(next);
    m.push_back(edit.add(Markd<2>{}));
    for (int k = 0; k < 7; ++k)
      edit.add(Mix<2, VectorNd<3>, Markd<2>>{p.normal(), 0.3, 0.1}, Sigma(1.0), p.any(x), p.any(m));
    EXPECT_TRUE(p.graph.apply(edit));
    if (x.size() > 6) {
      GraphEdit removal = p.graph.edit();
      removal.remove(x.front());
      removal.remove(m.front());
      x.erase(x.begin()), m.erase(m.begin());
      EXPECT_TRUE(p.graph.apply(removal));
    }
    SolveOptions options;
    options.max_iterations = 3;
    if (drop(round)) engine.drop_caches();
    static_cast<void>(engine.solve(options));
    prints.push_back(fingerprint(p.graph));
  }
  return prints;
}

TEST(NativeEngine, GivesTheSameBitsWithEveryCacheDroppedAtRandomMoments) {  // L10
  const auto kept = run_window([](int) { return false; });
  EXPECT_EQ(run_window([](int) { return true; }), kept);
  std::mt19937 random(1);
  EXPECT_EQ(run_window([&](int) { return random() % 3 == 0; }), kept);
  EXPECT_EQ(run_window([](int) { return false; }), kept);
}

TEST(NativeEngine, NeverWritesOverAValueThatTheUserSetDuringTheSolve) {  // C5
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto a = edit.add(Scalar{{{5.0}}}), b = edit.add(Scalar{{{5.0}}});
  edit.add(Prior{Scalar{}}, Sigma(1.0), a);
  edit.add(Prior{Scalar{}}, Sigma(1.0), b);
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  SolveOptions options;
  options.callback = [&](const IterationReport& r) {
    if (r.iteration != 1) return true;
    GraphEdit set = graph.edit();
    set.set(b, Scalar{{{7.0}}});
    return graph.apply(set).ok();
  };
  EXPECT_TRUE(engine.solve(options).converged());
  EXPECT_NEAR(graph.value(a).v[0], 0.0, 1e-6);
  EXPECT_EQ(graph.value(b).v[0], 7.0);
}

TEST(NativeEngine, RaisesNoFlagForFollowersWhenItWritesBack) {  // C5
  auto p = problem(2);
  const Subscription follower = p->graph.subscribe();
  GraphEdit net;
  p->graph.collect(follower, net);
  NativeEngine engine(p->graph);
  EXPECT_GT(engine.solve().accepted, 0);
  p->graph.collect(follower, net);
  EXPECT_TRUE(net.empty());
}

TEST(NativeEngine, SolvesOnAfterARefusedEditThatNamedANewType) {  // V5
  auto p = problem(3);
  NativeEngine engine(p->graph);
  SolveOptions options;
  options.max_iterations = 2;
  static_cast<void>(engine.solve(options));
  GraphEdit edit = p->graph.edit();
  const auto x = edit.add(VectorNd<8>{});
  edit.add(Prior{VectorNd<8>{}}, Sigma(0.0), x);
  ASSERT_FALSE(p->graph.apply(edit));
  const Summary s = engine.solve(options);
  EXPECT_FALSE(s.failed());
  EXPECT_EQ(engine.cost(), s.final_cost);
}

TEST(NativeEngine, TakesAStepBackThatLeadsToAValueThatIsNotFinite) {  // L3, L4, C5
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto x = edit.add(Fragile{});
  const auto y = edit.add(Scalar{});
  edit.add(Far{100.0}, Sigma(1.0), x);
  edit.add(Prior{Scalar{{{50.0}}}}, Sigma(1.0), y);  // falls, and makes the step look good
  ASSERT_TRUE(graph.apply(edit));
  const std::uint64_t before = fingerprint(graph);
  NativeEngine engine(graph);
  // Gauss–Newton knows no shorter step.
  const Summary straight = engine.solve({.method = Method::gauss_newton});
  EXPECT_EQ(straight.reason, Reason::diverged);
  EXPECT_EQ(fingerprint(graph), before);
  EXPECT_EQ(straight.final_cost, straight.initial_cost);
  for (const Method method : {Method::levenberg_marquardt, Method::dogleg}) {
    GraphEdit back = graph.edit();
    back.set(x, Fragile{}), back.set(y, Scalar{});
    ASSERT_TRUE(graph.apply(back));
    const Summary s = engine.solve({.method = method, .max_iterations = 1000});
    EXPECT_TRUE(s.converged()) << s;
    EXPECT_NEAR(graph.value(x).x, 100.0, 1e-3);
    EXPECT_EQ(s.not_finite_factors, 0);
    EXPECT_EQ(engine.cost(), s.final_cost);
  }
}

TEST(NativeEngine, FollowsFixedFlagsBetweenSolves) {  // C6
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto a = edit.add(Scalar{{{5.0}}});
  edit.add(Prior{Scalar{}}, Sigma(1.0), a);
  edit.fix(a);
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  EXPECT_EQ(engine.solve().reason, Reason::nothing_to_do);
  EXPECT_EQ(graph.value(a).v[0], 5.0);
  GraphEdit free = graph.edit();
  free.fix(a, false);
  ASSERT_TRUE(graph.apply(free));
  EXPECT_TRUE(engine.solve().converged());
  EXPECT_NEAR(graph.value(a).v[0], 0.0, 1e-9);
}

}  // namespace
}  // namespace oriel
