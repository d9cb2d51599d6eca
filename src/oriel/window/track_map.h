// TrackMap: the tracks that states of the window see, and which of them have a landmark in the graph.
#pragma once
#include <cstdint>
#include <utility>
#include <vector>

#include "oriel/graph/ids.h"
#include "oriel/manifold/inverse_depth.h"
#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"
#include "oriel/sensor/feature_track.h"
#include "oriel/sensor/stereo_rig.h"

namespace oriel {

// A track seen from one state.
struct Sighting {
  Time time;  // of the state
  VariableId<Pose3d> pose;
  Vec2d pixel0, pixel1;     // [px]
  Vec2d bearing, bearing1;  // undistorted [x/z, y/z] in each camera
  bool has_right = false;
  bool in_graph = false;  // `factor` is there
  FactorId factor;
};

// The first sighting anchors the landmark.
struct Track {
  std::int64_t id = 0;
  bool live = false, has_landmark = false;
  VariableId<InverseDepthd> landmark;  // or `point`, as LandmarkBuilder is told
  VariableId<Point3d> point;
  std::vector<Sighting> sightings;  // by time
};

class TrackMap {
 public:
  TrackMap(const StereoRigd& rig, bool stereo) : rig_(rig), stereo_(stereo) {}

  const StereoRigd& rig() const { return rig_; }
  // Room for so many tracks, each seen from so many states, without an allocation.
  void reserve(std::size_t tracks, std::size_t states);

  // Adds a frame's sightings. `seen` gets the places of its tracks. What no ray of the cameras' models explains is left
  // out; returns how many.
  int observe(const StereoFrame& frame, VariableId<Pose3d> pose, std::vector<std::uint32_t>& seen);
  // Some track has a sighting of that time.
  bool has_seen(Time time) const;
  // The sightings of a state are forgotten. Tracks that have none left are gone.
  void forget(Time time);
  // All sightings of a track are used up: it begins anew when it is seen again.
  void close(std::uint32_t track);
  void clear();

  Track& track(std::uint32_t place) { return tracks_[place]; }
  const Track& track(std::uint32_t place) const { return tracks_[place]; }
  // Places are [0, extent()); those of tracks that are gone are not `live`.
  std::uint32_t extent() const { return static_cast<std::uint32_t>(tracks_.size()); }
  // Place of a track, or extent().
  std::uint32_t find(std::int64_t id) const;

 private:
  std::uint32_t place_of(std::int64_t id);
  void release(std::uint32_t place);

  StereoRigd rig_;
  bool stereo_;
  std::vector<Track> tracks_;  // a gone track keeps the memory of its sightings
  std::vector<std::uint32_t> free_;
  std::vector<std::pair<std::int64_t, std::uint32_t>> index_;  // by id
};

}  // namespace oriel
