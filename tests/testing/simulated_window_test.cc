#include "oriel/testing/simulated_window.h"

#include <gtest/gtest.h>

#include <cstring>

namespace oriel {
namespace {

SimulatedWindow simulated(bool frames_between) {
  SimulatedWindowOptions options;
  options.keyframes = 8;
  options.window = 5;
  options.landmarks = 30;
  options.frames_between = frames_between;
  return simulate_window(options);
}

TEST(SimulatedWindow, HasTheSameKeyframesWithFramesBetweenThem) {
  const SimulatedWindow without = simulated(false), with = simulated(true);
  ASSERT_EQ(without.keyframes.size(), with.keyframes.size());
  EXPECT_TRUE(without.between.empty());
  for (std::size_t k = 0; k < with.keyframes.size(); ++k) {
    const SimulatedKeyframe &a = without.keyframes[k], &b = with.keyframes[k];
    EXPECT_EQ(std::memcmp(&a.motion, &b.motion, sizeof(a.motion)), 0);
    ASSERT_EQ(a.observations.size(), b.observations.size());
    for (std::size_t i = 0; i < a.observations.size(); ++i)
      EXPECT_EQ(std::memcmp(&a.observations[i].pixel0, &b.observations[i].pixel0, sizeof(Vec2d)), 0);
  }
}

TEST(SimulatedWindow, PutsAFrameHalfWayBetweenTwoKeyframes) {
  const SimulatedWindow stream = simulated(true);
  ASSERT_EQ(stream.between.size() + 1, stream.keyframes.size());
  for (std::size_t k = 0; k < stream.between.size(); ++k) {
    const SimulatedKeyframe& before = stream.keyframes[k];
    const SimulatedFrame& frame = stream.between[k];
    EXPECT_EQ(2 * (frame.time.ns - before.time.ns), stream.keyframes[k + 1].time.ns - before.time.ns);
    // Its IMU leads there from the keyframe before, as far as noise goes in an eighth of a second.
    const PredictedState there = predict_state(frame.motion.motion, before.T_world_body, before.v, before.bias);
    EXPECT_LT((there.T_world_body.t - frame.T_world_body.t).norm(), 2e-3);
    EXPECT_FALSE(frame.observations.empty());
    for (const SimulatedObservation& o : frame.observations) {
      const SimulatedTrack& track = stream.tracks[static_cast<std::size_t>(o.track)];
      EXPECT_LE(track.anchor, static_cast<int>(k));
      EXPECT_GT(track.anchor + track.length, static_cast<int>(k) + 1);
    }
  }
}

}  // namespace
}  // namespace oriel
