// A new state stands where its provider predicts it. After a gap in the motion that may be far from where it is, and a
// solve that begins there ends in another valley, or follows wrong matches. Before that, this hook looks at the points
// that the new frame sees and that were known before it: the pose is refined against them, robustly, or found without a
// guess, as InertialOdometry does (refine_pose.h, relocate.h); sightings that are far from it are wrong matches and
// leave.
#pragma once
#include <cstdint>
#include <vector>

#include "oriel/window/factor_probe.h"
#include "oriel/window/insertion_hook.h"
#include "oriel/window/relocate.h"

namespace oriel {

struct RefineOptions {
  int least_points = 8;        // that a pose is refined from
  double refine_above = 4.0;   // median error of the predicted pose above which it is refined [px]
  double match_gate = 15.0;    // a sighting further off a pose that is sure is no match [px]
  double predict_gate = 30.0;  // further off the predicted one, where the points agree with no pose [px]
};

class RefineHook final : public InsertionHook {
 public:
  // Of a provider whose states have a Pose3d. Looks at sightings of points and of anchored inverse depths
  // (residual/reprojection.h).
  explicit RefineHook(ProviderId poses, const RefineOptions& options = {}) : poses_(poses), options_(options) {}

  std::string_view name() const override { return "refine"; }
  Verdict inserted(const Graph& graph, const States& states, const InsertedGroup& group, GraphEdit& edit) override;
  std::int64_t refined() const { return refined_; }  // poses, so far
  std::int64_t dropped() const { return dropped_; }  // sightings, so far

 private:
  bool take(const Graph& graph, FactorId id, VariableKey pose);

  ProviderId poses_;
  RefineOptions options_;
  std::vector<PointSighting> known_;
  std::vector<FactorId> factors_;  // of `known_`
  StereoRigd rig_;
  PoseWorkspace work_;
  GroupPruner pruner_;
  std::int64_t refined_ = 0, dropped_ = 0;
};

}  // namespace oriel
