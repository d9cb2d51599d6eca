// The pose of one frame from its matches with another, against covariances and answers that are known.
#include "oriel/run/two_frame_task.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>

#include "oriel/residual/matched_point.h"
#include "oriel/run/executor.h"
#include "oriel/window/stereo_point.h"
#include "window/simulated_flight.h"

namespace oriel {
namespace {

constexpr MatchResidual kResiduals[] = {MatchResidual::points, MatchResidual::pixel, MatchResidual::disparity,
                                        MatchResidual::stereo};

// Points that two frames see, with noise in the pixels of both as it is said to be.
class World {
 public:
  explicit World(std::uint64_t seed, double sigma = 0.5) : random_(seed), sigma_(sigma) {}

  StereoRigd rig = SimulatedFlight({.duration_s = 0.0}).rig;
  Pose3d T_world_a{Rot3d::exp({{0.4, -1.1, 2.0}}), {{30.0, -12.0, 5.0}}};
  Pose3d T_a_b{Rot3d::exp({{0.02, -0.05, 0.03}}), {{0.1, -0.06, 0.4}}};

  TwoFrameInput matches(int n, int gross = 0) {
    TwoFrameInput in;
    in.frame_b = 1;
    in.T_world_a = T_world_a;
    while (static_cast<int>(in.matches.size()) < n) {
      const Vec3d p = {{uniform(-2.5, 2.5), uniform(-1.5, 1.5), uniform(3.0, 9.0)}};
      StereoSighting a, b;
      if (!see(p, a) || !see(T_a_b.inverse() * p, b)) continue;
      const auto at_a = stereo_point(rig, a), at_b = stereo_point(rig, b);
      if (!at_a || !at_b) continue;
      if (static_cast<int>(in.matches.size()) < gross) b.pixel0[0] += 60.0 + uniform(0.0, 100.0);
      const auto row = static_cast<std::uint32_t>(in.matches.size());
      in.matches.push_back({row, 1, 1, in_body(rig, at_a->p_camera), in_body(rig, at_a->covariance), b.pixel0, b.pixel1,
                            b.covariance0, b.covariance1, in_body(rig, at_b->p_camera),
                            in_body(rig, at_b->covariance)});
    }
    in.observations = static_cast<std::uint32_t>(n);
    return in;
  }
  TwoFrameTask::Context context(MatchResidual residual) const {
    TwoFrameOptions options;
    options.residual = residual;
    return {options, rig};
  }

 private:
  double uniform(double a, double b) { return std::uniform_real_distribution<double>(a, b)(random_); }
  bool see(const Vec3d& p_body, StereoSighting& s) {
    Vec2d* pixels[2] = {&s.pixel0, &s.pixel1};
    s.covariance0 = s.covariance1 = Mat2d::identity() * (sigma_ * sigma_);
    for (int c = 0; c < 2; ++c) {
      const Vec3d h = rig.cameras[c].T_body_camera().inverse() * p_body;
      if (h[2] < 0.3 || !rig.cameras[c].camera.project(h, *pixels[c], nullptr)) return false;
      for (int i = 0; i < 2; ++i) (*pixels[c])[i] += std::normal_distribution<double>(0.0, sigma_)(random_);
    }
    return true;
  }
  std::mt19937_64 random_;
  double sigma_;
};

double squared_mahalanobis(const Vec6d& e, const Mat6d& covariance) {
  const auto noise = Covariance(covariance);
  Vec6d white = e;
  FullNoise<6>::whiten(noise.w, white);
  return white.squared_norm();
}

TEST(TwoFrameTask, FindsThePoseByEveryResidual) {
  for (const MatchResidual residual : kResiduals) {
    World world(1, 0.2);
    auto context = world.context(residual);
    const TwoFrameOutput out = TwoFrameTask::optimize(context, world.matches(150));
    ASSERT_EQ(out.status, FrameStatus::solved) << out.reason;
    const Vec6d e = world.T_a_b.minus(out.T_a_b);
    EXPECT_LT(e.segment<3>(0).norm(), 2e-3) << static_cast<int>(residual);
    EXPECT_LT(e.segment<3>(3).norm(), 2e-2) << static_cast<int>(residual);
    EXPECT_LT((world.T_world_a * out.T_a_b).minus(out.T_world_b).norm(), 1e-9);
    EXPECT_GE(out.figures.inliers, 145);
    EXPECT_EQ(out.inlier_observations.size(), static_cast<std::size_t>(out.figures.inliers));
    EXPECT_GT(out.figures.iterations, 0);
    EXPECT_LE(out.figures.final_cost, out.figures.initial_cost);
    EXPECT_FALSE(out.reason.empty());
  }
}

// The covariances of both sides are all there is: then errors are as large as the covariance says. Squares alone, since
// Huber's loss at 1.5 sigma gives some of it away. Of 200 draws of 6 degrees of freedom the mean lies in 6 ± 0.48 in
// 95 % of cases; points are a first-order propagation, and their noise is in no way normal beyond it: 10 % besides.
TEST(TwoFrameTask, IsAsFarOffAsItsCovarianceSaysForEveryResidual) {
  for (const MatchResidual residual : kResiduals) {
    double sum = 0.0;
    constexpr int kDraws = 200;
    for (int k = 0; k < kDraws; ++k) {
      World world(100 + static_cast<std::uint64_t>(k), 0.2);
      auto context = world.context(residual);
      context.options.huber = context.options.gate = 1e6;
      const TwoFrameOutput out = TwoFrameTask::optimize(context, world.matches(60));
      ASSERT_EQ(out.status, FrameStatus::solved) << out.reason;
      sum += squared_mahalanobis(world.T_a_b.minus(out.T_a_b), out.covariance);
    }
    EXPECT_NEAR(sum / kDraws, 6.0, 0.48 + 0.6) << static_cast<int>(residual);
  }
}

// An independent sum: the cost of the points' residual at the answer is that of Σ = Σ_a + R Σ_b Rᵀ, with R of the
// estimate that the last round began with. With squares alone and many rounds that is the answer itself.
TEST(TwoFrameTask, WeighsPointsByTheCovariancesOfBothSides) {
  World world(2);
  auto context = world.context(MatchResidual::points);
  context.options.huber = context.options.gate = 1e6;
  context.options.rounds = 12;
  const TwoFrameInput in = world.matches(50);
  const TwoFrameOutput out = TwoFrameTask::optimize(context, in);
  ASSERT_EQ(out.status, FrameStatus::solved);
  double cost = 0.0;
  const Mat3d R = out.T_a_b.R.matrix();
  for (const PointMatch& m : in.matches) {
    const Mat3d S = m.covariance_a + R * m.covariance_b * R.transposed();
    const Vec3d e = m.p_a - out.T_a_b * m.p_b;
    // S⁻¹ e by Cramer's rule.
    const double det = S.col(0).dot(cross(S.col(1), S.col(2)));
    const Vec3d x = {{e.dot(cross(S.col(1), S.col(2))) / det, S.col(0).dot(cross(e, S.col(2))) / det,
                      S.col(0).dot(cross(S.col(1), e)) / det}};
    cost += 0.5 * e.dot(x);
  }
  EXPECT_NEAR(out.figures.final_cost, cost, 1e-7 * cost);
}

TEST(TwoFrameTask, GivesEqualResultsInThePreviousFrameAndInWorld) {
  for (const MatchResidual residual : kResiduals) {
    World world(3);
    const TwoFrameInput in = world.matches(80, 8);
    auto previous = world.context(residual), in_world = previous;
    in_world.options.coordinates = MatchCoordinates::world;
    const TwoFrameOutput a = TwoFrameTask::optimize(previous, in), b = TwoFrameTask::optimize(in_world, in);
    ASSERT_EQ(a.status, FrameStatus::solved);
    ASSERT_EQ(b.status, FrameStatus::solved);
    // World stands 33 m away: positions lose the last two digits there; and solves end by tolerances.
    EXPECT_LT(a.T_a_b.minus(b.T_a_b).norm(), 1e-8) << static_cast<int>(residual);
    EXPECT_LT(a.T_world_b.minus(b.T_world_b).norm(), 1e-8);
    EXPECT_LT((a.covariance - b.covariance).norm(), 1e-6 * a.covariance.norm());
    EXPECT_NEAR(a.figures.final_cost, b.figures.final_cost, 1e-7 * a.figures.final_cost);
    EXPECT_EQ(a.inlier_observations, b.inlier_observations);
  }
}

TEST(TwoFrameTask, LeavesGrossErrorsOutWhereverTheGuessIs) {
  for (const MatchResidual residual : {MatchResidual::pixel, MatchResidual::disparity, MatchResidual::stereo}) {
    World world(4, 0.2);
    TwoFrameInput in = world.matches(100, 30);
    in.T_a_b = Pose3d{Rot3d::exp({{0.3, 0.2, -0.4}}), {{1.0, 1.0, -1.0}}};  // a hundred pixels and more off
    auto context = world.context(residual);
    const TwoFrameOutput out = TwoFrameTask::optimize(context, in);
    ASSERT_EQ(out.status, FrameStatus::solved) << out.reason;
    EXPECT_LT(world.T_a_b.minus(out.T_a_b).norm(), 0.03);
    for (const std::uint32_t row : out.inlier_observations) EXPECT_GE(row, 30u);
    EXPECT_GE(out.figures.inliers, 65);
  }
}

TEST(TwoFrameTask, SaysOfAnEmptyTaskThatItIsAndChangesNothing) {
  World world(5);
  auto context = world.context(MatchResidual::stereo);
  TwoFrameInput in = world.matches(0);
  in.T_a_b = world.T_a_b;
  const TwoFrameOutput out = TwoFrameTask::optimize(context, in);
  EXPECT_EQ(out.status, FrameStatus::few);
  EXPECT_EQ(out.reason, "no matches");
  EXPECT_EQ(out.figures.iterations, 0);
  EXPECT_EQ(std::memcmp(&out.T_a_b, &in.T_a_b, sizeof(Pose3d)), 0);
  TwoFrameTask::Map map;
  map.visual.rigs.emplace_back();
  for (int k = 0; k < 2; ++k) map.visual.add_frame(Time{k}, world.T_world_a, 0);
  TwoFrameTask::write(out, map);
  EXPECT_EQ(map.visual.frames.status[1], FrameStatus::few);
  EXPECT_EQ(map.visual.frames.T_world_body[1].t, world.T_world_a.t);
  EXPECT_EQ(map.visual.frames.previous[1], kNoRow);
}

TEST(TwoFrameTask, DoesNotSolveWithFewerObservationsThanItIsTold) {
  World world(6);
  auto context = world.context(MatchResidual::stereo);
  const TwoFrameOutput nine = TwoFrameTask::optimize(context, world.matches(9));
  EXPECT_EQ(nine.status, FrameStatus::few);
  EXPECT_EQ(nine.reason, "9 matches, fewer than 10");
  EXPECT_EQ(nine.figures.iterations, 0);
  context.options.least_observations = 9;
  EXPECT_EQ(TwoFrameTask::optimize(context, world.matches(9)).status, FrameStatus::solved);
}

TEST(TwoFrameTask, SaysWhereNoPoseAgreesWithEnoughMatches) {
  World world(7);
  TwoFrameInput in = world.matches(40);
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> u(0.0, 752.0), v(0.0, 480.0);
  for (PointMatch& m : in.matches) m.pixel0 = {{u(random), v(random)}}, m.pixel1 = {{u(random), v(random)}};
  auto context = world.context(MatchResidual::stereo);
  const TwoFrameOutput out = TwoFrameTask::optimize(context, in);
  EXPECT_EQ(out.status, FrameStatus::no_agreement) << out.reason;
  EXPECT_TRUE(out.inlier_observations.empty());
}

TEST(TwoFrameTask, DoesNotFailOnNumbersThatAreNotFinite) {
  World world(8);
  TwoFrameInput in = world.matches(30);
  in.matches[3].p_a[0] = NAN;
  in.matches[4].covariance_a(1, 1) = -1.0;
  in.matches[5].pixel0[1] = HUGE_VAL;
  for (const MatchResidual residual : kResiduals) {
    auto context = world.context(residual);
    const TwoFrameOutput out = TwoFrameTask::optimize(context, in);
    EXPECT_EQ(out.status, FrameStatus::solved) << out.reason;
    EXPECT_LE(out.figures.inliers, 29);
  }
  in.T_a_b.t[2] = NAN;
  auto context = world.context(MatchResidual::stereo);
  context.options.robust_start = false;
  const TwoFrameOutput out = TwoFrameTask::optimize(context, in);
  EXPECT_NE(out.status, FrameStatus::solved);
}

// R9
TEST(TwoFrameTask, RefusesOptionsThatMakeNoSenseBeforeAnythingStarts) {
  const StereoRigd rig = World(1).rig;
  const auto fault = [&](auto&& spoil) {
    TwoFrameTask::Config config{{}, rig};
    spoil(config.options);
    const auto made = Executor<TwoFrameTask>::start(ExecutorKind::in_place, config);
    return made ? std::string() : made.error().message;
  };
  EXPECT_EQ(fault([](TwoFrameOptions&) {}), "");
  EXPECT_EQ(fault([](TwoFrameOptions& o) { o.least_observations = 2; }), "expected 3 or more observations for a pose");
  EXPECT_EQ(fault([](TwoFrameOptions& o) { o.rounds = 0; }), "expected a round and an iteration at least");
  EXPECT_NE(fault([](TwoFrameOptions& o) { o.huber = NAN; }), "");
  EXPECT_NE(fault([](TwoFrameOptions& o) { o.residual = static_cast<MatchResidual>(9); }), "");
  TwoFrameTask::Config blind{{}, rig};
  blind.rig.cameras[1].camera.fx = 0.0;
  EXPECT_FALSE(Executor<TwoFrameTask>::start(ExecutorKind::in_place, blind));
}

}  // namespace
}  // namespace oriel
