#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <string>

#include "oriel/evaluate/report.h"

namespace oriel {
namespace {

TumPose pose_at(std::int64_t ns, Vec3d p, double yaw = 0) {
  return {{ns}, p, 0, 0, std::sin(yaw / 2), std::cos(yaw / 2)};
}

std::vector<Vec3d> some_points(int n = 20) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  std::vector<Vec3d> points;
  for (int i = 0; i < n; ++i) points.push_back({normal(random), normal(random), 0.3 * normal(random)});
  return points;
}

Mat3d rotation(double x, double y, double z, double w) {
  const double n = std::sqrt(x * x + y * y + z * z + w * w);
  return rotation_of(TumPose{{0}, {}, x / n, y / n, z / n, w / n});
}

TEST(Align, FindsTheSimilarityThatMadeTheTruth) {
  const Mat3d R = rotation(0.3, -0.2, 0.5, 0.7);
  const auto estimate = some_points();
  std::vector<Vec3d> truth;
  for (const Vec3d& p : estimate) truth.push_back(2.5 * (R * p) + Vec3d{1, -2, 3});
  const auto T = align(estimate, truth, Alignment::sim3);
  ASSERT_TRUE(T) << T.error();
  EXPECT_NEAR(T->scale, 2.5, 1e-12);
  EXPECT_LT((T->R - R).norm(), 1e-12);
  EXPECT_LT((T->t - Vec3d{1, -2, 3}).norm(), 1e-12);
}

TEST(Align, FindsARotationAndNoReflectionForAMirroredTruth) {
  const auto estimate = some_points();
  std::vector<Vec3d> truth;
  for (const Vec3d& p : estimate) truth.push_back({p[0], p[1], -p[2]});
  const auto T = align(estimate, truth, Alignment::se3);
  ASSERT_TRUE(T);
  EXPECT_NEAR(T->R.col(0).dot(cross(T->R.col(1), T->R.col(2))), 1, 1e-12);
}

TEST(Align, FindsYawAloneAndLeavesTheVertical) {
  const Mat3d R = rotation(0, 0, std::sin(0.4), std::cos(0.4));
  const auto estimate = some_points();
  std::vector<Vec3d> truth;
  for (const Vec3d& p : estimate) truth.push_back(R * p + Vec3d{5, 6, 7});
  const auto exact = align(estimate, truth, Alignment::yaw);
  ASSERT_TRUE(exact);
  EXPECT_LT((exact->R - R).norm(), 1e-12);
  for (Vec3d& p : truth) p = rotation(0.1, 0, 0, 1) * p;  // a tilt is an error that yaw may not hide
  const auto tilted = align(estimate, truth, Alignment::yaw);
  ASSERT_TRUE(tilted);
  EXPECT_EQ(tilted->R(2, 2), 1);
}

TEST(Align, IsNoWorseThanAnyNeighbour) {
  const auto estimate = some_points(), noise = some_points(40);
  std::vector<Vec3d> truth;
  for (std::size_t i = 0; i < estimate.size(); ++i) truth.push_back(1.3 * estimate[i] + 0.4 * noise[i + 20]);
  const auto cost = [&](const Similarity& T) {
    double sum = 0;
    for (std::size_t i = 0; i < estimate.size(); ++i) sum += (T(estimate[i]) - truth[i]).squared_norm();
    return sum;
  };
  const auto best = align(estimate, truth, Alignment::sim3);
  ASSERT_TRUE(best);
  for (int k = 0; k < 7; ++k)
    for (double d : {-1e-3, 1e-3}) {
      Similarity T = *best;
      if (k < 3) T.t[k] += d;
      if (k == 3) T.scale += d;
      if (k > 3) T.R = rotation(k == 4 ? d : 0, k == 5 ? d : 0, k == 6 ? d : 0, 1) * T.R;
      EXPECT_GT(cost(T), cost(*best)) << k;
    }
}

TEST(Align, SaysWhatItCannotAlign) {
  EXPECT_FALSE(align({}, {}, Alignment::se3));
  const std::vector<Vec3d> still(5, Vec3d{1, 2, 3});
  EXPECT_FALSE(align(still, still, Alignment::sim3)) << "no scale in one point";
  const auto T = align(still, still, Alignment::se3);
  ASSERT_TRUE(T);
  EXPECT_LT(((*T)(still[0]) - still[0]).norm(), 1e-14);
  EXPECT_FALSE(parse_alignment("affine"));
  EXPECT_EQ(parse_alignment("yaw").value(), Alignment::yaw);
}

TEST(Associate, TakesTheNearestStampWithinTheLimitAndEachPoseOnce) {
  const std::vector<TumPose> truth = {pose_at(0, {}), pose_at(10, {}), pose_at(20, {}), pose_at(30, {}),
                                      pose_at(99, {})};
  const std::vector<TumPose> estimate = {pose_at(4, {}), pose_at(15, {}), pose_at(28, {}), pose_at(31, {})};
  const auto pairs = nearest_stamps(estimate, truth, {5});
  ASSERT_EQ(pairs.size(), 3u);
  EXPECT_EQ(pairs[0].truth, 0u);
  EXPECT_EQ(pairs[1].truth, 1u) << "a tie goes to the earlier";
  EXPECT_EQ(pairs[2].truth, 3u);
  EXPECT_EQ(pairs[2].estimate, 3u) << "31 is nearer to 30 than 28 is";
  EXPECT_EQ(nearest_stamps(truth, estimate, {5}).size(), pairs.size()) << "either way round";
  EXPECT_TRUE(nearest_stamps(estimate, {}, {5}).empty());
}

TEST(Associate, BringsPosesInOrderOfTime) {
  const auto sorted = sorted_by_stamp({pose_at(5, {1, 0, 0}), pose_at(3, {2, 0, 0}), pose_at(5, {3, 0, 0})});
  ASSERT_EQ(sorted.size(), 2u);
  EXPECT_EQ(sorted[0].time.ns, 3);
  EXPECT_EQ(sorted[1].p[0], 1) << "of two at one stamp the first stays";
}

// A quarter of a circle of radius 10 m at 1 m/s, a pose each 0.1 s; the estimate is the same in another frame.
TrajectoryFile quarter_circle(double scale, double turned, Vec3d shift) {
  TrajectoryFile file;
  file.file_name = "quarter";
  const Mat3d R = rotation(0, 0, std::sin(turned / 2), std::cos(turned / 2));
  for (int i = 0; i <= 157; ++i) {
    const double a = 0.01 * i;
    const Vec3d p = scale * (R * Vec3d{10 * std::sin(a), 10 * (1 - std::cos(a)), 0}) + shift;
    file.poses.push_back(pose_at(1'000'000'000'000'000'000 + i * 100'000'000LL, p, a + turned));
  }
  return file;
}

TEST(Report, FindsNoErrorInATrajectoryThatOnlyStandsElsewhere) {
  const auto report = evaluate(quarter_circle(1, 0.7, {5, 6, 7}), quarter_circle(1, 0, {0, 0, 0}), {});
  ASSERT_TRUE(report) << report.error();
  EXPECT_EQ(report->pairs, 158u);
  EXPECT_LT(report->absolute.position.rmse, 1e-12);
  EXPECT_LT(report->absolute.orientation.rmse, 1e-5);
  EXPECT_NEAR(report->path_m, 15.7, 1e-3);
  EXPECT_NEAR(report->duration_s, 15.7, 1e-12);
  EXPECT_GT(report->over_distance.position.count, 0u);
  EXPECT_LT(report->over_distance.position.max, 1e-12);
  EXPECT_EQ(report->over_time.position.count, 148u);
}

TEST(Report, MeasuresAScaleErrorOverDistanceAndHidesItWithSim3) {
  EvaluationOptions options;
  const auto rigid = evaluate(quarter_circle(1.02, 0, {}), quarter_circle(1, 0, {}), options);
  ASSERT_TRUE(rigid);
  // 2 % of a chord of a 10 m arc on a circle of 10 m radius: 0.02·2·10·sin(1/2).
  EXPECT_NEAR(rigid->over_distance.position.mean, 0.4 * std::sin(0.5), 2e-3);
  EXPECT_GT(rigid->absolute.position.rmse, 0.01);
  options.alignment = Alignment::sim3;
  const auto scaled = evaluate(quarter_circle(1.02, 0, {}), quarter_circle(1, 0, {}), options);
  ASSERT_TRUE(scaled);
  EXPECT_NEAR(scaled->absolute.alignment.scale, 1 / 1.02, 1e-12);
  EXPECT_LT(scaled->absolute.position.rmse, 1e-12);
  EXPECT_LT(scaled->over_distance.position.max, 1e-12);
}

TEST(Report, MeasuresOrientationInDegrees) {
  TrajectoryFile estimate = quarter_circle(1, 0, {});
  for (TumPose& pose : estimate.poses) {
    const double yaw = 2 * std::atan2(pose.qz, pose.qw) + 0.02;
    pose.qz = std::sin(yaw / 2), pose.qw = std::cos(yaw / 2);
  }
  const auto report = evaluate(estimate, quarter_circle(1, 0, {}), {});
  ASSERT_TRUE(report);
  EXPECT_NEAR(report->absolute.orientation.rmse, 0.02 * 180 / std::numbers::pi, 1e-9);
  EXPECT_NEAR(report->absolute.orientation.median, 0.02 * 180 / std::numbers::pi, 1e-9);
}

TEST(Report, GivesStatisticsOfKnownErrors) {
  const ErrorStatistics s = statistics_of({4, 0, 3, 1});
  EXPECT_EQ(s.mean, 2);
  EXPECT_EQ(s.median, 2);
  EXPECT_EQ(s.max, 4);
  EXPECT_EQ(s.rmse, std::sqrt(26.0 / 4));
}

TEST(Report, SaysThatNothingMatchesAndWhichFile) {
  TrajectoryFile late = quarter_circle(1, 0, {});
  for (TumPose& pose : late.poses) pose.time.ns += 3'600'000'000'000;
  const auto report = evaluate(late, quarter_circle(1, 0, {}), {});
  ASSERT_FALSE(report);
  EXPECT_EQ(report.error().text(), "quarter: expected stamps within 0.010000000 s of those in quarter, found none");
}

TEST(Report, WritesNullInJsonForWhatIsNotThere) {
  TrajectoryFile one = quarter_circle(1, 0, {});
  one.poses.resize(1);
  const auto report = evaluate(one, one, {});
  ASSERT_TRUE(report) << report.error();
  const std::string json = to_json(*report);
  EXPECT_NE(json.find("\"ate_m\": 0"), std::string::npos) << json;
  EXPECT_NE(json.find("\"rpe_time_position_m\": {\"count\": 0, \"rmse\": null"), std::string::npos) << json;
  EXPECT_EQ(json.find("nan"), std::string::npos);
  EXPECT_NE(to_text(*report).find("position (ATE)"), std::string::npos);
}

}  // namespace
}  // namespace oriel
