// Late data in a window of an IMU: a fix at a time between two states that have left, its motion preintegrated anew.
#include <gtest/gtest.h>

#include <cmath>

#include "oriel/residual/imu_residual.h"
#include "oriel/residual/prior.h"
#include "oriel/solve/native_engine.h"
#include "oriel/testing/simulated_window.h"
#include "oriel/window/marginalize.h"

namespace oriel {
namespace {

// A body that turns and sways, with fixes of its position and attitude at every state, 0.1 s apart.
class Flight {
 public:
  struct State {
    VariableId<Pose3d> pose;
    VariableId<Velocity3d> v;
    VariableId<ImuBiasd> bias;
    std::array<VariableKey, 3> keys() const { return {pose, v, bias}; }
  };
  static constexpr int kSamples = 20;
  static constexpr double kStep = 0.005;
  static constexpr ImuNoise kNoise = {2e-3, 2e-2, 1e-4, 1e-3};

  Graph graph;
  std::vector<State> states;

  // `with` >= 0: the motion after this state is split in two from the beginning, and the fix between them is in time.
  explicit Flight(int count, int with = -1) {
    GraphEdit edit = graph.edit();
    Truth truth;
    for (int k = 0; k < count; ++k) {
      states.push_back(add(edit, truth));
      if (k == 0) {
        edit.add(Prior{truth.v}, Sigma(0.01), states[0].v);
        edit.add(Prior{ImuBiasd{}}, Sigma(0.01), states[0].bias);
      } else if (k - 1 != with) {
        link(edit, states[k - 1], integrate(k - 1, 0, kSamples), states[k]);
      } else {
        between = add(edit, middle(states.size() - 2, truth_before_));
        link(edit, states[k - 1], integrate(k - 1, 0, kSamples / 2), between);
        link(edit, between, integrate(k - 1, kSamples / 2, kSamples), states[k]);
        edit.add(fix(), Sigma(kFix), between.pose);
      }
      const Pose3d seen = truth.T.plus(
          {{0.004 * std::sin(9.0 * k), 0.003 * std::cos(5.0 * k), 0.002, 0.05 * std::sin(7.0 * k), 0.04, 0.03}});
      edit.add(Prior{seen}, Sigma(0.05), states[k].pose);
      truth_before_ = truth;
      truth = middle_of(truth, integrate(k, 0, kSamples));
    }
    EXPECT_TRUE(graph.apply(edit).ok());
  }
  // What the fix says that comes late: a quarter of a metre beside everything else, and very sure of it.
  static constexpr double kFix = 0.02;
  static Prior<Pose3d> fix() {
    Truth truth;
    for (int k = 0; k < kFixed; ++k) truth = middle_of(truth, integrate(k, 0, kSamples));
    truth = middle_of(truth, integrate(kFixed, 0, kSamples / 2));
    return {truth.T.plus({{0.01, -0.01, 0.02, 0.2, -0.1, 0.1}})};
  }
  static constexpr int kFixed = 3;

  static Preintegration integrate(int k, int from, int to) {
    Preintegrator p(ImuBiasd{}, kNoise);
    for (int i = from; i < to; ++i) {
      const double t = (k * kSamples + i) * kStep;
      p.step(kStep, {{0.3 * std::sin(2.0 * t), -0.2, 0.4 * std::cos(3.0 * t)}},
             {{std::sin(4.0 * t), 0.5 * std::cos(2.0 * t), 9.81 + 0.3 * std::sin(t)}});
    }
    return p.result();
  }
  static Detached<ImuResiduald, FullNoise<15>> motion(const State& a, const Preintegration& m, const State& b) {
    return detach(ImuResiduald{m.motion, kStandardGravity}, imu_noise(m), a.pose, a.v, a.bias, b.pose, b.v, b.bias);
  }
  State between;

 private:
  struct Truth {
    Pose3d T;
    Velocity3d v{{{1.0, 0.0, 0.0}}};
  };
  static Truth middle_of(const Truth& from, const Preintegration& m) {
    const PredictedState next = predict_state(m.motion, from.T, from.v, ImuBiasd{});
    return {next.T_world_body, next.v};
  }
  Truth middle(std::size_t k, const Truth& from) const {
    return middle_of(from, integrate(static_cast<int>(k), 0, kSamples / 2));
  }
  static State add(GraphEdit& edit, const Truth& x) { return {edit.add(x.T), edit.add(x.v), edit.add(ImuBiasd{})}; }
  static void link(GraphEdit& edit, const State& a, const Preintegration& m, const State& b) {
    edit.add(ImuResiduald{m.motion, kStandardGravity}, imu_noise(m), a.pose, a.v, a.bias, b.pose, b.v, b.bias);
  }
  Truth truth_before_;
};

const SolveOptions kTight{.max_iterations = 50, .function_tolerance = 1e-14};

// The newest state of a window of four, where the fix came late or never.
Flight::State slide(Flight& flight, LateLedger* ledger) {
  NativeEngine engine(flight.graph);
  Marginalizer marginalizer;
  GraphEdit edit = flight.graph.edit();
  EXPECT_FALSE(engine.solve(kTight).failed());
  for (std::size_t k = 0; k + 4 < flight.states.size(); ++k) {
    const auto leaving = flight.states[k].keys();
    EXPECT_TRUE(marginalizer.marginalize(flight.graph, leaving, {.ledger = ledger}, edit).ok());
    EXPECT_TRUE(flight.graph.apply(edit).ok());
    if (ledger != nullptr) ledger->commit(Time{static_cast<std::int64_t>(k) * 100'000'000});
  }
  return flight.states.back();
}

void fold_fix(Flight& flight, LateLedger& ledger) {
  const Flight::State &a = flight.states[Flight::kFixed], &b = flight.states[Flight::kFixed + 1];
  const Flight::State s{ledger.lend<Pose3d>(), ledger.lend<Velocity3d>(), ledger.lend<ImuBiasd>()};
  const Preintegration first = Flight::integrate(Flight::kFixed, 0, Flight::kSamples / 2),
                       second = Flight::integrate(Flight::kFixed, Flight::kSamples / 2, Flight::kSamples);
  const auto before = Flight::motion(a, first, s), after = Flight::motion(s, second, b);
  const DetachedFactor halves[] = {before.view(), after.view()};
  Pose3d pose;
  Velocity3d v;
  ImuBiasd bias;
  ASSERT_TRUE(ledger.smoothed(flight.graph, a.pose, &pose));
  ASSERT_TRUE(ledger.smoothed(flight.graph, a.v, &v));
  ASSERT_TRUE(ledger.smoothed(flight.graph, a.bias, &bias));
  const PredictedState guess = predict_state(first.motion, pose, v, bias);
  const DetachedVariable state[] = {{s.pose, &kVariableOps<Pose3d>, &guess.T_world_body},
                                    {s.v, &kVariableOps<Velocity3d>, &guess.v},
                                    {s.bias, &kVariableOps<ImuBiasd>, &bias}};
  ASSERT_EQ(ledger.add_state(flight.graph, state, halves), LateOutcome::folded);
  GraphEdit edit = flight.graph.edit();
  const auto late = detach(Flight::fix(), Sigma(Flight::kFix), s.pose);
  ASSERT_EQ(ledger.fold(flight.graph, late.view(), edit), LateOutcome::folded);
  ASSERT_TRUE(flight.graph.apply(edit).ok());
  ledger.commit(Time{350'000'000});
}

// W7
TEST(LateInertial, AFixBetweenTwoStatesThatLeftMovesTheWindowAsIfItHadBeenInTime) {
  Flight in_time(12, Flight::kFixed), late(12), never(12);
  LateLedger ledger;
  const Flight::State last = slide(late, &ledger), without = slide(never, nullptr);
  fold_fix(late, ledger);
  NativeEngine engine(late.graph), batch(in_time.graph), other(never.graph);
  ASSERT_FALSE(engine.solve(kTight).failed());
  ASSERT_FALSE(batch.solve(kTight).failed());
  ASSERT_FALSE(other.solve(kTight).failed());
  const Flight::State& want = in_time.states.back();
  const double moved = (never.graph.value(without.pose).t - in_time.graph.value(want.pose).t).norm();
  EXPECT_GT(moved, 0.01);  // [m]
  EXPECT_LT((late.graph.value(last.pose).t - in_time.graph.value(want.pose).t).norm(), 0.05 * moved);
  const double changed = (never.graph.value(without.v).v - in_time.graph.value(want.v).v).norm();
  EXPECT_LT((late.graph.value(last.v).v - in_time.graph.value(want.v).v).norm(), 0.05 * changed);
}

// W7
TEST(LateInertial, TheHalvesOfAMotionSayAboutTheirEndsWhatTheWholeDid) {
  Flight in_time(12, Flight::kFixed), late(12), never(12);
  LateLedger ledger;
  (void)slide(late, &ledger);
  (void)slide(never, nullptr);
  fold_fix(late, ledger);
  NativeEngine with(late.graph), batch(in_time.graph), without(never.graph);
  for (NativeEngine* e : {&with, &batch, &without}) ASSERT_FALSE(e->solve(kTight).failed());
  auto sigma = [](NativeEngine& engine, const Flight& flight) {
    const auto covariance = engine.covariance(flight.states.back().pose);
    EXPECT_TRUE(covariance.ok());
    return std::sqrt((*covariance)(3, 3) + (*covariance)(4, 4) + (*covariance)(5, 5));
  };
  const double a = sigma(with, late), b = sigma(batch, in_time), c = sigma(without, never);
  EXPECT_GT(c - b, 0.005 * b);
  EXPECT_NEAR(a, b, 0.05 * (c - b));
}

}  // namespace
}  // namespace oriel
