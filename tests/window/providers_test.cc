// The providers of states that are shipped.
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "oriel/residual/check_jacobian.h"
#include "oriel/residual/constant_velocity.h"
#include "oriel/solve/native_engine.h"
#include "oriel/window/constant_velocity_provider.h"
#include "oriel/window/imu_provider.h"
#include "oriel/window/odometry_provider.h"
#include "oriel/window/states.h"
#include "residual/random_values.h"
#include "window/dense_oracle.h"

namespace oriel {
namespace {

using dense_oracle::difference;
using testing_values::Random;

constexpr Time at_ms(std::int64_t ms) { return {ms * 1000000}; }
constexpr ImuNoise kNoise{1.7e-4, 2.0e-3, 1.9e-5, 3.0e-4};

// A turning, swaying body: its readings every 5 ms from 0 to `end_ms`.
ImuSample reading(std::int64_t ms) {
  const double t = static_cast<double>(ms) * 1e-3;
  return {at_ms(ms),
          {{0.3 * std::sin(3.0 * t), 0.2, -0.4 * std::cos(2.0 * t)}},
          {{std::sin(2.0 * t), 0.5 * std::cos(5.0 * t), 9.81 + 0.3 * std::sin(t)}}};
}
void fill(ImuProvider& imu, std::int64_t end_ms, std::int64_t gap_from = 0, std::int64_t gap_to = 0) {
  for (std::int64_t ms = 0; ms <= end_ms; ms += 5)
    if (ms <= gap_from || ms >= gap_to) {
      ASSERT_TRUE(imu.add(reading(ms)).ok());
    }
}
ImuStart start() {
  ImuStart s;
  s.T_world_body = {Rot3d::exp({{0.1, -0.2, 0.3}}), {{1.0, 2.0, 3.0}}};
  s.velocity = {{{0.5, -0.3, 0.1}}};
  s.bias = {{{0.01, -0.02, 0.005}}, {{0.1, 0.05, -0.08}}};
  return s;
}

// A state at `time`, predicted from `from` and linked to it.
State extend(StateProvider& provider, GraphEdit& edit, const State& from, Time time) {
  State to;
  to.time = time;
  EXPECT_TRUE(provider.covers(from.time, time));
  EXPECT_TRUE(provider.predict(edit, from, to).ok());
  const Result<FactorId> motion = provider.link(edit, from, to);
  EXPECT_TRUE(motion.ok()) << motion.error();
  return to;
}

// The system of the first and last of states at `times`, each linked to the one before, those between eliminated.
dense_oracle::System chain(StateProvider& provider, const std::vector<Time>& times, std::vector<State>& states,
                           Graph& graph) {
  GraphEdit edit = graph.edit();
  State first;
  first.time = times[0];
  EXPECT_TRUE(provider.begin(edit, first).ok());
  states.assign(1, first);
  for (std::size_t k = 1; k < times.size(); ++k) states.push_back(extend(provider, edit, states.back(), times[k]));
  EXPECT_TRUE(graph.apply(edit).ok());
  const auto whole = dense_oracle::system(graph);
  auto rest = whole;
  rest.variables.clear();
  rest.offsets.assign(1, 0);
  for (const State* s : {&states.front(), &states.back()})
    for (const VariableKey& id : s->all()) {
      rest.variables.push_back(id);
      rest.offsets.push_back(rest.offsets.back() + graph.find_ops(id.type)->dim);
    }
  return dense_oracle::schur_complement(whole, rest);
}

void expect_split_says_what_the_whole_says(StateProvider& provider, const std::vector<Time>& times, double tolerance) {
  Graph one, many;
  std::vector<State> a, b;
  const auto whole = chain(provider, {times.front(), times.back()}, a, one);
  const auto split = chain(provider, times, b, many);
  EXPECT_LT(difference(split.H, whole.H), tolerance);
  // Units differ: each direction by its own information.
  const Eigen::VectorXd scale = whole.H.diagonal().cwiseSqrt().cwiseInverse();
  EXPECT_LT(
      difference(scale.asDiagonal() * split.H * scale.asDiagonal(), scale.asDiagonal() * whole.H * scale.asDiagonal()),
      tolerance);
  for (std::size_t k = 0; k < whole.variables.size() / 2; ++k) {
    const VariableOps& ops = *one.find_ops(a.back().variables[k].type);
    double d[9];
    ops.minus(many.find_value(b.back().variables[k]), one.find_value(a.back().variables[k]), d);
    for (int i = 0; i < ops.dim; ++i) EXPECT_NEAR(d[i], 0.0, tolerance);
  }
}

template <class Provider>
void expect_first_state(std::unique_ptr<Provider> provider, int variables) {
  Graph graph;
  States states;
  const ProviderId id = states.add(std::move(provider));
  for (const Time time : {at_ms(100), at_ms(100)}) {
    GraphEdit edit = graph.edit();
    ASSERT_TRUE(states.request(edit, id, time).ok());
    ASSERT_TRUE(states.link(edit).ok());
    ASSERT_TRUE(graph.apply(edit).ok());
    states.commit();
    EXPECT_EQ(graph.variable_count(), static_cast<std::size_t>(variables));
    EXPECT_EQ(graph.factor_count(), static_cast<std::size_t>(variables));
  }
}

// W3
TEST(Providers, BeginWithOneStateAndAPriorForEachOfItsVariables) {
  auto imu = std::make_unique<ImuProvider>(kNoise);
  fill(*imu, 200);
  imu->start_at(start());
  expect_first_state(std::move(imu), 3);
  auto odometry = std::make_unique<OdometryProvider<Pose3d>>(Pose3d{}, Mat6d::identity());
  odometry->start_measuring(at_ms(0));
  ASSERT_TRUE(odometry->add(at_ms(200), Pose3d{}, Mat6d::identity()).ok());
  expect_first_state(std::move(odometry), 1);
  expect_first_state(std::make_unique<ConstantVelocityProvider>(ConstantVelocityOptions{}), 2);
}

// W3
TEST(ImuProvider, PredictsWhereItsOwnFactorIsZero) {
  ImuProvider imu(kNoise);
  fill(imu, 1000);
  imu.start_at(start());
  Graph graph;
  std::vector<State> states;
  chain(imu, {at_ms(100), at_ms(333), at_ms(900)}, states, graph);
  EXPECT_EQ(graph.factor_count(), 5u);
  EXPECT_LT(NativeEngine(graph).cost(), 1e-16);
  EXPECT_EQ(graph.value(ImuProvider::bias(states[2])).gyro, start().bias.gyro);
}

// W8
TEST(ImuProvider, SaysInTwoHalvesWhatItSaysAsAWhole) {
  ImuProvider imu(kNoise);
  fill(imu, 1000);
  imu.start_at(start());
  expect_split_says_what_the_whole_says(imu, {at_ms(100), at_ms(500), at_ms(900)}, 1e-9);
  expect_split_says_what_the_whole_says(imu, {at_ms(100), at_ms(200), at_ms(255), at_ms(900)}, 1e-9);
  // Between two samples the readings are averaged over shorter pieces.
  expect_split_says_what_the_whole_says(imu, {at_ms(100), at_ms(503), at_ms(900)}, 1e-5);
}

// W5
TEST(ImuProvider, CoversWhatItsSamplesReach) {
  ImuProvider strict(kNoise, {.bridge_gaps = false}), bridging(kNoise);
  for (ImuProvider* imu : {&strict, &bridging}) {
    EXPECT_FALSE(imu->covers(at_ms(100), at_ms(100)));
    fill(*imu, 1000, 400, 700);
    EXPECT_FALSE(imu->can_begin(at_ms(100))) << "nobody said where it begins";
    imu->start_at(start());
    EXPECT_TRUE(imu->can_begin(at_ms(100)));
    EXPECT_TRUE(imu->covers(at_ms(0), at_ms(400)));
    EXPECT_TRUE(imu->covers(at_ms(-4), at_ms(390)));
    EXPECT_FALSE(imu->covers(at_ms(-6), at_ms(390)));
    EXPECT_TRUE(imu->covers(at_ms(700), at_ms(1004)));
    EXPECT_FALSE(imu->covers(at_ms(700), at_ms(1006)));
  }
  EXPECT_FALSE(strict.covers(at_ms(300), at_ms(800)));
  EXPECT_FALSE(strict.covers(at_ms(300), at_ms(500)));
  EXPECT_TRUE(bridging.covers(at_ms(300), at_ms(800)));
  Graph graph;
  std::vector<State> states;
  const auto system = chain(bridging, {at_ms(300), at_ms(800)}, states, graph);
  EXPECT_TRUE(system.H.allFinite());
}

TEST(ImuProvider, KeepsItsSamplesForTheHorizonOfLateData) {
  ImuProvider imu(kNoise, {.horizon = {200'000'000}});
  fill(imu, 1000);
  imu.forget_before(at_ms(600));
  EXPECT_TRUE(imu.covers(at_ms(400), at_ms(900)));
  EXPECT_FALSE(imu.covers(at_ms(385), at_ms(900)));
}

// W16
TEST(ImuProvider, RefusesASampleThatIsNotLaterAndNamesIt) {
  ImuProvider imu(kNoise);
  fill(imu, 100);
  EXPECT_NE(imu.add(reading(100)).error().message.find("100000000 ns"), std::string::npos);
  EXPECT_FALSE(imu.add(reading(95)).ok());
  EXPECT_EQ(imu.samples().samples().size(), 21u);
}

template <class P>
Mat<double, P::kDim, P::kDim> some_covariance(Random& random, double sigma) {
  auto A = Mat<double, P::kDim, P::kDim>::zero();
  for (double& a : A.m) a = sigma * random.normal();
  return A * A.transposed() + Mat<double, P::kDim, P::kDim>::identity() * (sigma * sigma);
}

// W8
TEST(OdometryProvider, SplitsTranslationsExactly) {
  Random random(1);
  OdometryProvider<Pose3d> space(Pose3d{}, Mat6d::identity());
  OdometryProvider<Pose2d> plane(Pose2d{}, Mat3d::identity());
  space.start_measuring(at_ms(0));
  plane.start_measuring(at_ms(0));
  for (int k = 1; k <= 5; ++k) {
    Mat6d C = Mat6d::identity() * (1e-4 * k);
    for (int i = 0; i < 3; ++i) C(i, i) = 1e-14;  // turns are known
    Mat3d D = Mat3d::identity() * (1e-4 * k);
    D(0, 0) = 1e-14;
    ASSERT_TRUE(space.add(at_ms(100 * k), Pose3d{{}, random.normal<3>(0.1)}, C).ok());
    ASSERT_TRUE(plane.add(at_ms(100 * k), Pose2d{{}, random.normal<2>(0.1)}, D).ok());
  }
  const std::vector<int> in_space = {3, 4, 5, 9, 10, 11}, in_plane = {1, 2, 4, 5};
  for (const bool spatial : {true, false}) {
    StateProvider& provider = spatial ? static_cast<StateProvider&>(space) : plane;
    const auto& scalars = spatial ? in_space : in_plane;
    Graph one, many;
    std::vector<State> states;
    const auto whole = chain(provider, {at_ms(50), at_ms(450)}, states, one);
    const auto split = chain(provider, {at_ms(50), at_ms(120), at_ms(300), at_ms(333), at_ms(450)}, states, many);
    EXPECT_GT(whole.H.norm(), 1.0);
    EXPECT_LT(difference(split.H(scalars, scalars), whole.H(scalars, scalars)), 1e-9);
  }
}

// W8
TEST(OdometryProvider, SplitsTurnsAtItsOwnStampsExactly) {
  Random random(4);
  OdometryProvider<Pose3d> space(Pose3d{}, Mat6d::identity());
  OdometryProvider<Pose2d> plane(Pose2d{}, Mat3d::identity());
  space.start_measuring(at_ms(0));
  plane.start_measuring(at_ms(0));
  for (int k = 1; k <= 5; ++k) {
    ASSERT_TRUE(space.add(at_ms(100 * k), random.value<Pose3d>(0.3), some_covariance<Pose3d>(random, 1e-2)).ok());
    ASSERT_TRUE(plane.add(at_ms(100 * k), random.value<Pose2d>(0.3), some_covariance<Pose2d>(random, 1e-2)).ok());
  }
  const std::vector<Time> times = {at_ms(50), at_ms(100), at_ms(300), at_ms(450)};
  expect_split_says_what_the_whole_says(space, times, 1e-9);
  expect_split_says_what_the_whole_says(plane, times, 1e-9);
}

// W3
TEST(OdometryProvider, ComposesItsIncrementsAndTheirUncertainty) {
  Random random(2);
  OdometryProvider<Pose3d> odometry(Pose3d{}, Mat6d::identity());
  odometry.start_measuring(at_ms(0));
  std::vector<Pose3d> steps;
  for (int k = 1; k <= 4; ++k) {
    steps.push_back(random.value<Pose3d>(0.3));
    ASSERT_TRUE(odometry.add(at_ms(100 * k), steps.back(), some_covariance<Pose3d>(random, 1e-2)).ok());
  }
  const auto near = [](const Pose3d& x, const Pose3d& y) { return x.minus(y).norm(); };
  EXPECT_LT(near(odometry.between(at_ms(0), at_ms(400)).motion, steps[0] * steps[1] * steps[2] * steps[3]), 1e-12);
  const auto a = odometry.between(at_ms(30), at_ms(250)), b = odometry.between(at_ms(250), at_ms(380)),
             c = odometry.between(at_ms(30), at_ms(380));
  EXPECT_LT(near(a.motion * b.motion, c.motion), 1e-12);
  // The error of the whole by the errors of its parts, numerically.
  const auto d = odometry.between(at_ms(0), at_ms(200)), e = odometry.between(at_ms(200), at_ms(400)),
             f = odometry.between(at_ms(0), at_ms(400));
  Mat6d J_d, J_e;
  const double h = 1e-6;
  for (int i = 0; i < 6; ++i) {
    const Vec6d step = Vec6d::unit(i) * h;
    J_d.set_block(0, i, (d.motion.plus(step) * e.motion).minus(f.motion) / h);
    J_e.set_block(0, i, (d.motion * e.motion.plus(step)).minus(f.motion) / h);
  }
  const Mat6d want = J_d * d.covariance * J_d.transposed() + J_e * e.covariance * J_e.transposed();
  EXPECT_LT((want - f.covariance).norm(), 1e-5 * f.covariance.norm());
}

TEST(OdometryProvider, RefusesWhatIsNoIncrement) {
  OdometryProvider<Pose2d> odometry(Pose2d{}, Mat3d::identity());
  EXPECT_FALSE(odometry.add(at_ms(1), Pose2d{}, Mat3d::identity()).ok()) << "the chain has not begun";
  odometry.start_measuring(at_ms(0));
  ASSERT_TRUE(odometry.add(at_ms(10), Pose2d{}, Mat3d::identity()).ok());
  EXPECT_EQ(odometry.add(at_ms(10), Pose2d{}, Mat3d::identity()).error().code, ErrorCode::bad_input);
  EXPECT_EQ(odometry.add(at_ms(20), Pose2d{{}, {{NAN, 0.0}}}, Mat3d::identity()).error().code, ErrorCode::not_finite);
  EXPECT_EQ(odometry.add(at_ms(20), Pose2d{}, -Mat3d::identity()).error().code, ErrorCode::indefinite);
  EXPECT_EQ(odometry.increments(), 1u);
  EXPECT_FALSE(odometry.covers(at_ms(0), at_ms(11)));
  EXPECT_TRUE(odometry.covers(at_ms(0), at_ms(10)));
}

TEST(OdometryProvider, KeepsWhatTheWindowAndItsHorizonNeed) {
  OdometryProvider<Pose2d> odometry(Pose2d{}, Mat3d::identity(), {100'000'000});
  odometry.start_measuring(at_ms(0));
  for (int k = 1; k <= 1000; ++k) {
    ASSERT_TRUE(odometry.add(at_ms(10 * k), Pose2d{}, Mat3d::identity()).ok());
    odometry.forget_before(at_ms(10 * k - 200));
    EXPECT_TRUE(k < 40 || odometry.covers(at_ms(10 * k - 300), at_ms(10 * k)));
    EXPECT_LT(odometry.increments(), 70u);
  }
}

// V10
TEST(ConstantVelocity, HasTheJacobiansOfItsResidual) {
  Random random(3);
  for (int k = 0; k < 10; ++k) {
    const JacobianCheck check =
        check_jacobian(ConstantVelocityd{0.3}, random.value<Pose3d>(0.5), random.value<Velocity3d>(1.0),
                       random.value<Pose3d>(0.5), random.value<Velocity3d>(1.0));
    EXPECT_LT(check.analytic_and_dual, 1e-12) << check;
    EXPECT_LT(check.worst(), 1e-8) << check;
  }
}

// W3
TEST(ConstantVelocityProvider, SaysInPartsWhatItSaysAsAWhole) {
  ConstantVelocityStart start;
  start.velocity = {{{1.0, -2.0, 0.5}}};
  start.T_world_body = {Rot3d::exp({{0.3, 0.2, -0.5}}), {{1.0, 2.0, 3.0}}};
  ConstantVelocityProvider provider({}, start);
  expect_split_says_what_the_whole_says(provider, {at_ms(0), at_ms(130), at_ms(500), at_ms(700)}, 1e-9);
  EXPECT_FALSE(provider.covers(at_ms(100), at_ms(0)));
}

}  // namespace
}  // namespace oriel
