// Tracks become landmarks and reprojections.
#include "oriel/window/track_builder.h"

#include <gtest/gtest.h>

#include "oriel/window/cheirality_hook.h"
#include "oriel/window/keyframe_policy.h"
#include "window/track_world.h"

namespace oriel {
namespace {

using namespace track_world;

struct TrackRun : WalkWindow {
  TrackBuilder* tracks;

  TrackRun(const Walk& walk, LandmarkPolicy landmarks, const TrackBuilderOptions& options = {}, int states = 6)
      : WalkWindow(walk, landmarks, states) {
    auto builder = std::make_unique<TrackBuilder>(poses, walk.rig, rig, options);
    tracks = builder.get();
    window.add(std::move(builder));
  }
  const WindowUpdate& step(const Walk& walk, int k) {
    move(walk, k);
    tracks->add(walk.frame(k));
    const WindowUpdate& update = window.update();
    EXPECT_EQ(update.status, WindowUpdate::Status::updated) << update.error << update.solve;
    return update;
  }
};

struct Case {
  LandmarkKind kind;
  LandmarkPolicy policy;
  int right_every;
};
constexpr Case kCases[] = {
    {LandmarkKind::inverse_depth, LandmarkPolicy::close, 1}, {LandmarkKind::inverse_depth, LandmarkPolicy::close, 0},
    {LandmarkKind::inverse_depth, LandmarkPolicy::keep, 2},  {LandmarkKind::point, LandmarkPolicy::close, 2},
    {LandmarkKind::point, LandmarkPolicy::keep, 0},          {LandmarkKind::point, LandmarkPolicy::keep, 1}};

TrackBuilderOptions of_kind(LandmarkKind kind) {
  TrackBuilderOptions options;
  options.landmarks = kind;
  return options;
}

// W6, W14
TEST(TrackBuilder, FollowsTheTruthWherePixelsAreExact) {
  for (const Case& c : kCases) {
    const Walk walk(25, 0.0, c.right_every);
    TrackRun run(walk, c.policy, of_kind(c.kind));
    for (int k = 0; k < 25; ++k) {
      run.step(walk, k);
      EXPECT_LT(run.error(walk), 1e-3) << "frame " << k;
    }
    EXPECT_EQ(run.window.states().timeline(run.poses).size(), 6u);
    EXPECT_LT(run.error(walk), 1e-4);
    EXPECT_GT(run.tracks->counts().started, 50);
    EXPECT_EQ(run.tracks->counts().refused, 0);
  }
}

// W6, M6
TEST(TrackBuilder, HandsOverNoSightingTwice) {
  for (const Case& c : kCases) {
    const Walk walk(25, 0.5, c.right_every);
    TrackRun run(walk, c.policy, of_kind(c.kind));
    PixelWatch watch;
    std::size_t sightings = 0;
    for (int k = 0; k < 25; ++k) {
      run.step(walk, k);
      watch.look(run.window.graph());
      sightings += walk.frames[k].size();
      EXPECT_LT(run.nees(walk), most_nees()) << "frame " << k;
    }
    EXPECT_GT(watch.used(), sightings / 2);
  }
}

// W13
TEST(TrackBuilder, LeavesNoLandmarkBehindThatNothingSees) {
  for (const Case& c : kCases) {
    const Walk walk(30, 0.5, c.right_every);
    TrackRun run(walk, c.policy, of_kind(c.kind));
    for (int k = 0; k < 30; ++k) run.step(walk, k);
    const Graph& graph = run.window.graph();
    std::size_t lonely = 0, landmarks = 0;
    auto judge = [&](VariableKey id) {
      ++landmarks;
      bool seen = false;
      graph.for_each_factor(id, [&](std::uint32_t table, std::uint32_t) { seen |= table != Graph::kPriorTable; });
      lonely += seen ? 0 : 1;
    };
    graph.for_each<InverseDepthd>([&](auto id, const auto&) { judge(id); });
    graph.for_each<Point3d>([&](auto id, const auto&) { judge(id); });
    EXPECT_GT(landmarks, 10u);
    EXPECT_LT(landmarks, 150u);
    EXPECT_LE(lonely, 30u) << "they go with the next slide";
  }
}

// W13: states that give way take sightings with them. A point that is left with one of one camera has no depth; it goes
// with the next slide, and solves do not carry it along.
TEST(TrackBuilder, LeavesNoPointBehindThatOneCameraSawOnce) {
  const Walk walk(40, 0.5, 2);
  TrackRun run(walk, LandmarkPolicy::close, of_kind(LandmarkKind::point));
  KeyframeRules rules;
  rules.parallax = 0.15, rules.least_shared = 0.3, rules.max_keyframes = 4;
  run.window.set(std::make_unique<KeyframePolicy>(
      run.poses, [&run](const Graph& g, const States& s, Time a, Time b) { return run.tracks->overlap(g, s, a, b); },
      rules));
  std::size_t undetermined = 0, removed = 0;
  for (int k = 0; k < 40; ++k) {
    const WindowUpdate& update = run.step(walk, k);
    undetermined += update.solve.undetermined.size();
    removed += static_cast<std::size_t>(update.states_removed);
  }
  EXPECT_GT(removed, 10u);
  EXPECT_LE(undetermined, 40u) << "without that: 155";
}

// W9
TEST(TrackBuilder, TakesGrossErrorsOutBeforeTheyEnterThePrior) {
  Walk walk(25, 0.3, 1);
  Random random(9);
  for (auto& frame : walk.frames)
    for (auto& f : frame)
      if (random.uniform(0.0, 1.0) < 0.03) f.pixel0 += random.normal<2>(60.0);
  TrackRun run(walk, LandmarkPolicy::close);
  run.window.add(std::make_unique<CheiralityHook>());
  for (int k = 0; k < 25; ++k) run.step(walk, k);
  EXPECT_GT(run.tracks->counts().gated, 10);
  EXPECT_LT(run.nees(walk), most_nees());
}

// W6
TEST(TrackBuilder, TakesFramesThatComeLateOrTwice) {
  const Walk walk(12, 0.0, 1);
  TrackRun run(walk, LandmarkPolicy::close, {}, 20);
  for (int k = 0; k < 12; ++k) {
    run.move(walk, k);
    if (k % 3 == 1) continue;  // this one comes after the next
    run.tracks->add(walk.frame(k));
    if (k % 3 == 2) run.tracks->add(walk.frame(k - 1));
    if (k == 5) run.tracks->add(walk.frame(k));
    EXPECT_EQ(run.window.update().status, WindowUpdate::Status::updated);
  }
  EXPECT_EQ(run.window.states().timeline(run.poses).size(), 12u);
  EXPECT_EQ(run.tracks->counts().repeated, 1);
  EXPECT_LT(run.error(walk), 1e-4);
}

// W11
TEST(KeyframePolicy, KeepsKeyframesAndLetsOtherStatesGiveWay) {
  for (const auto others : {KeyframeRules::Others::drop, KeyframeRules::Others::lag, KeyframeRules::Others::keep}) {
    const Walk walk(40, 0.3, 1);
    TrackRun run(walk, LandmarkPolicy::close);
    KeyframeRules rules;
    rules.parallax = 0.15;
    rules.least_shared = 0.3;
    rules.max_keyframes = 4;
    rules.others = others;
    auto policy = std::make_unique<KeyframePolicy>(
        run.poses, [&run](const Graph& g, const States& s, Time a, Time b) { return run.tracks->overlap(g, s, a, b); },
        rules);
    const KeyframePolicy& keyframes = *policy;
    run.window.set(std::move(policy));
    int removed = 0, marginalized = 0;
    for (int k = 0; k < 40; ++k) {
      const WindowUpdate& update = run.step(walk, k);
      removed += update.states_removed, marginalized += update.states_marginalized;
      EXPECT_LT(run.nees(walk), most_nees()) << "frame " << k;
      EXPECT_LE(keyframes.keyframes().size(), 5u);
    }
    const Timeline<State>& line = run.window.states().timeline(run.poses);
    std::size_t other = 0;
    for (const State& s : line) other += keyframes.is_keyframe(s.time) ? 0 : 1;
    EXPECT_GT(marginalized, 3);
    if (others == KeyframeRules::Others::keep) {
      EXPECT_EQ(removed, 0);
    } else {
      EXPECT_GT(removed, 10);
      EXPECT_LE(other, others == KeyframeRules::Others::drop ? 1u : 4u);
    }
  }
}

// W11
TEST(KeyframePolicy, ChoosesByParallaxByWhatIsSharedAndByTime) {
  const KeyframeRules rules;
  const Duration soon{100'000'000};
  EXPECT_FALSE(is_keyframe(rules, {100, 90, 0.01}, soon));
  EXPECT_TRUE(is_keyframe(rules, {100, 90, 0.06}, soon));
  EXPECT_TRUE(is_keyframe(rules, {100, 50, 0.01}, soon));
  EXPECT_TRUE(is_keyframe(rules, {100, 90, 0.01}, rules.interval));
  EXPECT_FALSE(is_keyframe(rules, {0, 0, 0.0}, soon)) << "a blind frame is a key to nothing";
}

}  // namespace
}  // namespace oriel
