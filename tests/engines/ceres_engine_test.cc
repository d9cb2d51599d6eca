#include "oriel/engines/ceres/ceres_engine.h"

#include <gtest/gtest.h>

#include <vector>

#include "engines/two_engines.h"
#include "oriel/residual/between.h"
#include "oriel/residual/imu_residual.h"
#include "oriel/residual/prior.h"
#include "oriel/residual/reprojection.h"
#include "oriel/solve/native_engine.h"
#include "oriel/testing/simulated_window.h"
#include "oriel/window/marginalize.h"

namespace oriel {
namespace {

void expect_applied(Graph& graph, GraphEdit& edit) {
  const auto ok = graph.apply(edit);
  ASSERT_TRUE(ok) << ok.error();
}

// A stereo-inertial window of some keyframes whose oldest ones were marginalized.
class Window {
 public:
  Window() : stream_(simulate_window(options())) {}

  static SimulatedWindowOptions options() {
    SimulatedWindowOptions o;
    o.keyframes = 10, o.window = 6, o.landmarks = 60;
    return o;
  }
  void slide(int k) {
    GraphEdit edit = graph.edit();
    if (k == 0) rig_ = edit.add(stream_.rig);
    add_state(edit, k);
    for (const SimulatedObservation& o : stream_.keyframes[k].observations) add_observation(edit, o, k);
    expect_applied(graph, edit);
  }
  void marginalize_oldest() {
    const State s = states_[oldest_++];
    const VariableKey leaving[] = {s.pose, s.v, s.bias};
    GraphEdit edit = graph.edit();
    const auto report = marginalizer_.marginalize(graph, leaving, {}, edit);
    ASSERT_TRUE(report) << report.error();
    expect_applied(graph, edit);
  }
  Graph graph;

 private:
  struct State {
    VariableId<Pose3d> pose;
    VariableId<Velocity3d> v;
    VariableId<ImuBiasd> bias;
  };
  void add_state(GraphEdit& edit, int k) {
    const SimulatedKeyframe& frame = stream_.keyframes[k];
    const Vec6d off = {{0.01, -0.01, 0.02, 0.05, 0.02, -0.03}};
    const State s{edit.add(frame.T_world_body.plus(k == 0 ? Vec6d::zero() : off)), edit.add(frame.v),
                  edit.add(frame.bias)};
    states_.push_back(s);
    if (k == 0) {
      edit.add(Prior<Pose3d>{frame.T_world_body}, Sigma(1e-3), s.pose);
      edit.add(Prior<Velocity3d>{frame.v}, Sigma(1e-2), s.v);
      edit.add(Prior<ImuBiasd>{frame.bias}, Sigma(1e-2), s.bias);
    } else {
      const State& last = states_[k - 1];
      edit.add(ImuResiduald{frame.motion.motion}, imu_noise(frame.motion), last.pose, last.v, last.bias, s.pose, s.v,
               s.bias);
    }
  }
  void add_observation(GraphEdit& edit, const SimulatedObservation& o, int k) {
    const SimulatedTrack& track = stream_.tracks[o.track];
    if (track.anchor == k) {
      if (std::ssize(depths_) <= o.track) depths_.resize(o.track + 1);
      depths_[o.track] = edit.add(InverseDepthd{track.first_guess});
      edit.add(AnchorReprojectiond{track.bearing, o.pixel1}, Sigma(1.0), Huber(2.0), depths_[o.track], rig_);
    } else {
      edit.add(StereoReprojectiond{track.bearing, o.pixel0, o.pixel1}, Sigma(1.0), Cauchy(3.0),
               states_[track.anchor].pose, states_[k].pose, depths_[o.track], rig_);
    }
  }

  SimulatedWindow stream_;
  VariableId<StereoRigd> rig_;
  std::vector<State> states_;
  std::vector<VariableId<InverseDepthd>> depths_;
  std::size_t oldest_ = 0;
  Marginalizer marginalizer_;
};

// C8
TEST(CeresEngine, HasTheSameCostAsNativeOnWindowsWithPriors) {
  Window window;
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
    Window a, b;
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

TEST(CeresEngine, StopsWhenTheCallbackSaysSo) {
  Window window;
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
