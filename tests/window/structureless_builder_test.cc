// Batch building of structureless tracks.
#include "oriel/window/structureless_builder.h"

#include <gtest/gtest.h>

#include "oriel/graph/fingerprint.h"
#include "window/dense_oracle.h"
#include "window/track_world.h"

namespace oriel {
namespace {

using namespace track_world;
using Leaving = StructurelessOptions::Leaving;

struct TrackRun : WalkWindow {
  StructurelessBuilder* tracks;

  TrackRun(const Walk& walk, Leaving leaving, int states = 6)
      : WalkWindow(walk, leaving == Leaving::landmark ? LandmarkPolicy::keep : LandmarkPolicy::close, states) {
    StructurelessOptions options;
    options.leaving = leaving;
    auto builder = std::make_unique<StructurelessBuilder>(poses, walk.rig, rig, options);
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

// W10
TEST(StructurelessBuilder, FollowsTheTruthWherePixelsAreExact) {
  for (const Leaving leaving : {Leaving::absorb, Leaving::landmark})
    for (const int right : {0, 2}) {
      const Walk walk(25, 0.0, right);
      TrackRun run(walk, leaving);
      for (int k = 0; k < 25; ++k) {
        run.step(walk, k);
        EXPECT_LT(run.error(walk), 1e-3) << "frame " << k;
      }
      EXPECT_LT(run.error(walk), 1e-4);
      EXPECT_GT(run.tracks->factors(), 10);
      EXPECT_EQ(run.tracks->counts().landmarks > 0, leaving == Leaving::landmark);
      EXPECT_EQ(run.tracks->counts().lost_correlations > 0, leaving == Leaving::absorb);
    }
}

// W10
TEST(StructurelessBuilder, GivesTheSameSetWhereNothingIsNew) {
  const Walk walk(10, 0.5, 2);
  TrackRun run(walk, Leaving::landmark);
  for (int k = 0; k < 10; ++k) {
    run.step(walk, k);
    const std::uint64_t version = run.window.graph().structure_version();
    const int factors = run.tracks->factors();
    EXPECT_EQ(run.window.update().status, WindowUpdate::Status::nothing_new);
    EXPECT_EQ(run.window.graph().structure_version(), version);
    EXPECT_EQ(run.tracks->factors(), factors);
  }
}

// W10
TEST(StructurelessBuilder, CountsNoSightingTwice) {
  for (const Leaving leaving : {Leaving::absorb, Leaving::landmark}) {
    const Walk walk(40, 0.5, 2);
    TrackRun run(walk, leaving);
    PixelWatch watch;
    std::size_t sightings = 0;
    for (int k = 0; k < 40; ++k) {
      run.step(walk, k);
      watch.look(run.window.graph());
      sightings += walk.frames[k].size();
      EXPECT_LT(run.nees(walk), most_nees()) << "frame " << k;
    }
    EXPECT_GT(watch.used(), sightings / 2);
    EXPECT_LT(run.window.graph().count<Point3d>(), 150u);
  }
}

// W10
TEST(StructurelessBuilder, MakesPointsVariablesWithoutALossWhenAStateLeaves) {
  const Walk walk(6, 0.5, 2);
  TrackRun run(walk, Leaving::landmark);
  for (int k = 0; k < 6; ++k) run.step(walk, k);
  Graph& graph = run.window.core().followed();
  const auto before = dense_oracle::system(graph);
  const std::size_t points = graph.count<Point3d>();
  const VariableKey leaving[] = {run.window.states().timeline(run.poses).oldest()->variables[0]};
  GraphEdit edit = graph.edit();
  run.tracks->before_slide(graph, run.window.states(), leaving, edit);
  ASSERT_TRUE(graph.apply(edit).ok());
  EXPECT_GT(graph.count<Point3d>(), points + 5);
  const auto after = dense_oracle::schur_complement(dense_oracle::system(graph), before);
  EXPECT_LT(dense_oracle::difference(after.H, before.H), 1e-9);
  EXPECT_LT((after.g - before.g).norm(), 1e-9 * (1.0 + before.H.norm()));
}

// W10
TEST(StructurelessBuilder, GivesATrackThatOutgrowsAFactorItsPoint) {
  const Walk walk(14, 0.0, 1);
  TrackRun run(walk, Leaving::absorb, 20);
  PixelWatch watch;
  for (int k = 0; k < 14; ++k) {
    run.step(walk, k);
    watch.look(run.window.graph());
  }
  EXPECT_GT(run.tracks->counts().landmarks, 0);
  EXPECT_EQ(run.tracks->counts().lost_correlations, 0);
  EXPECT_LT(run.error(walk), 1e-4);
}

}  // namespace
}  // namespace oriel
