// Odometry that is nothing but two-frame tasks: over a simulated flight, in all three executors, and over its gaps.
#include "oriel/run/two_frame_odometry.h"

#include <gtest/gtest.h>

#include <cmath>
#include <csignal>
#include <fstream>

#include "window/simulated_flight.h"

namespace oriel {
namespace {

constexpr ExecutorKind kAll[] = {ExecutorKind::in_place, ExecutorKind::thread, ExecutorKind::process};

class TwoFrameOdometryTest : public ::testing::Test {
 protected:
  TwoFrameOdometryTest() { options_.pixel_sigma = 0.5; }

  TwoFrameOdometry start(ExecutorKind kind = ExecutorKind::in_place, ExecutorOptions executor = {}) {
    executor.zygote = &zygote_;
    auto made = TwoFrameOdometry::start(kind, flight_.rig, options_, executor);
    EXPECT_TRUE(made) << made.error();
    return std::move(*made);
  }
  // `seen` may take features away.
  template <class Seen>
  TwoFrameOdometry fly(TwoFrameOdometry odometry, Seen&& seen) {
    for (std::size_t k = 0; k < flight_.frames.size(); ++k) {
      std::vector<FeatureObservation> features = flight_.frames[k].features;
      seen(k, features);
      EXPECT_TRUE(odometry.add({flight_.frames[k].time, features}));
    }
    odometry.finish();
    EXPECT_TRUE(odometry.map().check()) << odometry.map().check().error();
    return odometry;
  }
  TwoFrameOdometry fly(TwoFrameOdometry odometry) {
    return fly(std::move(odometry), [](std::size_t, auto&) {});
  }
  // Of frame k, from the first frame that has a pose.
  Vec6d error(const VisualMap& map, std::uint32_t k) const {
    const Pose3d truth = flight_.pose(0.0).inverse() * flight_.pose(k * flight_interval_);
    return truth.minus(map.frames.T_world_body[0].inverse() * map.frames.T_world_body[k]);
  }
  static std::int64_t count(const TwoFrameOdometry& odometry, FrameStatus status) {
    return odometry.statistics().frames[static_cast<std::size_t>(status)];
  }
  static Bytes bytes(const VisualMap& map) {
    Bytes out;
    encode(map, out);
    return out;
  }

  Zygote zygote_ = Zygote::start({&kTaskOps<TwoFrameTask>}).value();
  const double flight_interval_ = 0.1;
  SimulatedFlight flight_{{.duration_s = 4.0, .points = 300}};
  TwoFrameOptions options_;
};

TEST_F(TwoFrameOdometryTest, FollowsAFlightWithGrossErrorsWithinCentimetres) {
  const TwoFrameOdometry odometry = fly(start());
  EXPECT_EQ(count(odometry, FrameStatus::origin), 1);
  EXPECT_EQ(count(odometry, FrameStatus::solved), 40);
  for (std::uint32_t k = 0; k < 41; ++k) {
    EXPECT_LT(error(odometry.map(), k).segment<3>(3).norm(), 0.03) << k;
    EXPECT_LT(error(odometry.map(), k).segment<3>(0).norm(), 0.01) << k;
  }
  EXPECT_GT(odometry.statistics().inliers, odometry.statistics().matches * 9 / 10);
  EXPECT_LT(odometry.statistics().inliers, odometry.statistics().matches);
}

TEST_F(TwoFrameOdometryTest, HasAMapThatTravelsWhole) {
  const TwoFrameOdometry odometry = fly(start());
  const Bytes message = bytes(odometry.map());
  VisualMap back;
  ASSERT_TRUE(decode(message, back));
  EXPECT_TRUE(back.check());
  EXPECT_EQ(back.frames.size(), 41u);
  EXPECT_GT(back.points.size(), 100u);
  EXPECT_EQ(bytes(back), message);
}

// n sightings of a point at about one distance know it √n times better than one; of a point that comes nearer still
// more.
TEST_F(TwoFrameOdometryTest, KnowsPointsBetterTheMoreOftenTheyAreSeen) {
  const VisualMap map = fly(start()).take_map();
  int often = 0;
  for (std::uint32_t k = 0; k < map.observations.size(); ++k) {
    const std::uint32_t point = map.observations.point[k];
    // The observation that the point was made of.
    if (point == kNoRow || map.observations.frame[k] != map.points.frame[point] || map.points.sightings[point] < 20)
      continue;
    ++often;
    const auto trace = [](const Mat3d& a) { return a(0, 0) + a(1, 1) + a(2, 2); };
    EXPECT_LT(trace(map.points.covariance[point]), trace(map.observations.covariance[k]) / 4.0) << point;
  }
  EXPECT_GT(often, 20);
}

// What one frame alone says of points is forgotten with the next: the way drifts.
TEST_F(TwoFrameOdometryTest, DriftsLessWithThePointsOfAllFramesThanWithThoseOfThePreviousOne) {
  const auto drift = [&] {
    const TwoFrameOdometry odometry = fly(start());
    double sum = 0.0;
    for (std::uint32_t k = 1; k < 41; ++k) sum += error(odometry.map(), k).squared_norm();
    return std::sqrt(sum / 40.0);
  };
  const double with_all = drift();
  options_.source = MatchSource::previous;
  EXPECT_LT(with_all, 0.7 * drift());
}

// R1
TEST_F(TwoFrameOdometryTest, HasTheSameBitsInPlaceInAThreadAndInAProcess) {
  const Bytes in_place = bytes(fly(start()).map());
  for (const ExecutorKind kind : kAll) EXPECT_EQ(bytes(fly(start(kind)).map()), in_place) << name_of(kind);
}

// R6
TEST_F(TwoFrameOdometryTest, HasTheSameBitsWhereWorkersAreKilled) {
  const Bytes undisturbed = bytes(fly(start()).map());
  ExecutorOptions executor;
  executor.retries = 5;
  int killed = 0;
  const TwoFrameOdometry odometry =
      fly(start(ExecutorKind::process, executor), [&](std::size_t k, std::vector<FeatureObservation>&) {
        if (k % 5 != 2) return;
        std::ifstream children("/proc/" + std::to_string(zygote_.pid()) + "/task/" + std::to_string(zygote_.pid()) +
                               "/children");
        pid_t worker = -1;
        if (children >> worker && ::kill(worker, SIGKILL) == 0) ++killed;
      });
  EXPECT_GT(killed, 4);
  EXPECT_EQ(odometry.statistics().restarts, killed);
  EXPECT_EQ(bytes(odometry.map()), undisturbed);
}

TEST_F(TwoFrameOdometryTest, FliesTheSameWayInWorldToRounding) {
  const TwoFrameOdometry previous = fly(start());
  options_.coordinates = MatchCoordinates::world;
  const TwoFrameOdometry world = fly(start());
  for (std::uint32_t k = 0; k < 41; ++k)
    EXPECT_LT(previous.map().frames.T_world_body[k].minus(world.map().frames.T_world_body[k]).norm(), 1e-6) << k;
}

TEST_F(TwoFrameOdometryTest, FlagsFramesWithFewObservationsAndInterpolatesThemInTheEnd) {
  const auto poor = [](std::size_t k) { return (k >= 10 && k < 13) || k >= 39; };
  const TwoFrameOdometry odometry = fly(start(), [&](std::size_t k, std::vector<FeatureObservation>& features) {
    if (poor(k)) features.resize(9);
  });
  const VisualMap& map = odometry.map();
  EXPECT_EQ(count(odometry, FrameStatus::few), 5);
  EXPECT_EQ(count(odometry, FrameStatus::solved), 35);
  EXPECT_EQ(odometry.warnings().size(), 5u);
  for (std::uint32_t k = 10; k < 13; ++k) {
    EXPECT_EQ(map.frames.status[k], FrameStatus::few);
    const auto& f = map.frames;
    const Pose3d between = interpolated(f.time[k], f.time[9], f.T_world_body[9], f.time[13], f.T_world_body[13]);
    EXPECT_EQ(f.T_world_body[k].t, between.t);
    EXPECT_LT(error(map, k).segment<3>(3).norm(), 0.15);  // the flight turns meanwhile
  }
  // Beyond the last one the motion is held.
  const auto& f = map.frames;
  EXPECT_EQ(f.T_world_body[40].t,
            interpolated(f.time[40], f.time[37], f.T_world_body[37], f.time[38], f.T_world_body[38]).t);
  EXPECT_EQ(f.previous[13], 9u);
}

// All tracks end at once: nothing ties what comes after to what was before but that motions are smooth.
TEST_F(TwoFrameOdometryTest, HoldsTheMotionAndBeginsAChainAnewWhereAllTracksEnd) {
  const TwoFrameOdometry odometry = fly(start(), [](std::size_t k, std::vector<FeatureObservation>& features) {
    if (k >= 20)
      for (FeatureObservation& f : features) f.track += 100000;
  });
  EXPECT_EQ(count(odometry, FrameStatus::held), 1);
  EXPECT_EQ(count(odometry, FrameStatus::solved), 39);
  const auto& f = odometry.map().frames;
  EXPECT_EQ(f.status[20], FrameStatus::held);
  EXPECT_EQ(f.T_world_body[20].t,
            interpolated(f.time[20], f.time[18], f.T_world_body[18], f.time[19], f.T_world_body[19]).t);
  EXPECT_LT(error(odometry.map(), 40).segment<3>(3).norm(), 0.1);
  EXPECT_NE(odometry.warnings().at(0).find("frame 20: no matches"), std::string::npos);
}

TEST_F(TwoFrameOdometryTest, HasNoPoseBeforeItSawEnoughAndSaysNothingOfAnEmptyRecording) {
  const TwoFrameOdometry odometry = fly(start(), [](std::size_t k, std::vector<FeatureObservation>& features) {
    if (k < 5) features.clear();
  });
  EXPECT_EQ(odometry.map().frames.status[5], FrameStatus::origin);
  EXPECT_EQ(count(odometry, FrameStatus::few), 5);
  EXPECT_NE(odometry.map().frames.T_world_body[0].t, Vec3d::zero());  // the first motion, backwards
  TwoFrameOdometry empty = start();
  empty.finish();
  EXPECT_EQ(empty.map().frames.size(), 0u);
}

TEST_F(TwoFrameOdometryTest, RefusesAStampThatDoesNotRise) {
  TwoFrameOdometry odometry = start();
  ASSERT_TRUE(odometry.add({Time{5}, {}}));
  const auto again = odometry.add({Time{5}, {}});
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().message, "expected a later stamp than that of the frame before");
  EXPECT_EQ(odometry.map().frames.size(), 1u);
}

// R6: a job that is given up leaves a frame without a pose, and the flight goes on.
TEST_F(TwoFrameOdometryTest, GoesOnWhereAWorkerIsLostForGood) {
  bool killed = false;
  const TwoFrameOdometry odometry =
      fly(start(ExecutorKind::process), [&](std::size_t k, std::vector<FeatureObservation>&) {
        if (k != 15) return;
        std::ifstream children("/proc/" + std::to_string(zygote_.pid()) + "/task/" + std::to_string(zygote_.pid()) +
                               "/children");
        pid_t worker = -1;
        killed = (children >> worker) && ::kill(worker, SIGSTOP) == 0 && ::kill(worker, SIGKILL) == 0;
      });
  ASSERT_TRUE(killed);
  EXPECT_LE(count(odometry, FrameStatus::failed), 1);  // none if its answer was there already
  EXPECT_EQ(count(odometry, FrameStatus::solved) + count(odometry, FrameStatus::failed), 40);
  EXPECT_LT(error(odometry.map(), 40).segment<3>(3).norm(), 0.05);
}

}  // namespace
}  // namespace oriel
