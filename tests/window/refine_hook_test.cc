// A new state whose prediction is far off is found among the points that are known, before anything is solved.
#include "oriel/window/refine_hook.h"

#include "oriel/window/track_builder.h"
#include "track_world.h"

namespace oriel {
namespace {

using track_world::Walk;
using track_world::WalkWindow;

// What the hooks before it have left of a new state: its pose.
class Spy final : public InsertionHook {
 public:
  Spy(ProviderId poses, std::vector<Pose3d>& seen) : poses_(poses), seen_(&seen) {}
  std::string_view name() const override { return "spy"; }
  Verdict inserted(const Graph& graph, const States& states, const InsertedGroup& group, GraphEdit&) override {
    seen_->push_back(graph.value(OdometryProvider<Pose3d>::pose(*states.timeline(poses_).find(group.newest))));
    return {};
  }

 private:
  ProviderId poses_;
  std::vector<Pose3d>* seen_;
};

constexpr int kFrames = 9, kSlip = 6;  // at that step the odometry is a metre and a half radian off
const Pose3d kSlipped{Rot3d::exp({{0.2, -0.4, 0.2}}), {{0.6, -0.5, 0.6}}};

struct Outcome {
  std::vector<Pose3d> entered;  // poses as they were before the solve
  std::int64_t refined = 0, dropped = 0;
  double error = 0.0;  // of the window in the end
};

Outcome run(Walk walk, LandmarkKind landmarks, bool with_hook) {
  walk.steps[kSlip] = walk.steps[kSlip] * kSlipped;
  WalkWindow w(walk, LandmarkPolicy::close);
  TrackBuilderOptions options;
  options.landmarks = landmarks;
  auto builder = std::make_unique<TrackBuilder>(w.poses, walk.rig, w.rig, options);
  TrackBuilder* tracks = builder.get();
  w.window.add(std::move(builder));
  auto hook = std::make_unique<RefineHook>(w.poses, RefineOptions{.refine_above = 20.0});  // as good as a step is
  RefineHook* refine = hook.get();
  if (with_hook) w.window.add(std::move(hook));
  Outcome out;
  w.window.add(std::make_unique<Spy>(w.poses, out.entered));
  for (int k = 0; k < kFrames; ++k) {
    const double sigma = k == kSlip ? 1.0 : walk.step_sigma;  // a slip that odometry knows of
    if (k > 0) {
      EXPECT_TRUE(w.odometry->add(walk.times[k], walk.steps[k], Mat6d::identity() * (sigma * sigma)).ok());
    }
    tracks->add(walk.frame(k));
    EXPECT_EQ(w.window.update().status, WindowUpdate::Status::updated);
  }
  if (with_hook) out.refined = refine->refined(), out.dropped = refine->dropped();
  out.error = w.error(walk);
  return out;
}

// W9
TEST(RefineHook, FindsAStateThatIsPredictedFarOffAmongKnownPoints) {
  const Walk walk(kFrames, 0.5, 2);
  for (const LandmarkKind landmarks : {LandmarkKind::point, LandmarkKind::inverse_depth}) {
    const Outcome with = run(walk, landmarks, true), without = run(walk, landmarks, false);
    EXPECT_GT(without.entered[kSlip].minus(walk.truth[kSlip]).norm(), 0.8);
    EXPECT_LT(with.entered[kSlip].minus(walk.truth[kSlip]).norm(), 0.05);
    EXPECT_EQ(with.refined, 1);
    EXPECT_EQ(with.dropped, 0);
    EXPECT_LT(with.error, 0.05);
  }
}

// A third of what is seen there is matched wrongly: these sightings leave, and no others.
TEST(RefineHook, TakesOutSightingsThatAreFarFromThePoseThatTheOthersAgreeOn) {
  Walk walk(kFrames, 0.5, 2);
  const Outcome clean = run(walk, LandmarkKind::point, true);
  int wrong = 0;
  for (std::size_t i = 0; i < walk.frames[kSlip].size(); i += 3) {
    FeatureObservation& f = walk.frames[kSlip][i];
    f.pixel0[0] += 60.0, f.pixel0[1] -= 45.0, ++wrong;
  }
  const Outcome out = run(walk, LandmarkKind::point, true);
  EXPECT_LT(out.entered[kSlip].minus(walk.truth[kSlip]).norm(), 0.05);
  EXPECT_EQ(clean.dropped, 0);
  EXPECT_GT(out.dropped, wrong / 2);  // of the others nothing was known before
  EXPECT_LE(out.dropped, wrong);
  EXPECT_LT(out.error, 0.05);
}

// Where it has nothing to say it changes nothing, to the last bit.
TEST(RefineHook, LeavesAGoodPredictionAlone) {
  Walk walk(kFrames, 0.5, 2);
  const Pose3d back = kSlipped.inverse();
  walk.steps[kSlip] = walk.steps[kSlip] * back;  // no slip
  const Outcome with = run(walk, LandmarkKind::point, true), without = run(walk, LandmarkKind::point, false);
  EXPECT_EQ(with.refined, 0);
  EXPECT_EQ(with.dropped, 0);
  ASSERT_EQ(with.entered.size(), without.entered.size());
  EXPECT_EQ(std::memcmp(with.entered.data(), without.entered.data(), sizeof(Pose3d) * with.entered.size()), 0);
}

}  // namespace
}  // namespace oriel
