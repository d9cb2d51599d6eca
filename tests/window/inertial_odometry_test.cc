// The whole window over simulated flights, with the truth at hand.
#include "oriel/window/inertial_odometry.h"

#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "simulated_flight.h"

namespace oriel {
namespace {

using Status = UpdateReport::Status;

// Feeds a flight frame by frame, samples up to each frame before it.
class Feed {
 public:
  explicit Feed(const SimulatedFlight& flight, const OdometryOptions& options = {}, bool stereo = true)
      : flight_(flight), odometry(flight.rig, stereo, flight.noise, options) {}
  UpdateReport frame(std::size_t k) {
    const auto& f = flight_.frames[k];
    for (; next_ < flight_.imu.size() && flight_.imu[next_].time <= f.time; ++next_)
      EXPECT_TRUE(odometry.add_imu(flight_.imu[next_]).ok());
    return odometry.update({f.time, f.features});
  }
  void all() {
    for (std::size_t k = 0; k < flight_.frames.size(); ++k) reports.push_back(frame(k));
  }

  const SimulatedFlight& flight_;
  std::size_t next_ = 0;
  InertialOdometry odometry;
  std::vector<UpdateReport> reports;
};

double seconds_of(Time t) { return (t - SimulatedFlight::time_of(0.0)).seconds(); }

// Largest distance of the estimated motions since the first pose from the true ones [m].
double worst_error(const SimulatedFlight& flight, const Trajectory& t) {
  const StampedPose& first = t.poses().front();
  double worst = 0.0;
  for (const StampedPose& p : t.poses()) {
    const Pose3d truth = flight.pose(seconds_of(first.time)).inverse() * flight.pose(seconds_of(p.time));
    worst = std::max(worst, ((first.T_world_body.inverse() * p.T_world_body).t - truth.t).norm());
  }
  return worst;
}

void cut_imu(SimulatedFlight& flight, double from_s, double to_s) {
  const Time a = SimulatedFlight::time_of(from_s), b = SimulatedFlight::time_of(to_s);
  std::erase_if(flight.imu, [&](const ImuSample& s) { return s.time > a && s.time < b; });
}

TEST(InertialOdometry, FollowsAFlightThatStartsAtRest) {
  const SimulatedFlight flight({.rest_s = 1.5, .duration_s = 12.0});
  Feed feed(flight);
  feed.all();
  EXPECT_EQ(feed.reports.back().status, Status::tracking);
  EXPECT_LT(worst_error(flight, feed.odometry.causal()), 0.05);
  EXPECT_LT((feed.reports.back().values.bias.gyro - flight.bias.gyro).norm(), 1e-3);
  EXPECT_LT((feed.reports.back().values.bias.accel - flight.bias.accel).norm(), 0.05);
}

TEST(InertialOdometry, FollowsAFlightThatStartsInMotion) {
  const SimulatedFlight flight({.duration_s = 12.0, .seed = 5});
  Feed feed(flight);
  feed.all();
  std::size_t started = 0;
  while (started < feed.reports.size() && feed.reports[started].status == Status::initialising) ++started;
  EXPECT_LT(started, 25u);
  EXPECT_EQ(feed.odometry.causal().poses().size(), feed.reports.size() - started);
  EXPECT_LT(worst_error(flight, feed.odometry.causal()), 0.05);
}

TEST(InertialOdometry, FollowsAFlightWhereLandmarksArePoints) {
  OdometryOptions options;
  options.visual.landmarks = LandmarkModel::point;
  for (const bool stereo : {true, false}) {
    const SimulatedFlight flight({.rest_s = 1.5, .duration_s = 12.0, .gross_errors = 0.05});
    Feed feed(flight, options, stereo);
    feed.all();
    EXPECT_EQ(feed.reports.back().status, Status::tracking);
    EXPECT_LT(worst_error(flight, feed.odometry.causal()), stereo ? 0.05 : 0.1);
    EXPECT_EQ(feed.odometry.window().graph().count<InverseDepthd>(), 0u);
    EXPECT_GT(feed.odometry.window().graph().count<Point3d>(), 50u);
  }
}

TEST(InertialOdometry, HasPointsOfTwoCamerasAndInverseDepthsOfOne) {
  const SimulatedFlight flight({.rest_s = 1.5, .duration_s = 4.0});
  for (const bool stereo : {true, false}) {
    Feed feed(flight, {}, stereo);
    feed.all();
    const Graph& g = feed.odometry.window().graph();
    EXPECT_EQ(g.count<Point3d>() > 50u, stereo);
    EXPECT_EQ(g.count<InverseDepthd>() > 50u, !stereo);
  }
}

TEST(InertialOdometry, KeepsNoPoseBesidesTheWindowsWhereItIsToldTo) {
  const SimulatedFlight flight({.rest_s = 1.2, .duration_s = 6.0});
  OdometryOptions options;
  options.keep_trajectory = false;
  options.keyframes.max_keyframes = 5;
  Feed kept(flight,
            [&] {
              OdometryOptions o = options;
              o.keep_trajectory = true;
              return o;
            }()),
      feed(flight, options);
  kept.all();
  feed.all();
  EXPECT_GT(feed.odometry.left(), 0);
  EXPECT_TRUE(feed.odometry.causal().poses().empty());
  EXPECT_EQ(feed.odometry.final().poses().size(), feed.odometry.timeline().size());
  EXPECT_GT(kept.odometry.causal().poses().size(), 40u);
  EXPECT_EQ(feed.reports.back().values.T_world_body.t, kept.reports.back().values.T_world_body.t);
}

// Weights whose squares are numbers, but whose sum is none: every solve fails.
TEST(InertialOdometry, BeginsAnewAndSaysWhyWhereSolvesFailOneAfterTheOther) {  // W15, W17
  const SimulatedFlight flight({.duration_s = 3.0});
  OdometryOptions options;
  options.visual.pixel_sigma = 1e-154;
  options.visual.loss = Loss{};
  InertialOdometry odometry(flight.rig, true, flight.noise, options);
  const Vec3d v = (flight.pose(1.001).t - flight.pose(0.999).t) / 0.002;
  for (const ImuSample& s : flight.imu) ASSERT_TRUE(odometry.add_imu(s).ok());
  const StartSigmas sigmas{Vec6d::constant(0.01), 0.1, 0.01, 0.1};
  ASSERT_EQ(
      odometry
          .start_at({flight.frames[10].time, flight.frames[10].features}, {flight.pose(1.0), {v}, flight.bias}, sigmas)
          .status,
      Status::initialised);
  for (std::size_t f = 11; f < 14; ++f) {
    const UpdateReport r = odometry.update({flight.frames[f].time, flight.frames[f].features});
    if (f < 13) {
      EXPECT_EQ(r.status, Status::failed);
      EXPECT_STREQ(r.reset, "");
    } else {
      EXPECT_NE(r.status, Status::tracking);
      EXPECT_STREQ(r.reset, "so many solves have failed, one after the other");
    }
  }
}

// Without the gate by the IMU's prediction random features would drag the landmarks along.
TEST(InertialOdometry, LeavesOutWhatIsFarFromTheImusPredictionWhereSightingsAgreeWithNoPose) {
  SimulatedFlight flight({.rest_s = 1.5, .duration_s = 8.0});
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> u(0.0, 752.0), v(0.0, 480.0);
  constexpr std::size_t kFirst = 50, kLast = 55;
  for (std::size_t k = kFirst; k < kLast; ++k)
    for (FeatureObservation& f : flight.frames[k].features)
      f.pixel0 = {{u(random), v(random)}}, f.pixel1 = {{u(random), v(random)}};
  Feed feed(flight);
  for (std::size_t k = 0; k < kFirst; ++k) feed.reports.push_back(feed.frame(k));
  const auto outliers = [&] { return feed.odometry.dropped()[static_cast<std::size_t>(DropReason::outlier)]; };
  const std::int64_t before = outliers();
  feed.reports.push_back(feed.frame(kFirst));
  EXPECT_GT(outliers() - before, static_cast<std::int64_t>(flight.frames[kFirst].features.size()) / 2);
  EXPECT_GT(feed.reports[kFirst].landmarks, feed.reports[kFirst - 1].landmarks / 2);
  for (std::size_t k = kFirst + 1; k < flight.frames.size(); ++k) feed.reports.push_back(feed.frame(k));
  for (const UpdateReport& r : feed.reports) EXPECT_STREQ(r.reset, "");
  EXPECT_LT(worst_error(flight, feed.odometry.causal()), 0.05);
}

// A tenth of a second in which the IMU reads what it cannot have measured.
TEST(InertialOdometry, AnImuLinkThatContradictsTheCamerasWeighsLess) {
  SimulatedFlight flight({.rest_s = 1.5, .duration_s = 8.0});
  for (ImuSample& s : flight.imu)
    if (s.time > SimulatedFlight::time_of(5.01) && s.time < SimulatedFlight::time_of(5.09)) s.accel = s.accel * -3.0;
  double worst[2];
  for (const bool robust : {false, true}) {
    OdometryOptions options;
    if (!robust) options.inertial.loss = Loss{};
    Feed feed(flight, options);
    feed.all();
    worst[robust] = worst_error(flight, feed.odometry.causal());
  }
  EXPECT_LT(worst[1], 0.05);
  EXPECT_LT(worst[1], 0.7 * worst[0]);
}

TEST(InertialOdometry, StartsWhereItIsToldWithThatUncertainty) {
  const SimulatedFlight flight({.duration_s = 3.0});
  InertialOdometry odometry(flight.rig, true, flight.noise, {});
  const Vec3d v = (flight.pose(1.001).t - flight.pose(0.999).t) / 0.002;
  const InertialValues known{flight.pose(1.0), {v}, flight.bias};
  const StartSigmas sigmas{{{0.1, 0.2, 0.3, 0.4, 0.5, 0.6}}, 0.7, 0.01, 0.02};
  std::size_t k = 0;
  for (; flight.imu[k].time <= flight.frames[10].time; ++k) ASSERT_TRUE(odometry.add_imu(flight.imu[k]).ok());
  ASSERT_EQ(odometry.start_at({flight.frames[10].time, flight.frames[10].features}, known, sigmas).status,
            Status::initialised);
  const VariableKey ids[] = {odometry.timeline().latest()->pose, odometry.timeline().latest()->velocity};
  const auto covariance = odometry.window().joint_covariance(ids);
  ASSERT_TRUE(covariance.ok()) << covariance.error();
  for (std::size_t i = 0; i < 9; ++i) {
    const double sigma = i < 6 ? sigmas.pose[static_cast<int>(i)] : 0.7;
    EXPECT_NEAR((*covariance)[10 * i], sigma * sigma, 1e-12);
  }
  for (std::size_t f = 11; f < flight.frames.size(); ++f) {
    for (; k < flight.imu.size() && flight.imu[k].time <= flight.frames[f].time; ++k)
      ASSERT_TRUE(odometry.add_imu(flight.imu[k]).ok());
    ASSERT_EQ(odometry.update({flight.frames[f].time, flight.frames[f].features}).status, Status::tracking);
  }
  const Pose3d end = odometry.causal().poses().back().T_world_body;
  EXPECT_LT((end.t - flight.pose(3.0).t).norm(), 0.05);
}

// W17: the bound is set where a sound flight passes it.
TEST(InertialOdometry, BeginsAnewAndSaysWhyWhereAnEstimateIsBeyondBelief) {
  const SimulatedFlight flight({.rest_s = 1.5, .duration_s = 4.0});
  OdometryOptions options;
  options.greatest_speed = 0.1;
  Feed feed(flight, options);
  feed.all();
  int resets = 0;
  for (const UpdateReport& r : feed.reports) {
    if (r.reset[0] == '\0') continue;
    ++resets;
    EXPECT_STREQ(r.reset, "the estimated speed is beyond belief");
    EXPECT_NE(r.status, Status::tracking);
  }
  EXPECT_GT(resets, 0);
}

TEST(InertialOdometry, DoesNotTakeAnEvenGlideForRest) {
  const SimulatedFlight flight({.rest_s = 2.5, .glide = 0.2, .duration_s = 10.0});
  Feed feed(flight);
  feed.all();
  EXPECT_EQ(feed.reports.back().status, Status::tracking);
  EXPECT_LT(worst_error(flight, feed.odometry.causal()), 0.05);
}

TEST(InertialOdometry, FollowsKeyframesThatAreASecondApart) {
  const SimulatedFlight flight({.rest_s = 1.5, .duration_s = 40.0, .frame_interval_s = 1.0, .seed = 3});
  Feed feed(flight);
  feed.all();
  EXPECT_LT(worst_error(flight, feed.odometry.causal()), 0.06);
}

TEST(InertialOdometry, StandsATenthOfGrossErrorsAndCountsThem) {
  const SimulatedFlight flight({.rest_s = 1.5, .duration_s = 10.0, .gross_errors = 0.1, .seed = 7});
  Feed feed(flight);
  feed.all();
  EXPECT_LT(worst_error(flight, feed.odometry.causal()), 0.05);
  EXPECT_GT(feed.odometry.dropped()[static_cast<std::size_t>(DropReason::outlier)], 100);
}

TEST(InertialOdometry, StandsAFrameWithFewTracksOfWhichMostAreWrong) {
  SimulatedFlight flight({.rest_s = 1.5, .duration_s = 12.0, .frame_interval_s = 0.5, .seed = 9});
  cut_imu(flight, 6.1, 6.9);
  std::vector<FeatureObservation>& features = flight.frames[14].features;  // 7.0 s
  features.resize(30);
  for (std::size_t k = 0; k < features.size(); ++k) {
    if (k % 5 >= 3) continue;
    const Vec2d off = {
        {40.0 + 30.0 * std::cos(1.0 * static_cast<double>(k)), 30.0 * std::sin(1.7 * static_cast<double>(k))}};
    features[k].pixel0 = features[k].pixel0 + off;
    features[k].pixel1 = features[k].pixel1 + off;
  }
  OdometryOptions options;
  options.visual.loss = Huber(1.345);
  Feed feed(flight, options);
  feed.all();
  EXPECT_EQ(feed.reports.back().status, Status::tracking);
  EXPECT_LT(worst_error(flight, feed.odometry.causal()), 0.05);
}

TEST(InertialOdometry, KeepsGoingByTheImuWhileNothingIsSeen) {
  SimulatedFlight flight({.rest_s = 1.5, .duration_s = 9.0});
  for (std::size_t k = 60; k < 65; ++k) flight.frames[k].features.clear();
  Feed feed(flight);
  feed.all();
  for (const UpdateReport& r : feed.reports) EXPECT_NE(r.status, Status::failed);
  EXPECT_LT(worst_error(flight, feed.odometry.causal()), 0.05);
}

TEST(InertialOdometry, HoldsItsLimitsOfStatesAndLeavesNothingOfThoseThatLeft) {
  const SimulatedFlight flight({.rest_s = 1.2, .duration_s = 12.0});
  OdometryOptions options;
  options.keyframes.max_keyframes = 5;
  Feed feed(flight, options);
  for (std::size_t k = 0; k < flight.frames.size(); ++k) {
    feed.frame(k);
    const Graph& g = feed.odometry.window().graph();
    const std::size_t states = feed.odometry.timeline().size();
    ASSERT_LE(states, 6u);
    ASSERT_EQ(g.count<Pose3d>(), states);
    ASSERT_EQ(g.count<Velocity3d>(), states);
    ASSERT_EQ(g.count<ImuBiasd>(), states);
    ASSERT_LE(g.priors().slots().size(), 1u);
  }
  EXPECT_GT(feed.odometry.left(), 5);
}

TEST(InertialOdometry, CarriesOnByTheCamerasAcrossGapsInTheImu) {
  SimulatedFlight flight({.rest_s = 1.5, .duration_s = 12.0});
  cut_imu(flight, 5.02, 5.13);
  cut_imu(flight, 6.52, 7.03);
  cut_imu(flight, 8.01, 10.04);
  Feed feed(flight);
  feed.all();
  double missing = 0.0;
  for (const UpdateReport& r : feed.reports) {
    EXPECT_NE(r.status, Status::failed);
    missing += r.without_imu.seconds();
  }
  EXPECT_NEAR(missing, 0.11 + 0.51 + 2.03, 0.04);  // a sample before and after each gap is off by up to 5 ms
  EXPECT_LT(worst_error(flight, feed.odometry.causal()), 0.05);
}

TEST(InertialOdometry, CarriesOnByTheCamerasWhenTheImuIsSilentForGood) {
  SimulatedFlight flight({.rest_s = 1.5, .duration_s = 9.0});
  cut_imu(flight, 5.02, 1e3);
  Feed feed(flight);
  feed.all();
  for (const UpdateReport& r : feed.reports) EXPECT_NE(r.status, Status::failed);
  EXPECT_LT(worst_error(flight, feed.odometry.causal()), 0.05);
}

TEST(InertialOdometry, StartsAnewWhereItHadBeenWhenImuAndTracksAreLostAtOnce) {
  SimulatedFlight flight({.rest_s = 1.5, .duration_s = 12.0});
  cut_imu(flight, 5.02, 5.43);
  for (std::size_t k = 51; k < flight.frames.size(); ++k)
    for (FeatureObservation& f : flight.frames[k].features) f.track += 1000;
  Feed feed(flight);
  feed.all();
  EXPECT_EQ(feed.reports[51].status, Status::failed);
  EXPECT_STREQ(feed.reports[51].reason, "no IMU samples reach this frame, and too little that is known is in view");
  EXPECT_EQ(feed.reports.back().status, Status::tracking);
  EXPECT_GE(feed.odometry.dropped()[static_cast<std::size_t>(DropReason::no_motion)], 3);
}

TEST(InertialOdometry, RefusesAFrameThatIsNotLaterThanTheOneBefore) {
  const SimulatedFlight flight({.rest_s = 1.5, .duration_s = 3.0});
  Feed feed(flight);
  for (std::size_t k = 0; k <= 20; ++k) feed.frame(k);
  const std::uint64_t version = feed.odometry.window().graph().version();
  EXPECT_EQ(feed.frame(20).status, Status::failed);
  EXPECT_EQ(feed.frame(12).status, Status::failed);
  EXPECT_EQ(feed.odometry.window().graph().version(), version);
  EXPECT_EQ(feed.frame(21).status, Status::tracking);
}

TEST(InertialOdometry, WaitsAndSaysWhyWhereOneCameraStartsInMotion) {
  const SimulatedFlight flight({.duration_s = 3.0});
  Feed feed(flight, {}, false);
  feed.all();
  EXPECT_EQ(feed.reports.back().status, Status::initialising);
  EXPECT_STREQ(feed.reports.back().reason, "one camera: a start in motion needs two");
}

TEST(InertialOdometry, GivesTheSameBitsInTwoRuns) {
  const SimulatedFlight flight({.rest_s = 1.2, .duration_s = 6.0});
  Feed one(flight), two(flight);
  one.all();
  two.all();
  ASSERT_EQ(one.odometry.causal().poses().size(), two.odometry.causal().poses().size());
  for (std::size_t k = 0; k < one.odometry.causal().poses().size(); ++k)
    EXPECT_EQ(std::memcmp(&one.odometry.causal().poses()[k], &two.odometry.causal().poses()[k], sizeof(StampedPose)),
              0);
}

}  // namespace
}  // namespace oriel
