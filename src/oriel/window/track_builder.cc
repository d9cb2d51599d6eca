#include "oriel/window/track_builder.h"

#include <algorithm>

#include "oriel/residual/reprojection.h"

namespace oriel {
namespace {

const Pose3d* pose_at(const Graph& graph, const States& states, ProviderId poses, Time time) {
  const VariableKey id = states.find(poses, time, kVariableOps<Pose3d>.key);
  return static_cast<const Pose3d*>(graph.find_value(id));
}

}  // namespace

TrackBuilder::TrackBuilder(ProviderId poses, const StereoRigd& rig, VariableId<StereoRigd> rig_id,
                           const TrackBuilderOptions& options)
    : poses_(poses), rig_id_(rig_id), options_(options), geometry_(rig, options.limits), map_(rig, options.stereo) {
  map_.reserve(options.expected_tracks, options.expected_states);
  in_flight_.reserve(options.expected_tracks);
  retired_.reserve(options.expected_tracks);
  seen_.reserve(options.expected_tracks);
  scratch_.reserve(options.expected_tracks);
  placed_.reserve(options.expected_states);
}

void TrackBuilder::add(const StereoFrame& frame) {
  if (waiting_ == frames_.size()) frames_.emplace_back();
  frames_[waiting_].time = frame.time;
  frames_[waiting_++].features.assign(frame.features.begin(), frame.features.end());
}

void TrackBuilder::drain(const Graph& graph, const States& states, PendingFactors& pending) {
  for (std::size_t k = 0; k < waiting_; ++k) hand(graph, states, frames_[k], pending);
  waiting_ = 0;
}

void TrackBuilder::hand(const Graph& graph, const States& states, const Frame& frame, PendingFactors& pending) {
  if (map_.has_seen(frame.time)) {
    ++counts_.repeated;
    return;
  }
  counts_.no_ray += map_.observe({frame.time, frame.features}, {}, seen_);
  in_flight_.resize(std::max<std::size_t>(in_flight_.size(), map_.extent()));
  filling_ = &free_sent();
  filling_->number = pending.begin();
  filling_->time = frame.time;
  filling_->starts.clear();
  filling_->factors.clear();
  pending.need(At<Pose3d>{poses_, frame.time});
  for (std::uint32_t place = 0; place < map_.extent(); ++place) {
    Track& t = map_.track(place);
    if (!t.live) continue;
    if (t.has_landmark && graph.find_value(key_of(t)) == nullptr) begin_anew(t);  // a hook or the user took it out
    if (t.has_landmark)
      extend(states, t, pending);
    else if (!in_flight(place))
      start(graph, states, place, pending);
  }
  pending.end();
  filling_ = nullptr;
}

// A state that is there, or that a group which has not been settled makes.
bool TrackBuilder::has_state(const States& states, Time time) const {
  if (states.timeline(poses_).find(time) != nullptr) return true;
  return std::any_of(sent_.begin(), sent_.end(), [time](const Sent& s) { return s.number != 0 && s.time == time; });
}

// The sightings that came since its landmark started.
void TrackBuilder::extend(const States& states, Track& track, PendingFactors& pending) {
  for (Sighting& s : track.sightings)
    if (!s.in_graph && has_state(states, s.time)) add_factor(pending, key_of(track), track, s);
}

void TrackBuilder::start(const Graph& graph, const States& states, std::uint32_t place, PendingFactors& pending) {
  Track& track = map_.track(place);
  if (track.sightings.size() < 2) return;
  placed_.clear();
  for (const Sighting& s : track.sightings)
    if (const Pose3d* pose = pose_at(graph, states, poses_, s.time)) placed_.push_back({*pose, &s});
  const Sighting& anchor = track.sightings.front();
  if (placed_.empty() || placed_.front().sighting != &anchor) return;
  const std::optional<Vec3d> p_world = geometry_.locate(placed_);
  if (!p_world) return;
  const double depth = geometry_.depth(placed_.front().T_world_body, *p_world);
  const VariableKey landmark = options_.landmarks == LandmarkKind::point
                                   ? VariableKey(pending.add(Point3d{*p_world}))
                                   : VariableKey(pending.add(InverseDepthd{1.0 / depth}));
  for (Sighting& s : track.sightings)
    if (has_state(states, s.time)) add_factor(pending, landmark, track, s);
  in_flight_[place] = {track.id, filling_->number};
  filling_->starts.push_back(track.id);
  ++counts_.started;
}

void TrackBuilder::add_factor(PendingFactors& pending, VariableKey landmark, const Track& track, Sighting& s) {
  s.in_graph = true;
  ++counts_.handed;
  const Sighting& anchor = track.sightings.front();
  const bool anchored = options_.landmarks == LandmarkKind::inverse_depth;
  if (anchored && &s == &anchor && !s.has_right) return;  // its bearing is what the others are measured against
  filling_->factors.push_back({track.id, s.time});
  if (anchored)
    add_anchored(pending, {landmark.key}, anchor, s);
  else
    add_point(pending, {landmark.key}, s);
}

void TrackBuilder::add_anchored(PendingFactors& pending, VariableId<InverseDepthd> landmark, const Sighting& anchor,
                                const Sighting& s) {
  const IsotropicNoise noise = Sigma(options_.pixel_sigma);
  const At<Pose3d> a{poses_, anchor.time}, b{poses_, s.time};
  if (&s == &anchor)
    pending.add(AnchorReprojectiond{anchor.bearing, s.pixel1}, noise, options_.loss, landmark, rig_id_);
  else if (s.has_right)
    pending.add(StereoReprojectiond{anchor.bearing, s.pixel0, s.pixel1}, noise, options_.loss, a, b, landmark, rig_id_);
  else
    pending.add(MonoReprojectiond{anchor.bearing, s.pixel0}, noise, options_.loss, a, b, landmark, rig_id_);
}

void TrackBuilder::add_point(PendingFactors& pending, VariableId<Point3d> landmark, const Sighting& s) {
  const IsotropicNoise noise = Sigma(options_.pixel_sigma);
  const At<Pose3d> b{poses_, s.time};
  if (s.has_right)
    pending.add(StereoPointReprojectiond{s.pixel0, s.pixel1}, noise, options_.loss, b, landmark, rig_id_);
  else
    pending.add(MonoPointReprojectiond{s.pixel0}, noise, options_.loss, b, landmark, rig_id_);
}

void TrackBuilder::entered(std::uint64_t group, std::span<const VariableKey> variables,
                           std::span<const FactorId> factors) {
  Sent* found = sent_of(group);
  if (found == nullptr) {  // the window began anew with this group, and its tracks are forgotten
    retired_.insert(retired_.end(), variables.begin(), variables.end());
    return;
  }
  Sent& sent = *found;
  for (std::size_t k = 0; k < sent.starts.size(); ++k) {
    const std::uint32_t place = map_.find(sent.starts[k]);
    if (place == map_.extent()) continue;
    map_.track(place).landmark = {variables[k].key};
    map_.track(place).has_landmark = true;
    in_flight_[place] = {};
  }
  for (std::size_t k = 0; k < sent.factors.size(); ++k) {
    const std::uint32_t place = map_.find(sent.factors[k].track);
    if (place == map_.extent()) continue;
    for (Sighting& s : map_.track(place).sightings)
      if (s.time == sent.factors[k].time) s.factor = factors[k];
  }
  sent.number = 0;
}

// Its sightings are spent all the same: who refused them had a reason.
void TrackBuilder::refused(std::uint64_t group) {
  Sent* found = sent_of(group);
  if (found == nullptr) return;
  Sent& sent = *found;
  counts_.refused += static_cast<std::int64_t>(sent.factors.size());
  for (const std::int64_t id : sent.starts) {
    const std::uint32_t place = map_.find(id);
    if (place == map_.extent()) continue;
    in_flight_[place] = {};
    begin_anew(map_.track(place));
  }
  map_.forget(sent.time);
  sent.number = 0;
}

void TrackBuilder::begin_anew(Track& track) {
  track.has_landmark = false;
  std::erase_if(track.sightings, [](const Sighting& s) { return s.in_graph; });
  ++counts_.closed;
}

void TrackBuilder::retire(const Track& track) {
  if (track.has_landmark) retired_.push_back(key_of(track));
}

Vec3d TrackBuilder::position(const Graph& graph, const States& states, const Track& track) const {
  if (options_.landmarks == LandmarkKind::point) return graph.value(VariableId<Point3d>{track.landmark.key}).p;
  const Sighting& anchor = track.sightings.front();
  return geometry_.point_on(*pose_at(graph, states, poses_, anchor.time), anchor.bearing,
                            graph.value(track.landmark).rho);
}

void TrackBuilder::before_slide(const Graph& graph, const States& states, std::span<const VariableKey>,
                                GraphEdit& edit) {
  for (const VariableKey& id : retired_)
    if (graph.find_value(id) != nullptr) edit.remove(id);  // what it tied together stays tied: priors keep that
  retired_.clear();
  for (std::uint32_t place = 0; place < map_.extent() && options_.gate > 0.0; ++place) {
    Track& t = map_.track(place);
    if (t.live && t.has_landmark && graph.find_value(key_of(t)) != nullptr) gate(graph, states, t, edit);
  }
}

// A prior or somebody else's factor knows its landmark besides its sightings.
bool TrackBuilder::has_other_factors(const Graph& graph, const Track& track) const {
  std::size_t factors = 0, sightings = 0;
  graph.for_each_factor(key_of(track), [&](std::uint32_t, std::uint32_t) { ++factors; });
  for (const Sighting& s : track.sightings) sightings += s.in_graph && graph.contains(s.factor) ? 1 : 0;
  return factors > sightings;
}

// Sightings that are too far off leave, and landmarks that are left without support, or lie where none can be. One
// camera's only sighting leaves a point's depth open, and says nothing of the pose.
void TrackBuilder::gate(const Graph& graph, const States& states, Track& track, GraphEdit& edit) {
  const Pose3d* first = pose_at(graph, states, poses_, track.sightings.front().time);
  if (first == nullptr) return;
  const Vec3d p = position(graph, states, track);
  const double depth = geometry_.depth(*first, p);
  bool good = depth >= options_.limits.least_depth && depth <= 10.0 * options_.limits.greatest_depth;
  const bool points = options_.landmarks == LandmarkKind::point;
  int left = 0, rays = 0;
  for (std::size_t k = 0; good && k < track.sightings.size(); ++k) {
    Sighting& s = track.sightings[k];
    const Pose3d* pose = s.in_graph ? pose_at(graph, states, poses_, s.time) : nullptr;
    if (pose == nullptr) continue;
    const bool anchor = k == 0 && !points;
    if (geometry_.error(*pose, s, p) <= options_.gate) {
      left += anchor && !s.has_right ? 0 : 1;
      rays += s.has_right ? 2 : 1;
    } else if (anchor) {
      good = false;  // all others are measured against it
    } else if (graph.contains(s.factor)) {
      edit.remove(s.factor);
      ++counts_.gated;
    }
  }
  if (good && left > 0 && (!points || rays > 1 || has_other_factors(graph, track))) return;
  edit.remove(key_of(track));
  begin_anew(track);
}

void TrackBuilder::after_slide(const Graph& graph, const States& states) {
  for (std::uint32_t place = 0; place < map_.extent(); ++place) {
    Track& t = map_.track(place);
    if (!t.live) continue;
    if (t.has_landmark && graph.find_value(key_of(t)) == nullptr) {
      if (only_removed(states, t))
        for (Sighting& s : t.sightings) s.in_graph = false;
      begin_anew(t);
    }
    const bool anchor_left = options_.landmarks == LandmarkKind::inverse_depth && t.has_landmark &&
                             !has_state(states, t.sightings.front().time);
    if (anchor_left) {
      retire(t);
      begin_anew(t);
    }
    std::erase_if(t.sightings, [&](const Sighting& s) { return !has_state(states, s.time); });
    if (!t.sightings.empty()) continue;
    retire(t);
    map_.close(place);
  }
}

// All of its states that are missing were removed: its landmark went with them, and nothing of it is in a prior.
bool TrackBuilder::only_removed(const States& states, const Track& track) const {
  return std::all_of(track.sightings.begin(), track.sightings.end(), [&](const Sighting& s) {
    return has_state(states, s.time) || was_removed(states, poses_, s.time);
  });
}

void TrackBuilder::reset() {
  map_.clear();
  retired_.clear();
  for (Sent& s : sent_) s.number = 0;
}

FrameOverlap TrackBuilder::overlap(const Graph& graph, const States& states, Time earlier, Time later) const {
  const Pose3d *a = pose_at(graph, states, poses_, earlier), *b = pose_at(graph, states, poses_, later);
  if (a == nullptr || b == nullptr) return {};
  return overlap_of(map_, earlier, *a, later, *b, scratch_);
}

bool TrackBuilder::in_flight(std::uint32_t place) const {
  const InFlight& f = in_flight_[place];
  return f.group != 0 && f.track == map_.track(place).id &&
         std::any_of(sent_.begin(), sent_.end(), [&](const Sent& s) { return s.number == f.group; });
}

// A track has room for the key of an inverse depth; a point's is kept there too.
VariableKey TrackBuilder::key_of(const Track& track) const {
  return options_.landmarks == LandmarkKind::point ? VariableKey(VariableId<Point3d>{track.landmark.key})
                                                   : VariableKey(track.landmark);
}

TrackBuilder::Sent& TrackBuilder::free_sent() {
  for (Sent& s : sent_)
    if (s.number == 0) return s;
  return sent_.emplace_back();
}

TrackBuilder::Sent* TrackBuilder::sent_of(std::uint64_t group) {
  for (Sent& s : sent_)
    if (s.number == group) return &s;
  return nullptr;
}

}  // namespace oriel
