// From tracks to landmarks and their factors: an inverse depth at the first sighting's camera 0, and a reprojection for
// each further sighting. A landmark starts when the rays of two sightings or more say where it is.
#pragma once
#include <vector>

#include "oriel/graph/graph.h"
#include "oriel/window/odometry_options.h"
#include "oriel/window/track_map.h"
#include "oriel/window/triangulate.h"

namespace oriel {

class LandmarkBuilder {
 public:
  LandmarkBuilder(const VisualOptions& options, const StereoRigd& rig) : options_(options), rig_(rig) {}
  void reserve(std::size_t states) {
    rays_.reserve(2 * states);
    poses_.reserve(states);
  }
  void set_rig(VariableId<StereoRigd> id) { rig_id_ = id; }

  // A factor for the newest sighting of a track with a landmark.
  void extend(GraphEdit& edit, Track& track) const { add_factor(edit, track, track.sightings.back()); }
  // A landmark and the factors of all sightings; false while that is not possible. At rest one camera sees no parallax
  // but its noise's.
  bool start(GraphEdit& edit, Track& track, bool at_rest);
  // The landmark leaves, and its factors with it; the sightings stay.
  void remove(GraphEdit& edit, Track& track) const;

  // Where a track's point is, by the values of the graph: its landmark, or else what the two cameras say that saw it
  // first. None if neither is there.
  std::optional<Vec3d> position(const Graph& graph, const Track& track) const;
  // Of a track with a landmark, in camera 0 at its first sighting [1/m]; ≤ 0 behind it.
  double inverse_depth(const Graph& graph, const Track& track) const;
  // Lengths of the errors in the two cameras [px], the second 0 where there is none; infinite where it is not in view.
  Vec2d errors(const Graph& graph, const Track& track, const Sighting& sighting) const;
  // The right camera's measurement is given up, the left one's stays.
  void forget_right(GraphEdit& edit, Track& track, Sighting& sighting) const;

 private:
  bool has_points() const { return options_.landmarks == LandmarkModel::point; }
  void add_factor(GraphEdit& edit, Track& track, Sighting& sighting) const;
  void add_point_factor(GraphEdit& edit, Track& track, Sighting& sighting) const;
  Vec2d errors_at(const Vec2d& anchor_bearing, const Pose3d& anchor, const Pose3d& body, double rho,
                  const Sighting& sighting) const;

  VisualOptions options_;
  StereoRigd rig_;
  VariableId<StereoRigd> rig_id_;
  std::vector<Ray> rays_;
  std::vector<Pose3d> poses_;
};

}  // namespace oriel
