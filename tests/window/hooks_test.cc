// The shipped hooks, each on a group that was put into a graph by hand.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "oriel/residual/between.h"
#include "oriel/residual/reprojection.h"
#include "oriel/window/cheirality_hook.h"
#include "oriel/window/gap_reset_hook.h"
#include "oriel/window/mahalanobis_gate.h"
#include "oriel/window/standstill_hook.h"
#include "residual/random_values.h"
#include "window/dense_oracle.h"

namespace oriel {
namespace {

using testing_values::euroc_like_rig;
using testing_values::Random;

constexpr Time at_ms(std::int64_t ms) { return {ms * 1000000}; }

struct Entered {
  Graph& graph;
  States states;
  int sensor = 3;
  Time newest;
  std::vector<FactorId> factors;
  std::vector<VariableKey> variables, new_variables;

  InsertionHook::Verdict pass(InsertionHook& hook) {
    GraphEdit edit = graph.edit();
    const auto verdict = hook.inserted(graph, states, {sensor, newest, factors, variables, new_variables}, edit);
    if (!verdict.reject && !verdict.reset) {
      EXPECT_TRUE(graph.apply(edit).ok());
    }
    return verdict;
  }
};

// A point that a prior knows with sigma 2, and a measurement of it with sigma 1, off by `error`.
struct KnownPoint {
  Graph graph;
  VariableId<Point3d> point;
  Entered group{graph, {}, 3, {}, {}, {}, {}};

  KnownPoint() {
    GraphEdit edit = graph.edit();
    point = edit.add(Point3d{});
    edit.add(Prior{Point3d{}}, Sigma(2.0), point);
    EXPECT_TRUE(graph.apply(edit).ok());
  }
  FactorId measure(double error, const Loss& loss = Loss::none()) {
    GraphEdit edit = graph.edit();
    const FactorId id = edit.add(Prior{Point3d{{{error, 0.0, 0.0}}}}, Sigma(1.0), loss, point);
    EXPECT_TRUE(graph.apply(edit).ok());
    group.factors.push_back(id);
    return id;
  }
};

// W9
TEST(MahalanobisGate, MeasuresByNoiseAloneOrByTheCovarianceWithoutTheFactor) {
  for (const Loss loss : {Loss::none(), Huber(1.0)})
    for (const bool with_covariance : {false, true}) {
      KnownPoint p;
      p.measure(5.0, loss);
      MahalanobisGate gate(p.graph);
      ASSERT_TRUE(gate.set(3, {.probability = 0.999, .with_covariance = with_covariance, .rejects_group = false}).ok());
      const auto verdict = p.group.pass(gate);
      if (!with_covariance) {
        EXPECT_NEAR(gate.last_distance(), 25.0, 1e-12);
        EXPECT_TRUE(verdict.reject);
      } else if (loss.kind == LossKind::none) {
        EXPECT_NEAR(gate.last_distance(), 25.0 / (1.0 + 4.0), 1e-9);  // S = σ² + P
        EXPECT_FALSE(verdict.reject);
      } else {
        EXPECT_FALSE(verdict.reject);
      }
    }
}

// W9
TEST(MahalanobisGate, MeasuresTheSameWhateverTheLossOfTheFactorIs) {
  for (const double error : {0.5, 3.0, 5.0, 40.0})
    for (const Loss& loss :
         {Loss::none(), Huber(1.0), Cauchy(0.5), GemanMcClure(1.0), Tukey(4.0), TruncatedSquares(2.0)})
      for (const bool with_covariance : {false, true}) {
        KnownPoint p;
        p.measure(error, loss);
        MahalanobisGate gate(p.graph);
        ASSERT_TRUE(
            gate.set(3, {.probability = 0.999, .with_covariance = with_covariance, .rejects_group = false}).ok());
        const double want = error * error / (with_covariance ? 1.0 + 4.0 : 1.0);  // S = σ² + P
        EXPECT_EQ(p.group.pass(gate).reject, want > 16.27);                       // χ² of 3 at 0.999
        EXPECT_NEAR(gate.last_distance(), want, 1e-9 * want) << error << " " << static_cast<int>(loss.kind);
      }
}

// W9: the columns of two variables, and S is no multiple of the identity.
TEST(MahalanobisGate, MeasuresAFactorOfTwoVariablesByTheirJointCovariance) {
  for (const Loss& loss : {Loss::none(), Cauchy(0.3)}) {
    Random random(8);
    Graph graph;
    Entered group{graph, {}, 3, {}, {}, {}, {}};
    GraphEdit edit = graph.edit();
    const auto x = edit.add(random.value<Pose3d>(0.4)), y = edit.add(random.value<Pose3d>(0.4));
    edit.add(Prior{random.value<Pose3d>(0.4)}, Sigma(0.2), x);
    edit.add(Between{random.value<Pose3d>(0.2)}, Sigmas(Vec6d{{0.1, 0.2, 0.3, 0.1, 0.05, 0.2}}), x, y);
    ASSERT_TRUE(graph.apply(edit).ok());
    const auto before = dense_oracle::system(graph, false);
    edit.clear();
    const FactorId id = edit.add(Between{random.value<Pose3d>(0.3)}, Sigma(0.15), loss, x, y);
    ASSERT_TRUE(graph.apply(edit).ok());
    group.factors.push_back(id);
    FactorProbe probe;
    ASSERT_TRUE(probe.look(graph, id, true));
    Eigen::VectorXd r(6);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(6, 12);
    for (int i = 0; i < 6; ++i) r(i) = probe.residual(i);
    for (int c = 0; c < 12; ++c) {
      const VariableKey of = probe.variables()[c / 6];
      for (int i = 0; i < 6; ++i) J(i, before.offsets[before.find(of)] + c % 6) += probe.jacobian(i, c);
    }
    const Eigen::MatrixXd S = Eigen::MatrixXd::Identity(6, 6) + J * before.H.inverse() * J.transpose();
    const double want = r.dot(S.ldlt().solve(r));
    MahalanobisGate gate(graph);
    ASSERT_TRUE(gate.set(3, {.probability = 0.999, .with_covariance = true, .rejects_group = false}).ok());
    group.pass(gate);
    EXPECT_GT(want, 0.1);
    EXPECT_NEAR(gate.last_distance(), want, 1e-8 * want);
  }
}

// W9
TEST(MahalanobisGate, PassesTheShareOfGoodMeasurementsThatItWasToldTo) {
  Random random(1);
  KnownPoint p;
  MahalanobisGate gate(p.graph);
  ASSERT_TRUE(gate.set(3, {.probability = 0.9, .with_covariance = false, .rejects_group = false}).ok());
  constexpr int kTrials = 4000;
  GraphEdit edit = p.graph.edit();
  for (int k = 0; k < kTrials; ++k)
    p.group.factors.push_back(edit.add(Prior{random.value<Point3d>(1.0)}, Sigma(1.0), p.point));
  ASSERT_TRUE(p.graph.apply(edit).ok());
  EXPECT_FALSE(p.group.pass(gate).reject);
  EXPECT_NEAR(static_cast<double>(gate.dropped()) / kTrials, 0.1, 0.015);  // σ = 0.0047
  EXPECT_EQ(p.graph.factor_count(), static_cast<std::size_t>(kTrials + 1 - gate.dropped()));
}

// W9
TEST(MahalanobisGate, DropsOneFactorOrRejectsTheGroupAndLeavesOtherSensorsAlone) {
  for (const bool rejects : {false, true}) {
    KnownPoint p;
    const FactorId good = p.measure(0.5), bad = p.measure(50.0);
    MahalanobisGate gate(p.graph);
    ASSERT_TRUE(gate.set(3, {.probability = 0.99, .with_covariance = false, .rejects_group = rejects}).ok());
    p.group.sensor = 4;
    EXPECT_FALSE(p.group.pass(gate).reject);
    EXPECT_TRUE(p.graph.contains(bad));
    p.group.sensor = 3;
    const auto verdict = p.group.pass(gate);
    EXPECT_EQ(verdict.reject, rejects);
    EXPECT_EQ(std::string_view(verdict.reason).empty(), !rejects);
    EXPECT_TRUE(p.graph.contains(good));
    EXPECT_EQ(p.graph.contains(bad), rejects) << "a rejected group is for the window to take out";
  }
  Graph graph;
  MahalanobisGate gate(graph);
  EXPECT_FALSE(gate.set(3, {.probability = 1.0, .with_covariance = false, .rejects_group = false}).ok());
}

// W9
TEST(CheiralityHook, TakesOutSightingsFromBehindAndLandmarksThatNothingSees) {
  Graph graph;
  Entered group{graph, {}, 3, {}, {}, {}, {}};
  GraphEdit edit = graph.edit();
  const auto rig = edit.add(euroc_like_rig());
  const auto pose = edit.add(Pose3d{}), turned = edit.add(Pose3d{Rot3d::exp({{3.14, 0.0, 0.0}}), {}});
  const auto ahead = edit.add(Point3d{{{0.1, 0.2, 4.0}}}), behind = edit.add(Point3d{{{0.1, 0.2, -4.0}}});
  const auto lost = edit.add(Point3d{{{-0.3, 0.0, -2.0}}});
  auto see = [&](VariableId<Pose3d> x, VariableId<Point3d> p) {
    group.factors.push_back(edit.add(MonoPointReprojectiond{{{300.0, 200.0}}}, Sigma(1.0), x, p, rig));
  };
  see(pose, ahead), see(turned, ahead), see(pose, behind), see(turned, behind), see(pose, lost), see(pose, lost);
  group.variables = {ahead, behind, lost};
  ASSERT_TRUE(graph.apply(edit).ok());
  CheiralityHook hook({3});
  group.sensor = 2;
  group.pass(hook);
  EXPECT_EQ(graph.factor_count(), 6u);
  group.sensor = 3;
  EXPECT_FALSE(group.pass(hook).reject);
  EXPECT_EQ(hook.dropped(), 4);
  EXPECT_EQ(graph.factor_count(), 2u);
  EXPECT_TRUE(graph.contains(group.factors[0]));
  EXPECT_TRUE(graph.contains(group.factors[3]));
  EXPECT_TRUE(graph.contains(behind));
  EXPECT_FALSE(graph.contains(lost));
}

constexpr ImuNoise kNoise{1.7e-4, 2.0e-3, 1.9e-5, 3.0e-4};

// Two states of an IMU, at 900 and 1000 ms.
struct TwoStates {
  Graph graph;
  Entered group{graph, {}, 3, at_ms(1000), {}, {}, {}};
  ImuProvider* imu;

  explicit TwoStates(double turn = 0.0, double shake = 0.0, double speed = 0.0, std::int64_t first_ms = 900) {
    auto provider = std::make_unique<ImuProvider>(kNoise);
    imu = provider.get();
    Random random(3);
    const Vec3d bias = {{0.02, -0.01, 0.03}};
    for (std::int64_t ms = 0; ms <= 1000; ms += 5) {
      Vec3d a = Vec3d{{0.0, 0.0, 9.81}} + random.normal<3>(0.03);
      a[0] += shake * std::sin(static_cast<double>(ms) * 0.05);
      EXPECT_TRUE(imu->add({at_ms(ms), bias + Vec3d{{0.0, 0.0, turn}} + random.normal<3>(0.002), a}).ok());
    }
    ImuStart start;
    start.bias.gyro = bias;
    start.velocity.v[0] = speed;
    imu->start_at(start);
    const ProviderId id = group.states.add(std::move(provider));
    for (const Time t : {at_ms(first_ms), at_ms(1000)}) {
      GraphEdit edit = graph.edit();
      EXPECT_TRUE(group.states.request(edit, id, t).ok());
      EXPECT_TRUE(group.states.link(edit).ok());
      group.new_variables.assign(group.states.new_variables().begin(), group.states.new_variables().end());
      EXPECT_TRUE(graph.apply(edit).ok());
      group.states.commit();
    }
  }
};

// W17
TEST(StandstillHook, SaysSoWhereImuSpeedAndTracksAgree) {
  TwoStates rest;
  StandstillHook hook({0}, *rest.imu, {}, [](Time from, Time to) {
    EXPECT_EQ(from, at_ms(900));
    EXPECT_EQ(to, at_ms(1000));
    return 0.2;
  });
  const std::size_t before = rest.graph.factor_count();
  EXPECT_FALSE(rest.group.pass(hook).reject);
  EXPECT_EQ(rest.graph.factor_count(), before + 2);
  EXPECT_EQ(hook.count(), 1);
  NativeEngine engine(rest.graph);
  EXPECT_TRUE(engine.solve().converged());
  const Timeline<State>& line = rest.group.states.timeline({0});
  EXPECT_LT(rest.graph.value(ImuProvider::velocity(line[1])).v.norm(), 1e-3);
  EXPECT_LT(rest.graph.value(ImuProvider::pose(line[1])).minus(rest.graph.value(ImuProvider::pose(line[0]))).norm(),
            1e-3);
}

// W17
TEST(StandstillHook, SaysNothingWhereOneOfThemMoves) {
  auto silent = [](TwoStates& moving, double pixels) {
    StandstillHook hook({0}, *moving.imu, {}, [pixels](Time, Time) { return pixels; });
    moving.group.pass(hook);
    return hook.count() == 0;
  };
  TwoStates turning(0.05), shaking(0.0, 1.0), gliding(0.0, 0.0, 1.0), seen, unseen, old;
  EXPECT_TRUE(silent(turning, 0.0));
  EXPECT_TRUE(silent(shaking, 0.0));
  EXPECT_TRUE(silent(gliding, 0.0));
  EXPECT_TRUE(silent(seen, 2.0));
  EXPECT_TRUE(silent(unseen, -1.0));
  old.group.new_variables.clear();  // the state was there before the group
  EXPECT_TRUE(silent(old, 0.0));
}

// W17
TEST(GapResetHook, EndsTheWindowWithAReasonWhereTwoStatesLieTooFarApart) {
  TwoStates near, far(0.0, 0.0, 0.0, 300);
  GapResetHook hook({0}, {500'000'000});
  EXPECT_FALSE(near.group.pass(hook).reset);
  const auto verdict = far.group.pass(hook);
  EXPECT_TRUE(verdict.reset);
  EXPECT_FALSE(verdict.reject);
  EXPECT_STREQ(verdict.reason, "a gap longer than the window can bridge");
}

}  // namespace
}  // namespace oriel
