// Where a track's point is, by the poses that are known of those that saw it.
#pragma once
#include <optional>
#include <span>
#include <vector>

#include "oriel/window/states.h"
#include "oriel/window/track_map.h"
#include "oriel/window/triangulate.h"

namespace oriel {

// A point is not taken where one of these does not hold.
struct TrackLimits {
  double least_depth = 0.2, greatest_depth = 150.0;  // at the first pose [m]
  double least_parallax = 0.003;                     // of the rays [rad]
  double start_gate = 30.0;                          // a sighting of a known pose is no further off [px]
};

struct PlacedSighting {
  Pose3d T_world_body;
  const Sighting* sighting = nullptr;
};

class TrackGeometry {
 public:
  TrackGeometry(const StereoRigd& rig, const TrackLimits& limits) : rig_(rig), limits_(limits) {}

  // In world, from at least one sighting; the first one's camera 0 says how deep it is.
  std::optional<Vec3d> locate(std::span<const PlacedSighting> seen);
  // Of a point in world, in camera 0 at a pose [m].
  double depth(const Pose3d& T_world_body, const Vec3d& p_world) const;
  // Of an inverse depth along a bearing in camera 0.
  Vec3d point_on(const Pose3d& T_world_body, const Vec2d& bearing, double rho) const;
  // Length of the error in the worse camera [px]; infinite where the point is not in view.
  double error(const Pose3d& T_world_body, const Sighting& sighting, const Vec3d& p_world) const;
  const TrackLimits& limits() const { return limits_; }
  const StereoRigd& rig() const { return rig_; }

 private:
  StereoRigd rig_;
  TrackLimits limits_;
  std::vector<Ray> rays_;
};

// A state that is not there any more was taken out as if it had never been (LeavingState::How::remove), so that what
// stayed of its factors' measurements may be used again; false: it may have been marginalized, and they are in the
// prior.
bool was_removed(const States& states, ProviderId provider, Time time);

// How two times see the same tracks.
struct FrameOverlap {
  int tracks = 0;         // that the later one sees
  int shared = 0;         // of them, that the earlier one saw too
  double parallax = 0.0;  // median angle by which they moved, turns of the body taken off [rad]
};

// `scratch` is overwritten.
FrameOverlap overlap_of(const TrackMap& map, Time earlier, const Pose3d& T_world_earlier, Time later,
                        const Pose3d& T_world_later, std::vector<double>& scratch);
// Median of the lengths by which shared tracks moved in camera 0 [px]; negative where none are shared.
double track_motion(const TrackMap& map, Time earlier, Time later, std::vector<double>& scratch);

}  // namespace oriel
