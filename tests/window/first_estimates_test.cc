#include <gtest/gtest.h>

#include "window/dense_oracle.h"
#include "window/inertial_window.h"

namespace oriel {
namespace {

using dense_oracle::difference;
using dense_oracle::System;
using inertial_window::InertialWindow;

// The largest leak of information into the gauge over some slides of a window of five keyframes.
double worst_leak(bool first_estimates, SquareRootMethod method, int slides) {
  InertialWindow window(slides + 6);
  NativeEngine engine(window.graph);
  Marginalizer marginalizer;
  double worst = 0.0;
  for (int i = 0; i < 4; ++i) window.grow();
  for (int i = 0; i < slides; ++i) {
    window.grow();
    SolveOptions options;
    options.max_iterations = 4;
    options.first_estimates = first_estimates;
    (void)engine.solve(options);
    window.slide({.first_estimates = first_estimates, .method = method}, marginalizer);
    worst = std::max(worst, window.gauge_leak());
  }
  return worst;
}

// M8
TEST(FirstEstimates, KeepTheGaugeOfAVisualInertialWindowFreeOfInformation) {
  EXPECT_LE(worst_leak(true, SquareRootMethod::automatic, 20), 1e-9);
  EXPECT_LE(worst_leak(true, SquareRootMethod::qr, 20), 1e-9);
}

// M8
TEST(FirstEstimates, AreWhatKeepsItWithPlainJacobiansTheGaugeIsLost) {
  EXPECT_GE(worst_leak(false, SquareRootMethod::automatic, 20), 1e-7);
  EXPECT_GE(worst_leak(false, SquareRootMethod::qr, 20), 1e-7);
}

// M8
TEST(FirstEstimates, LeaveNoRowOfThePriorForTheFourFreeDirections) {
  InertialWindow window(30);
  NativeEngine engine(window.graph);
  Marginalizer marginalizer;
  for (int i = 0; i < 4; ++i) window.grow();
  for (int i = 0; i < 12; ++i) {
    window.grow();
    (void)engine.solve();
    const MarginalizeReport report = window.slide({}, marginalizer);
    EXPECT_EQ(report.priors, 1);
    EXPECT_LE(report.prior_rows, report.prior_cols - 4);
  }
}

// M2
TEST(FirstEstimates, EnterTheAbsorbedJacobiansWhileResidualsAreThoseOfTheValues) {
  for (const bool first_estimates : {true, false})
    for (const SquareRootMethod method : {SquareRootMethod::qr, SquareRootMethod::schur}) {
      InertialWindow window(12);
      NativeEngine engine(window.graph);
      Marginalizer marginalizer;
      for (int i = 0; i < 5; ++i) window.grow();
      for (int i = 0; i < 3; ++i) {
        window.grow();
        SolveOptions options;
        options.max_iterations = 2;
        (void)engine.solve(options);
        const System whole = dense_oracle::system(window.graph, first_estimates);
        window.slide({.first_estimates = first_estimates, .method = method}, marginalizer);
        const System rest = dense_oracle::system(window.graph, first_estimates);
        const System want = dense_oracle::schur_complement(whole, rest);
        EXPECT_LT(difference(rest.H, want.H), 1e-9);
        EXPECT_LT(difference(rest.g, want.g), first_estimates ? 1e-9 : 1e-6);
      }
    }
}

// What a pose, velocity and bias are first taken for stays, whatever a later prior says.
TEST(FirstEstimates, StayWhereTheFirstPriorSetThem) {
  InertialWindow window(12);
  NativeEngine engine(window.graph);
  Marginalizer marginalizer;
  for (int i = 0; i < 5; ++i) window.grow();
  window.slide({}, marginalizer);
  const VariablePool& pool = *window.graph.find_pool(kVariableOps<Pose3d>.key);
  const auto estimate = [&](int state) {
    return *static_cast<const Pose3d*>(pool.first_estimate(pool.slots().find(window.states[state].pose.key)));
  };
  const Pose3d before = estimate(1);
  (void)engine.solve();
  window.slide({}, marginalizer);
  EXPECT_EQ(estimate(0).t, before.t);
  EXPECT_GT((window.graph.value(window.states[0].pose).t - before.t).norm(), 0.0);
}

}  // namespace
}  // namespace oriel
