#include "oriel/window/track_map.h"

#include <algorithm>

namespace oriel {

void TrackMap::reserve(std::size_t tracks, std::size_t states) {
  index_.reserve(tracks);
  free_.reserve(tracks);
  while (tracks_.size() < tracks) {
    free_.push_back(static_cast<std::uint32_t>(tracks_.size()));
    tracks_.emplace_back().sightings.reserve(states);
  }
  std::reverse(free_.begin(), free_.end());
}

std::uint32_t TrackMap::find(std::int64_t id) const {
  const auto at = std::lower_bound(index_.begin(), index_.end(), std::pair{id, std::uint32_t{0}});
  return at != index_.end() && at->first == id ? at->second : extent();
}

std::uint32_t TrackMap::place_of(std::int64_t id) {
  const auto at = std::lower_bound(index_.begin(), index_.end(), std::pair{id, std::uint32_t{0}});
  if (at != index_.end() && at->first == id) return at->second;
  if (free_.empty()) {
    free_.push_back(extent());
    tracks_.emplace_back();
  }
  const std::uint32_t place = free_.back();
  free_.pop_back();
  index_.insert(at, {id, place});
  Track& t = tracks_[place];
  t.id = id;
  t.live = true;
  t.has_landmark = false;
  t.sightings.clear();
  return place;
}

void TrackMap::release(std::uint32_t place) {
  Track& t = tracks_[place];
  index_.erase(std::lower_bound(index_.begin(), index_.end(), std::pair{t.id, std::uint32_t{0}}));
  t.live = t.has_landmark = false;
  t.sightings.clear();
  free_.push_back(place);
}

int TrackMap::observe(const StereoFrame& frame, VariableId<Pose3d> pose, std::vector<std::uint32_t>& seen) {
  int left_out = 0;
  seen.clear();
  for (const FeatureObservation& f : frame.features) {
    const Result<Vec2d> bearing = rig_.cameras[0].camera.unproject(f.pixel0);
    if (!bearing) {
      ++left_out;
      continue;
    }
    Sighting s{frame.time, pose, f.pixel0, f.pixel1, *bearing, Vec2d::zero(), false, false, {}};
    if (f.has_right && stereo_)
      if (const Result<Vec2d> right = rig_.cameras[1].camera.unproject(f.pixel1)) {
        s.has_right = true;
        s.bearing1 = *right;
      }
    const std::uint32_t place = place_of(f.track);
    tracks_[place].sightings.push_back(s);
    seen.push_back(place);
  }
  return left_out;
}

bool TrackMap::has_seen(Time time) const {
  return std::any_of(tracks_.begin(), tracks_.end(), [time](const Track& t) {
    return t.live &&
           std::any_of(t.sightings.begin(), t.sightings.end(), [time](const Sighting& s) { return s.time == time; });
  });
}

void TrackMap::forget(Time time) {
  for (std::uint32_t k = 0; k < extent(); ++k) {
    Track& t = tracks_[k];
    if (!t.live) continue;
    std::erase_if(t.sightings, [time](const Sighting& s) { return s.time == time; });
    if (t.sightings.empty()) release(k);
  }
}

void TrackMap::close(std::uint32_t track) { release(track); }

void TrackMap::clear() {
  for (std::uint32_t k = 0; k < extent(); ++k)
    if (tracks_[k].live) release(k);
}

}  // namespace oriel
