#include "oriel/window/structureless_builder.h"

#include <algorithm>
#include <utility>

#include "oriel/residual/reprojection.h"

namespace oriel {
namespace {

constexpr std::size_t kMost = detail::kMostTrackViews;

template <std::size_t N>
FactorId add_track(GraphEdit& edit, const std::vector<TrackView>& views, const std::vector<VariableId<Pose3d>>& ids,
                   VariableId<StereoRigd> rig, const StructurelessOptions& o) {
  StructurelessTrack<static_cast<int>(N)> track;
  std::copy_n(views.begin(), N, track.views.begin());
  return [&]<std::size_t... I>(std::index_sequence<I...>) {
    return edit.add(track, Sigma(o.pixel_sigma), o.loss, ids[I]..., rig);
  }
  (std::make_index_sequence<N>{});
}

using AddTrack = FactorId (*)(GraphEdit&, const std::vector<TrackView>&, const std::vector<VariableId<Pose3d>>&,
                              VariableId<StereoRigd>, const StructurelessOptions&);
constexpr AddTrack kAddTrack[kMost + 1] = {nullptr,       nullptr,       &add_track<2>, &add_track<3>, &add_track<4>,
                                           &add_track<5>, &add_track<6>, &add_track<7>, &add_track<8>};

TrackView view_of(const Sighting& s) {
  return {s.bearing, s.bearing1, s.pixel0, s.has_right ? s.pixel1 : Vec2d::zero(), s.has_right ? 1.0 : 0.0};
}

VariableId<Point3d> point_of(const Track& track) { return {track.landmark.key}; }

}  // namespace

StructurelessBuilder::StructurelessBuilder(ProviderId poses, const StereoRigd& rig, VariableId<StereoRigd> rig_id,
                                           const StructurelessOptions& options)
    : poses_(poses), rig_id_(rig_id), options_(options), geometry_(rig, options.limits), map_(rig, options.stereo) {
  map_.reserve(options.expected_tracks, options.expected_states);
  built_.reserve(options.expected_tracks);
  staged_.reserve(options.expected_tracks);
  retired_.reserve(options.expected_tracks);
  seen_.reserve(options.expected_tracks);
  scratch_.reserve(options.expected_tracks);
}

void StructurelessBuilder::add(const StereoFrame& frame) {
  if (waiting_ == frames_.size()) frames_.emplace_back();
  frames_[waiting_].time = frame.time;
  frames_[waiting_++].features.assign(frame.features.begin(), frame.features.end());
}

void StructurelessBuilder::wanted(std::vector<std::pair<ProviderId, Time>>& times) const {
  for (std::size_t k = 0; k < waiting_; ++k) times.emplace_back(poses_, frames_[k].time);
}

// Frames whose state is there; others wait on, or came too late.
void StructurelessBuilder::take_frames(const States& states) {
  std::size_t kept = 0;
  for (std::size_t k = 0; k < waiting_; ++k) {
    const Reach reach = states.reach(poses_, frames_[k].time);
    if (reach == Reach::too_old) {
      ++counts_.late;
    } else if (reach != Reach::there) {
      std::swap(frames_[kept++], frames_[k]);
    } else if (map_.has_seen(frames_[k].time)) {
      ++counts_.repeated;
    } else {
      counts_.no_ray += map_.observe({frames_[k].time, frames_[k].features}, {}, seen_);
    }
  }
  waiting_ = kept;
}

Result<bool> StructurelessBuilder::rebuild(const Graph& graph, const States& states, GraphEdit& edit) {
  staged_.clear();
  staged_sightings_.clear();
  take_frames(states);
  bool changed = false;
  for (std::uint32_t place = 0; place < map_.extent(); ++place)
    if (map_.track(place).live) changed = update_track(graph, states, place, edit) || changed;
  return changed;
}

StructurelessBuilder::Built& StructurelessBuilder::built(std::uint32_t place) {
  if (built_.size() < map_.extent()) built_.resize(map_.extent());
  if (built_[place].track != map_.track(place).id) built_[place] = {map_.track(place).id, {}, 0, 0};
  return built_[place];
}

bool StructurelessBuilder::update_track(const Graph& graph, const States& states, std::uint32_t place,
                                        GraphEdit& edit) {
  Track& track = map_.track(place);
  Built& b = built(place);
  if (track.has_landmark) return extend_landmark(states, place, edit);
  if (track.sightings.size() < 2 || track.sightings.size() == b.tried) return false;
  b.tried = track.sightings.size();
  if (!gather(graph, states, track)) return false;
  stage(place);
  if (b.factor.table != 0) edit.remove(b.factor);
  if (track.sightings.size() > kMost) {
    make_landmark(place, edit);
  } else {
    b.factor = kAddTrack[track.sightings.size()](edit, views_, ids_, rig_id_, options_);
    b.sightings = track.sightings.size();
  }
  return true;
}

void StructurelessBuilder::stage(std::uint32_t place) {
  staged_.push_back({place, built_[place], map_.track(place).has_landmark});
}

// Views and poses of all its sightings; false where they do not say where the point is.
bool StructurelessBuilder::gather(const Graph& graph, const States& states, const Track& track) {
  views_.clear(), values_.clear(), pointers_.clear(), ids_.clear(), placed_.clear();
  for (const Sighting& s : track.sightings) {
    const VariableKey id = states.find(poses_, s.time, kVariableOps<Pose3d>.key);
    const auto* pose = static_cast<const Pose3d*>(graph.find_value(id));
    if (pose == nullptr) return false;
    views_.push_back(view_of(s));
    values_.push_back(*pose);
    ids_.push_back({id.key});
    placed_.push_back({*pose, &s});
  }
  for (const Pose3d& pose : values_) pointers_.push_back(&pose);
  Vec3d p_world;
  const int n = static_cast<int>(std::min(kMost, views_.size()));
  return geometry_.locate(placed_).has_value() &&
         detail::locate_structureless(views_.data(), pointers_.data(), n, geometry_.rig(), p_world);
}

// The point as a variable, at its best place, with all sightings; of what was gathered.
void StructurelessBuilder::make_landmark(std::uint32_t place, GraphEdit& edit) {
  Track& track = map_.track(place);
  Vec3d p_world = Vec3d::zero();
  const int n = static_cast<int>(std::min(kMost, views_.size()));
  (void)detail::locate_structureless(views_.data(), pointers_.data(), n, geometry_.rig(), p_world);
  track.landmark = {edit.add(Point3d{p_world}).key};
  track.has_landmark = true;
  for (std::size_t k = 0; k < track.sightings.size(); ++k) add_sighting(edit, track, track.sightings[k], ids_[k]);
  built_[place].factor = {};
  built_[place].sightings = 0;
  ++counts_.landmarks;
}

void StructurelessBuilder::add_sighting(GraphEdit& edit, Track& track, Sighting& s, VariableId<Pose3d> pose) {
  const IsotropicNoise noise = Sigma(options_.pixel_sigma);
  s.factor =
      s.has_right
          ? edit.add(StereoPointReprojectiond{s.pixel0, s.pixel1}, noise, options_.loss, pose, point_of(track), rig_id_)
          : edit.add(MonoPointReprojectiond{s.pixel0}, noise, options_.loss, pose, point_of(track), rig_id_);
  s.in_graph = true;
}

bool StructurelessBuilder::extend_landmark(const States& states, std::uint32_t place, GraphEdit& edit) {
  Track& track = map_.track(place);
  bool changed = false;
  for (Sighting& s : track.sightings) {
    const VariableKey pose = states.find(poses_, s.time, kVariableOps<Pose3d>.key);
    if (s.in_graph || pose.key.generation == 0) continue;
    add_sighting(edit, track, s, {pose.key});
    staged_sightings_.emplace_back(place, s.time);
    changed = true;
  }
  return changed;
}

// What the edit would have changed is as it was; the same sightings are not tried again.
void StructurelessBuilder::refused() {
  for (const Staged& s : staged_) {
    const std::size_t tried = built_[s.place].tried;
    built_[s.place] = s.before;
    built_[s.place].tried = tried;
    map_.track(s.place).has_landmark = s.had_landmark;
  }
  for (const Staged& s : staged_)
    for (Sighting& seen : map_.track(s.place).sightings) seen.in_graph = seen.in_graph && s.had_landmark;
  for (const auto& [place, time] : staged_sightings_)
    for (Sighting& seen : map_.track(place).sightings) seen.in_graph = seen.in_graph && seen.time != time;
  staged_.clear();
  staged_sightings_.clear();
}

void StructurelessBuilder::before_slide(const Graph& graph, const States& states, std::span<const VariableKey> leaving,
                                        GraphEdit& edit) {
  for (const VariableKey& id : retired_)
    if (graph.find_value(id) != nullptr) edit.remove(id);
  retired_.clear();
  const State* newest = states.timeline(poses_).latest();
  if (options_.leaving != StructurelessOptions::Leaving::landmark || newest == nullptr) return;
  for (std::uint32_t place = 0; place < map_.extent(); ++place) {
    Track& track = map_.track(place);
    if (!track.live || track.has_landmark || built(place).factor.table == 0) continue;
    const bool seen = std::any_of(track.sightings.begin(), track.sightings.end(),
                                  [&](const Sighting& s) { return s.time == newest->time; });
    const bool left = std::any_of(track.sightings.begin(), track.sightings.end(), [&](const Sighting& s) {
      const VariableKey pose = states.find(poses_, s.time, kVariableOps<Pose3d>.key);
      return std::find(leaving.begin(), leaving.end(), pose) != leaving.end();
    });
    if (!seen || !left || !gather(graph, states, track)) continue;
    edit.remove(built(place).factor);
    make_landmark(place, edit);
  }
}

// The first sightings, which are in the prior, are used up.
void StructurelessBuilder::begin_anew(std::uint32_t place, std::size_t used) {
  Track& track = map_.track(place);
  used = std::min(used, track.sightings.size());
  track.sightings.erase(track.sightings.begin(), track.sightings.begin() + static_cast<std::ptrdiff_t>(used));
  track.has_landmark = false;
  built(place) = {track.id, {}, 0, 0};
}

// What a slide has left of a track's factor or landmark.
void StructurelessBuilder::settle(const Graph& graph, const States& states, std::uint32_t place) {
  Track& track = map_.track(place);
  Built& b = built(place);
  const bool point_left = track.has_landmark && graph.find_value(point_of(track)) == nullptr;
  const bool factor_left = b.factor.table != 0 && !graph.contains(b.factor);
  if (!point_left && !factor_left) return;
  const bool removed = std::all_of(track.sightings.begin(), track.sightings.end(), [&](const Sighting& s) {
    return states.timeline(poses_).find(s.time) != nullptr || was_removed(states, poses_, s.time);
  });
  const State* newest = states.timeline(poses_).latest();
  const bool seen = newest != nullptr && !track.sightings.empty() && track.sightings.back().time == newest->time;
  counts_.lost_correlations += seen && !removed ? 1 : 0;
  if (removed)
    for (Sighting& s : track.sightings) s.in_graph = false;
  else if (point_left)
    std::erase_if(track.sightings, [](const Sighting& s) { return s.in_graph; });
  begin_anew(place, removed || point_left ? 0 : b.sightings);
}

void StructurelessBuilder::after_slide(const Graph& graph, const States& states) {
  for (std::uint32_t place = 0; place < map_.extent(); ++place) {
    Track& track = map_.track(place);
    if (!track.live) continue;
    settle(graph, states, place);
    const std::size_t before = track.sightings.size();
    std::erase_if(track.sightings, [&](const Sighting& s) { return states.timeline(poses_).find(s.time) == nullptr; });
    if (track.sightings.size() != before) built(place).tried = 0;
    if (!track.sightings.empty()) continue;
    if (track.has_landmark) retired_.push_back(VariableKey(point_of(track)));
    map_.close(place);
  }
}

void StructurelessBuilder::reset() {
  map_.clear();
  retired_.clear();
  staged_.clear();
  staged_sightings_.clear();
  for (Built& b : built_) b = {};
}

FrameOverlap StructurelessBuilder::overlap(const Graph& graph, const States& states, Time earlier, Time later) const {
  const auto pose = [&](Time time) {
    return static_cast<const Pose3d*>(graph.find_value(states.find(poses_, time, kVariableOps<Pose3d>.key)));
  };
  const Pose3d *a = pose(earlier), *b = pose(later);
  return a == nullptr || b == nullptr ? FrameOverlap{} : overlap_of(map_, earlier, *a, later, *b, scratch_);
}

int StructurelessBuilder::factors() const {
  return static_cast<int>(
      std::count_if(built_.begin(), built_.end(), [](const Built& b) { return b.factor.table != 0; }));
}

}  // namespace oriel
