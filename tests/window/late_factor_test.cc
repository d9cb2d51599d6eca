// Late factors of other kinds: on what was open, on what is known, on poses that turn.
#include <gtest/gtest.h>

#include <cmath>

#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/solve/native_engine.h"
#include "oriel/window/marginalize.h"
#include "residual/random_values.h"
#include "window/dense_oracle.h"

namespace oriel {
namespace {

using dense_oracle::difference;
using dense_oracle::MatrixXd;
using dense_oracle::System;
using dense_oracle::VectorXd;
using testing_values::Random;
using Point = VectorNd<3>;
using PointId = VariableId<Point>;

// Sums of two components only, so that the rest of x is open until a late factor closes it.
struct Sum {
  static constexpr std::string_view kName = "test.sum/1";
  static constexpr int kDim = 1;
  using Variables = Types<Point, Point>;
  double z = 0.0;
  bool evaluate(const Point& x, const Point& y, Vec<double, 1>& r, Mat<double, 1, 3>* J_x,
                Mat<double, 1, 3>* J_y) const {
    r[0] = x.v[0] + x.v[1] - y.v[2] - z;
    if (J_x != nullptr) {
      *J_x = Mat<double, 1, 3>::zero(), *J_y = Mat<double, 1, 3>::zero();
      (*J_x)(0, 0) = (*J_x)(0, 1) = 1.0, (*J_y)(0, 2) = -1.0;
    }
    return true;
  }
  bool finite() const { return std::isfinite(z); }
};

// W7, M4
TEST(LateFactor, ALateFactorMayDetermineWhatNothingDidBefore) {
  for (const SquareRootMethod method : {SquareRootMethod::qr, SquareRootMethod::schur}) {
    Graph window, batch;
    PointId x[2], y[2], z[2];
    int side = 0;
    for (Graph* graph : {&window, &batch}) {
      GraphEdit edit = graph->edit();
      x[side] = edit.add(Point{}), y[side] = edit.add(Point{}), z[side] = edit.add(Point{});
      edit.add(Prior{Point{{{1, 2, 3}}}}, Sigma(0.5), y[side]);
      edit.add(Prior{Point{{{0, 1, 0}}}}, Sigma(2.0), z[side]);
      edit.add(Sum{0.3}, Sigma(0.1), x[side], y[side]);
      ASSERT_TRUE(graph->apply(edit).ok());
      ++side;
    }
    LateLedger ledger;
    Marginalizer marginalizer;
    GraphEdit edit = window.edit(), late = batch.edit();
    const VariableKey leaving = x[0];
    const auto report = marginalizer.marginalize(window, {&leaving, 1}, {.method = method, .ledger = &ledger}, edit);
    ASSERT_TRUE(report.ok());
    EXPECT_EQ(report->undetermined.size(), 2u);
    ASSERT_TRUE(window.apply(edit).ok());
    ledger.commit();
    // Two loops through x to z: only together do they say something about y and z.
    for (const double measured : {0.2, -0.5, 0.4}) {
      edit.clear();
      late.clear();
      const Point d{{{measured, 2.0 * measured, -1.0}}};
      const auto loop = detach(Between{d}, Sigma(0.3), x[0], z[0]);
      EXPECT_EQ(ledger.fold(window, loop.view(), edit), LateOutcome::folded);
      ASSERT_TRUE(window.apply(edit).ok());
      ledger.commit();
      late.add(Between{d}, Sigma(0.3), x[1], z[1]);
      ASSERT_TRUE(batch.apply(late).ok());
      const System few = dense_oracle::system(window), all = dense_oracle::system(batch);
      const System want = dense_oracle::schur_complement(all, few);
      EXPECT_LT(difference(few.H, want.H), 1e-10);
      EXPECT_LT(difference(few.g, want.g), 1e-10);
    }
  }
}

// W7
TEST(LateFactor, AFixedVariableThatLeftIsKnownToLateFactors) {
  Graph window, batch;
  PointId x[2][3];
  int side = 0;
  for (Graph* graph : {&window, &batch}) {
    GraphEdit edit = graph->edit();
    for (PointId& id : x[side]) id = edit.add(Point{{{1, -1, 2}}});
    for (int i = 0; i < 2; ++i) edit.add(Between{Point{{{1, 0, 0}}}}, Sigma(0.2), x[side][i], x[side][i + 1]);
    edit.fix(x[side][0]);
    ASSERT_TRUE(graph->apply(edit).ok());
    ++side;
  }
  LateLedger ledger;
  Marginalizer marginalizer;
  GraphEdit edit = window.edit(), late = batch.edit();
  const VariableKey leaving[] = {x[0][0], x[0][1]};
  ASSERT_TRUE(marginalizer.marginalize(window, leaving, {.ledger = &ledger}, edit).ok());
  ASSERT_TRUE(window.apply(edit).ok());
  ledger.commit();
  edit.clear();
  const Point d{{{0.5, 3.0, 0.25}}};
  for (const int to : {1, 2}) {
    const auto loop = detach(Between{d}, Sigma(0.1), x[0][0], x[0][to]);
    EXPECT_EQ(ledger.fold(window, loop.view(), edit), LateOutcome::folded);
    late.add(Between{d}, Sigma(0.1), x[1][0], x[1][to]);
  }
  ASSERT_TRUE(window.apply(edit).ok());
  ASSERT_TRUE(batch.apply(late).ok());
  const System few = dense_oracle::system(window), all = dense_oracle::system(batch);
  const System want = dense_oracle::schur_complement(all, few);
  EXPECT_LT(difference(few.H, want.H), 1e-10);
  EXPECT_LT(difference(few.g, want.g), 1e-10);
}

// ---- nonlinear: a chain of poses that turns, with absolute and relative measurements ----

struct PoseChain {
  Graph graph;
  std::vector<VariableId<Pose3d>> poses;
  std::vector<Pose3d> truth;

  PoseChain(int n, double error) {
    Random random(9);
    GraphEdit edit = graph.edit();
    const Pose3d step{Rot3d::exp({{0.05, -0.1, 0.2}}), {{0.5, 0.1, 0.0}}};
    for (int i = 0; i < n; ++i) {
      truth.push_back(i == 0 ? Pose3d{} : truth.back() * step);
      poses.push_back(edit.add(truth.back().plus(random.normal<6>(error))));
      if (i > 0) edit.add(Between{step.plus(random.normal<6>(error))}, Sigma(0.05), poses[i - 1], poses[i]);
    }
    edit.add(Prior{truth[0]}, Sigma(0.05), poses[0]);
    EXPECT_TRUE(graph.apply(edit).ok());
  }
};

// How far the last pose is from where it is had the loop come in time; and how far had it not come at all.
std::pair<double, double> late_error(double error) {
  PoseChain in_time(12, error), late(12, error), never(12, error);
  Random random(21);
  const auto d = (in_time.truth[3].inverse() * in_time.truth[11]).plus(random.normal<6>(error));
  GraphEdit direct = in_time.graph.edit();
  direct.add(Between{d}, Sigma(0.02), Huber(1.0), in_time.poses[3], in_time.poses[11]);
  EXPECT_TRUE(in_time.graph.apply(direct).ok());
  LateLedger ledger;
  Marginalizer marginalizer;
  const SolveOptions tight{.function_tolerance = 1e-14};
  for (PoseChain* chain : {&late, &never}) {
    NativeEngine engine(chain->graph);
    EXPECT_FALSE(engine.solve(tight).failed());
    GraphEdit edit = chain->graph.edit();
    for (int i = 0; i < 8; ++i) {
      const VariableKey id = chain->poses[i];
      EXPECT_TRUE(
          marginalizer.marginalize(chain->graph, {&id, 1}, {.ledger = chain == &late ? &ledger : nullptr}, edit).ok());
      EXPECT_TRUE(chain->graph.apply(edit).ok());
      ledger.commit();
    }
    if (chain == &late) {
      edit.clear();
      const auto loop = detach(Between{d}, Sigma(0.02), Huber(1.0), late.poses[3], late.poses[11]);
      EXPECT_EQ(ledger.fold(late.graph, loop.view(), edit), LateOutcome::folded);
      EXPECT_TRUE(late.graph.apply(edit).ok());
      ledger.commit();
    }
    EXPECT_FALSE(engine.solve(tight).failed());
  }
  NativeEngine engine(in_time.graph);
  EXPECT_FALSE(engine.solve(tight).failed());
  const Pose3d want = in_time.graph.value(in_time.poses[11]);
  return {late.graph.value(late.poses[11]).minus(want).norm(), never.graph.value(never.poses[11]).minus(want).norm()};
}

// W7
TEST(LateFactor, NonlinearPosesEndNearWhereTheyWouldHaveAndTheNearerTheSmallerTheErrors) {
  const auto [large, large_never] = late_error(0.02);
  const auto [small, small_never] = late_error(0.002);
  EXPECT_LT(large, large_never * large_never);  // what is left is of second order
  EXPECT_LT(small, small_never * small_never);
}

// W7
TEST(LateFactor, OldPosesAreSmoothedByWhatCameSince) {
  PoseChain chain(10, 0.02);
  NativeEngine engine(chain.graph);
  ASSERT_FALSE(engine.solve({}).failed());
  LateLedger ledger;
  Marginalizer marginalizer;
  GraphEdit edit = chain.graph.edit();
  std::vector<Pose3d> left;
  for (int i = 0; i < 5; ++i) {
    const VariableKey id = chain.poses[i];
    left.push_back(chain.graph.value(chain.poses[i]));
    ASSERT_TRUE(marginalizer.marginalize(chain.graph, {&id, 1}, {.ledger = &ledger}, edit).ok());
    ASSERT_TRUE(chain.graph.apply(edit).ok());
    ledger.commit(Time{i});
  }
  PoseChain whole(10, 0.02);
  for (PoseChain* c : {&chain, &whole}) {
    GraphEdit e = c->graph.edit();
    e.add(Prior{c->truth[9].plus({{0, 0, 0, 0.01, 0.02, 0.0}})}, Sigma(0.01), c->poses[9]);
    ASSERT_TRUE(c->graph.apply(e).ok());
    NativeEngine again(c->graph);
    ASSERT_FALSE(again.solve({.function_tolerance = 1e-14}).failed());
  }
  for (int i = 0; i < 5; ++i) {
    Pose3d smoothed;
    ASSERT_TRUE(ledger.smoothed(chain.graph, chain.poses[i], &smoothed));
    const Pose3d want = whole.graph.value(whole.poses[i]);
    EXPECT_LT(smoothed.minus(want).norm(), 0.05 * left[i].minus(want).norm());
    EXPECT_EQ(ledger.find(Time{i}, kVariableOps<Pose3d>.key), VariableKey(chain.poses[i]));
  }
  EXPECT_FALSE(ledger.holds(ledger.find(Time{77}, kVariableOps<Pose3d>.key)));
}

// W7
TEST(LateFactor, OutliersAndInvalidFactorsAreRefusedAtTheSmoothedEstimate) {
  PoseChain chain(6, 0.01);
  NativeEngine engine(chain.graph);
  ASSERT_FALSE(engine.solve({}).failed());
  LateLedger ledger({.outlier_threshold = 8.0});
  Marginalizer marginalizer;
  GraphEdit edit = chain.graph.edit();
  const VariableKey id = chain.poses[0];
  ASSERT_TRUE(marginalizer.marginalize(chain.graph, {&id, 1}, {.ledger = &ledger}, edit).ok());
  ASSERT_TRUE(chain.graph.apply(edit).ok());
  ledger.commit();
  edit.clear();
  const auto wrong = detach(Prior{Pose3d{Rot3d{}, {{1, 0, 0}}}}, Sigma(0.01), Huber(1.0), chain.poses[0]);
  EXPECT_EQ(ledger.fold(chain.graph, wrong.view(), edit), LateOutcome::outlier);
  const auto broken = detach(Prior{Pose3d{Rot3d{}, {{NAN, 0, 0}}}}, Sigma(0.01), chain.poses[0]);
  EXPECT_EQ(ledger.fold(chain.graph, broken.view(), edit), LateOutcome::invalid);
  EXPECT_TRUE(edit.empty());
  EXPECT_EQ(ledger.count(LateOutcome::outlier) + ledger.count(LateOutcome::invalid), 2);
}

}  // namespace
}  // namespace oriel
