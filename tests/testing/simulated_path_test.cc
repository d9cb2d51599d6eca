#include "oriel/testing/simulated_path.h"

#include <gtest/gtest.h>

#include "oriel/testing/random.h"

namespace oriel {
namespace {

PoseSpline wild_spline() {
  SeededRandom random(3);
  std::vector<Pose3d> control;
  for (int k = 0; k < 40; ++k) control.push_back({Rot3d::exp(random.normals<3>(0.8)), random.normals<3>(1.0)});
  return {control, 0.2};
}

// A difference of fourth order of any function of time.
template <class F>
Vec3d slope(F f, double t, double h) {
  return (f(t - 2 * h) - f(t + 2 * h) + (f(t + h) - f(t - h)) * 8.0) / (12.0 * h);
}

template <class Path>
void expect_derivatives(const Path& path, double t, double h) {
  const PathState x = path.at(t);
  EXPECT_LT((slope([&](double u) { return path.at(u).T_world_body.t; }, t, h) - x.v_world).norm(), 1e-5) << t;
  EXPECT_LT((slope([&](double u) { return path.at(u).v_world; }, t, h) - x.a_world).norm(), 2e-4) << t;
  const Rot3d& R = x.T_world_body.R;
  EXPECT_LT((slope([&](double u) { return path.at(u).T_world_body.R.minus(R); }, t, h) - x.rate_body).norm(), 1e-5)
      << t;
  EXPECT_LT((slope([&](double u) { return path.at(u).rate_body; }, t, h) - x.acceleration_body).norm(), 2e-3) << t;
}

TEST(PoseSpline, HasTheDerivativesOfDifferences) {
  const PoseSpline spline = wild_spline();
  EXPECT_DOUBLE_EQ(spline.duration(), 7.0);
  for (double t = 0.05; t < 6.9; t += 0.137) expect_derivatives(spline, t, 1e-3);
}

TEST(PoseSpline, IsContinuousInItsSecondDerivativesWhereItsPiecesMeet) {
  const PoseSpline spline = wild_spline();
  for (int k = 1; k < 34; ++k) {
    const PathState before = spline.at(0.2 * k - 1e-9), after = spline.at(0.2 * k + 1e-9);
    EXPECT_LT(after.T_world_body.minus(before.T_world_body).norm(), 1e-7);
    EXPECT_LT((after.v_world - before.v_world).norm(), 1e-6);
    EXPECT_LT((after.a_world - before.a_world).norm(), 1e-5);
    EXPECT_LT((after.rate_body - before.rate_body).norm(), 1e-6);
    EXPECT_LT((after.acceleration_body - before.acceleration_body).norm(), 1e-5);
  }
}

// A straight line at an even rate is its own spline.
TEST(PoseSpline, FollowsAnEvenTurnAndGlideExactly) {
  std::vector<StampedPose> poses;
  const Vec3d v = {{1.0, -2.0, 0.5}}, w = {{0.3, 0.1, -0.2}};
  for (int k = 0; k <= 50; ++k) {
    const double t = 0.13 * k;
    poses.push_back({Time{} + Duration::from_seconds(t), {Rot3d::exp(w * t), v * t}});
  }
  const auto spline = PoseSpline::through(poses, 0.1);
  ASSERT_TRUE(spline.ok()) << spline.error();
  for (const double t : {0.0, 1.234, 5.0}) {
    const PathState x = spline->at(t);
    EXPECT_LT((x.v_world - v).norm(), 1e-8);
    EXPECT_LT(x.a_world.norm(), 1e-6);
    EXPECT_LT((x.rate_body - w).norm(), 1e-7);
    EXPECT_LT((x.T_world_body.t - v * (t + 0.2)).norm(), 1e-8);  // it begins at its third control pose
  }
}

TEST(PoseSpline, RefusesPosesThatDoNotRiseOrAreTooFew) {
  std::vector<StampedPose> poses = procedural_flight(1.0);
  ASSERT_TRUE(PoseSpline::through(poses, 0.1).ok());
  EXPECT_FALSE(PoseSpline::through(poses, 0.0).ok());
  EXPECT_FALSE(PoseSpline::through({poses.data(), 4}, 0.1).ok());
  EXPECT_FALSE(PoseSpline::through({}, 0.1).ok());
  poses[4].time = poses[3].time;
  const auto refused = PoseSpline::through(poses, 0.1);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("pose 4"), std::string::npos) << refused.error();
}

TEST(SimulatedPath, StandsStillInItsRestsAndGoesOnWhereItWas) {
  const PoseSpline spline = *PoseSpline::through(procedural_flight(20.0), 0.1);
  const auto path = SimulatedPath::make(spline, {{0.0, 2.0}, {6.0, 9.0}});
  ASSERT_TRUE(path.ok()) << path.error();
  EXPECT_GE(spline.duration(), 20.0);
  EXPECT_NEAR(path->duration(), spline.duration() + 2.5 + 4.0, 1e-12);
  for (const double t : {0.0, 1.0, 2.0, 6.0, 7.7, 9.0}) {
    const PathState x = path->at(t);
    EXPECT_LT(x.v_world.norm() + x.a_world.norm() + x.rate_body.norm() + x.acceleration_body.norm(), 1e-12) << t;
    const Pose3d there = path->at(t < 5.0 ? 0.0 : 6.0).T_world_body;
    EXPECT_LT(x.T_world_body.minus(there).norm(), 1e-12) << t;
  }
  for (double t = 0.05; t < 20.0; t += 0.173) expect_derivatives(*path, t, 1e-4);
  const Pose3d end = path->at(path->duration()).T_world_body;
  EXPECT_LT(end.minus(spline.at(spline.duration()).T_world_body).norm(), 1e-9);
}

TEST(SimulatedPath, RefusesRestsThatOverlap) {
  const PoseSpline spline = *PoseSpline::through(procedural_flight(20.0), 0.1);
  EXPECT_FALSE(SimulatedPath::make(spline, {{3.0, 5.0}, {6.5, 9.0}}).ok());
  EXPECT_FALSE(SimulatedPath::make(spline, {{6.0, 5.0}}).ok());
  EXPECT_FALSE(SimulatedPath::make(spline, {{0.5, 2.0}}).ok());  // no time to slow down
  EXPECT_TRUE(SimulatedPath::make(spline, {{3.0, 5.0}, {7.0, 9.0}}).ok());
}

TEST(SeededRandom, DrawsTheSameNumbersEverywhereAndOthersInOtherStreams) {
  // By the definition of the generator and of the seed; a change here changes every simulated figure.
  SeededRandom a(1), other(1, 1);
  EXPECT_EQ(a.bits(), 9822250072823399003ull);
  EXPECT_NE(a.bits(), other.bits());
  SeededRandom r(7);
  double sum = 0.0, squares = 0.0, cubes = 0.0;
  constexpr int kDraws = 100000;
  for (int i = 0; i < kDraws; ++i) {
    const double x = r.normal();
    sum += x, squares += x * x, cubes += x * x * x;
  }
  EXPECT_NEAR(sum / kDraws, 0.0, 0.015);  // about five sigmas
  EXPECT_NEAR(squares / kDraws, 1.0, 0.025);
  EXPECT_NEAR(cubes / kDraws, 0.0, 0.07);
}

}  // namespace
}  // namespace oriel
