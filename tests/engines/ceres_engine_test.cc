#include "oriel/engines/ceres/ceres_engine.h"

#include <gtest/gtest.h>

#include "engines/two_engines.h"
#include "engines/window_of_ten.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/residual/reprojection.h"
#include "oriel/solve/native_engine.h"
#include "oriel/testing/simulated_window.h"

namespace oriel {
namespace {

// C8
TEST(CeresEngine, HasTheSameCostAsNativeOnWindowsWithPriors) {
  WindowOfTen window;
  NativeEngine native(window.graph);
  CeresEngine ceres(window.graph);
  for (int k = 0; k < 10; ++k) {
    window.slide(k);
    EXPECT_LT(relative_difference(native.cost(), ceres.cost()), 1e-12) << "keyframe " << k;
    (void)native.solve({.max_iterations = 3});
    EXPECT_LT(relative_difference(native.cost(), ceres.cost()), 1e-12) << "keyframe " << k;
    if (k >= 5) window.marginalize_oldest();
    EXPECT_LT(relative_difference(native.cost(), ceres.cost()), 1e-12) << "keyframe " << k;
  }
  EXPECT_GT(native.cost(), 1.0);
  EXPECT_EQ(window.graph.priors().slots().size(), 1u);
}

// C8
TEST(CeresEngine, FindsTheSameOptimumAsNativeOfAWindowWithAPrior) {
  for (const bool first_estimates : {false, true}) {
    WindowOfTen a, b;
    NativeEngine native(a.graph);
    CeresEngine ceres(b.graph);
    const SolveOptions options{.function_tolerance = 1e-12, .first_estimates = first_estimates};
    for (int k = 0; k < 10; ++k) {
      a.slide(k), b.slide(k);
      const Summary x = native.solve(options), y = ceres.solve(options);
      EXPECT_TRUE(y.converged()) << y;
      EXPECT_LT(relative_difference(x.final_cost, y.final_cost), 1e-6) << "keyframe " << k;
      EXPECT_LT(relative_difference(y.final_cost, ceres.cost()), 1e-12);
      if (k >= 5) a.marginalize_oldest(), b.marginalize_oldest();
    }
  }
}

TEST(CeresEngine, LeavesFixedVariablesWhereTheyAre) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto a = edit.add(Pose3d{}), b = edit.add(Pose3d{}), c = edit.add(Pose3d{});
  const Pose3d step = Pose3d::exp({{0.1, 0.2, 0.3, 1.0, 2.0, 3.0}});
  edit.add(Between{step}, Sigma(0.1), a, b);
  edit.add(Between{step}, Sigma(0.1), b, c);
  edit.fix(a);
  expect_applied(graph, edit);
  const Summary summary = CeresEngine(graph).solve({});
  EXPECT_TRUE(summary.converged()) << summary;
  EXPECT_EQ(graph.value(a).minus(Pose3d{}).norm(), 0.0);
  EXPECT_LT(graph.value(c).minus(step * step).norm(), 1e-6);
}

TEST(CeresEngine, SolvesAFactorThatNamesOneVariableTwice) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto x = edit.add(VectorNd<2>{{{1.0, 1.0}}});
  edit.add(Prior<VectorNd<2>>{{{{3.0, 4.0}}}}, Sigma(1.0), x);
  edit.add(Between{VectorNd<2>{{{1.0, 0.0}}}}, Sigma(1.0), x, x);  // constant: r = -measured
  expect_applied(graph, edit);
  CeresEngine ceres(graph);
  const Summary summary = ceres.solve({});
  EXPECT_TRUE(summary.converged()) << summary;
  EXPECT_NEAR(graph.value(x).v[1], 4.0, 1e-6);
  EXPECT_NEAR(ceres.cost(), 0.5, 1e-12);
}

TEST(CeresEngine, LeavesOutFactorsThatAreNotValidAtTheStart) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto rig = edit.add(simulate_window({.keyframes = 1}).rig);
  const auto pose = edit.add(Pose3d{});
  const auto ahead = edit.add(Point3d{{{4.0, 0.1, 0.0}}}), behind = edit.add(Point3d{{{-4.0, 0.0, 0.0}}});
  edit.add(Prior<Pose3d>{Pose3d{}}, Sigma(0.01), pose);
  edit.add(Prior<Point3d>{{{{4.0, 0.0, 0.0}}}}, Sigma(0.1), ahead);
  edit.add(Prior<Point3d>{{{{-4.0, 0.1, 0.0}}}}, Sigma(0.1), behind);
  edit.add(MonoPointReprojectiond{{{367.0, 248.0}}}, Sigma(1.0), pose, ahead, rig);
  edit.add(MonoPointReprojectiond{{{367.0, 248.0}}}, Sigma(1.0), pose, behind, rig);
  expect_applied(graph, edit);
  CeresEngine ceres(graph);
  NativeEngine native(graph);
  EXPECT_LT(relative_difference(native.cost(), ceres.cost()), 1e-12);
  const Summary summary = ceres.solve({});
  EXPECT_TRUE(summary.converged()) << summary;
  EXPECT_EQ(summary.invalid_factors, 1);
  EXPECT_NEAR(graph.value(behind).p[1], 0.1, 1e-6);
}

// A value of half the size that its tangent has: the parameter block is larger than the value.
struct Narrow {
  static constexpr std::string_view kName = "test.narrow/1";
  static constexpr int kDim = 3;
  float x = 0, y = 0, z = 0;
  Narrow plus(const Vec3d& d) const {
    return {static_cast<float>(x + d[0]), static_cast<float>(y + d[1]), static_cast<float>(z + d[2])};
  }
  Vec3d minus(const Narrow& n) const { return {{x - double{n.x}, y - double{n.y}, z - double{n.z}}}; }
};

TEST(CeresEngine, SolvesForValuesThatAreSmallerThanTheirTangent) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto n = edit.add(Narrow{});
  edit.add(Prior<Narrow>{{1.0f, -2.0f, 3.0f}}, Sigma(0.5), n);
  expect_applied(graph, edit);
  (void)CeresEngine(graph).solve({});
  EXPECT_NEAR(graph.value(n).y, -2.0, 1e-6);
  EXPECT_NEAR(graph.value(n).z, 3.0, 1e-6);
}

TEST(CeresEngine, SaysByWhichInequalityItEnded) {
  WindowOfTen window;
  for (int k = 0; k < 6; ++k) window.slide(k);
  CeresEngine ceres(window.graph);
  const Summary summary = ceres.solve({.function_tolerance = 1e-6});
  EXPECT_EQ(summary.reason, Reason::function_tolerance) << summary;
  EXPECT_LE(summary.reason_value, summary.reason_bound);
  EXPECT_GT(summary.reason_value, 0.0);
  EXPECT_NEAR(summary.reason_bound, 1e-6 * summary.final_cost, 1e-12 * summary.final_cost);
  EXPECT_EQ(ceres.solve({.max_iterations = 50, .function_tolerance = 0.0, .gradient_tolerance = 1.0}).reason,
            Reason::gradient_tolerance);
  EXPECT_EQ(ceres.solve({.max_iterations = 0}).reason, Reason::max_iterations);
  double seconds = 0.0;  // of a clock that is told to tick
  const Summary late = ceres.solve({.function_tolerance = 0.0,
                                    .gradient_tolerance = 0.0,
                                    .deadline = Duration::from_seconds(4.5),
                                    .clock = [&seconds] { return seconds += 1.0; }});
  EXPECT_EQ(late.reason, Reason::deadline) << late;
  EXPECT_GT(late.reason_value, late.reason_bound);
}

TEST(CeresEngine, StopsWhenTheCallbackSaysSo) {
  WindowOfTen window;
  for (int k = 0; k < 6; ++k) window.slide(k);
  int calls = 0;
  const Summary summary =
      CeresEngine(window.graph).solve({.callback = [&calls](const IterationReport&) { return ++calls < 2; }});
  EXPECT_EQ(summary.reason, Reason::stopped_by_callback) << summary;
  EXPECT_EQ(calls, 2);
}

TEST(CeresEngine, HasNothingToDoInAnEmptyGraph) {
  Graph graph;
  CeresEngine ceres(graph);
  EXPECT_EQ(ceres.solve({}).reason, Reason::nothing_to_do);
  EXPECT_EQ(ceres.cost(), 0.0);
}

}  // namespace
}  // namespace oriel
