// The books of a visual map, and poses between and beyond others.
#include "oriel/window/visual_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace oriel {
namespace {

// Two frames that saw one point, and one more.
VisualMap small_map() {
  VisualMap m;
  m.rigs.emplace_back();
  for (int k = 0; k < 2; ++k) {
    m.add_frame(Time{100 + k}, Pose3d{Rot3d{}, {{1.0 * k, 0.0, 0.0}}}, 0);
    m.add_observation({7, true, {{1.0, 2.0}}, {{0.5, 2.0}}});
    m.add_observation({8, false, {{3.0, 4.0}}});
  }
  m.observations.point[0] = m.observations.point[2] = m.add_point(7, {{0.0, 0.0, 5.0}}, Mat3d::identity(), 1);
  return m;
}

TEST(VisualMap, KeepsObservationsOfAFrameTogetherAndPointsInTheFrameThatTheyName) {
  const VisualMap m = small_map();
  ASSERT_TRUE(m.check()) << m.check().error();
  EXPECT_EQ(m.frames.first[1], 2u);
  EXPECT_EQ(m.frames.count[1], 2u);
  EXPECT_EQ(m.observations.frame[3], 1u);
  EXPECT_EQ(m.p_world(0), (Vec3d{{1.0, 0.0, 5.0}}));
  EXPECT_EQ(m.observations.disparity_variance(0), 2.0);
}

TEST(VisualMap, NamesTheGroupAndTheRowOfWhatDoesNotFit) {
  const std::pair<std::function<void(VisualMap&)>, const char*> cases[] = {
      {[](VisualMap& m) { m.points.p.pop_back(); }, "visual map: expected columns of one length"},
      {[](VisualMap& m) { m.frames.time[1] = m.frames.time[0]; },
       "visual map: frame 1: expected a later stamp than the frame before"},
      {[](VisualMap& m) { m.frames.T_world_body[0].R.qw = 0.5; },
       "visual map: frame 0: expected a finite pose with a unit quaternion"},
      {[](VisualMap& m) { m.frames.covariance[1](2, 2) = -1.0; }, "visual map: frame 1: expected a covariance"},
      {[](VisualMap& m) { m.frames.previous[1] = 1; }, "visual map: frame 1: expected a previous frame before it"},
      {[](VisualMap& m) { m.frames.rig[0] = 1; }, "visual map: frame 0: expected a rig that is there"},
      {[](VisualMap& m) { m.frames.count[0] = 1; },
       "visual map: frame 1: expected observations that follow those of the frame before"},
      {[](VisualMap& m) { m.frames.count[1] = 1; }, "visual map: observation 3: expected an observation of a frame"},
      {[](VisualMap& m) { m.points.p[0][1] = NAN; }, "visual map: point 0: expected a finite position"},
      {[](VisualMap& m) { m.points.covariance[0](0, 1) = 0.5; }, "visual map: point 0: expected a covariance"},
      {[](VisualMap& m) { m.points.frame[0] = 2; }, "visual map: point 0: expected a frame that is there"},
      {[](VisualMap& m) { m.observations.frame[1] = 1; },
       "visual map: observation 1: expected the frame that lists it"},
      {[](VisualMap& m) { m.observations.point[1] = 0; },
       "visual map: observation 1: expected a point of its own track"},
      {[](VisualMap& m) { m.observations.pixel0[2][0] = HUGE_VAL; },
       "visual map: observation 2: expected finite numbers"},
      {[](VisualMap& m) { m.rigs[0].cameras[1].camera.fx = NAN; }, "visual map: rig 0: expected finite numbers"},
  };
  for (const auto& [spoil, message] : cases) {
    VisualMap m = small_map();
    spoil(m);
    const auto checked = m.check();
    ASSERT_FALSE(checked) << message;
    EXPECT_EQ(checked.error().message, message);
  }
}

MapFrames frames_at(std::initializer_list<std::int64_t> seconds) {
  VisualMap m;
  for (const std::int64_t s : seconds) m.add_frame(Time{s * 1'000'000'000}, Pose3d{}, 0);
  return m.frames;
}

// A turn of 0.3 rad/s about z at 2 m/s: all poses lie on one path Exp(t ξ), so that any two of them give it back.
TEST(InterpolatePoses, FollowsAScrewMotionBetweenSolvedNeighboursAndHoldsItBeyondTheEnds) {
  const Vec6d xi = {{0.0, 0.0, 0.3, 2.0, 0.0, 0.5}};
  MapFrames frames = frames_at({0, 1, 2, 3, 5, 9, 10});
  const auto truth = [&](std::uint32_t k) { return Pose3d::exp(xi * (frames.time[k] - Time{0}).seconds()); };
  for (const std::uint32_t k : {1u, 3u, 5u}) {
    frames.T_world_body[k] = truth(k);
    frames.status[k] = k == 1 ? FrameStatus::origin : FrameStatus::solved;
  }
  for (const std::uint32_t k : {0u, 2u, 4u, 6u}) frames.status[k] = FrameStatus::few;
  EXPECT_EQ(interpolate_poses(frames), 4);
  for (std::uint32_t k = 0; k < frames.size(); ++k)
    EXPECT_LT(frames.T_world_body[k].minus(truth(k)).norm(), 1e-12) << k;
}

TEST(InterpolatePoses, HoldsThePoseWhereThereIsOneAndChangesNothingWithoutAny) {
  MapFrames frames = frames_at({0, 1});
  frames.status[0] = frames.status[1] = FrameStatus::few;
  frames.T_world_body[1].t = {{1.0, 0.0, 0.0}};
  EXPECT_EQ(interpolate_poses(frames), 0);
  EXPECT_EQ(frames.T_world_body[1].t[0], 1.0);
  frames.status[1] = FrameStatus::origin;
  EXPECT_EQ(interpolate_poses(frames), 1);
  EXPECT_EQ(frames.T_world_body[0].t[0], 1.0);
}

}  // namespace
}  // namespace oriel
