#include "oriel/window/track_geometry.h"

#include <algorithm>
#include <cmath>

#include "oriel/window/refine_pose.h"

namespace oriel {
namespace {

using Mount = MountedCamera<double, RadTanCamera>;

Ray ray_of(const Pose3d& T_world_body, const Mount& mount, const Vec2d& bearing) {
  return {T_world_body * mount.t_body_camera,
          T_world_body.R * (mount.R_body_camera * Vec3d{{bearing[0], bearing[1], 1.0}})};
}

const Sighting* sighting_at(const Track& track, Time time) {
  for (const Sighting& s : track.sightings)
    if (s.time == time) return &s;
  return nullptr;
}

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

std::optional<Vec3d> TrackGeometry::locate(std::span<const PlacedSighting> seen) {
  rays_.clear();
  for (const PlacedSighting& p : seen) {
    rays_.push_back(ray_of(p.T_world_body, rig_.cameras[0], p.sighting->bearing));
    if (p.sighting->has_right) rays_.push_back(ray_of(p.T_world_body, rig_.cameras[1], p.sighting->bearing1));
  }
  if (rays_.size() < 2) return std::nullopt;
  const std::optional<Vec3d> p_world = triangulate(rays_, limits_.least_parallax);
  if (!p_world) return std::nullopt;
  const double d = depth(seen.front().T_world_body, *p_world);
  if (!(d >= limits_.least_depth && d <= limits_.greatest_depth)) return std::nullopt;
  for (const PlacedSighting& p : seen)
    if (!(error(p.T_world_body, *p.sighting, *p_world) <= limits_.start_gate)) return std::nullopt;
  return p_world;
}

double TrackGeometry::depth(const Pose3d& T, const Vec3d& p_world) const {
  const Vec3d p_body = T.R.inverse() * (p_world - T.t);
  return transposed_times(rig_.cameras[0].R_body_camera, p_body - rig_.cameras[0].t_body_camera)[2];
}

Vec3d TrackGeometry::point_on(const Pose3d& T, const Vec2d& bearing, double rho) const {
  const Ray ray = ray_of(T, rig_.cameras[0], bearing);
  return ray.origin + ray.direction / rho;
}

double TrackGeometry::error(const Pose3d& T, const Sighting& s, const Vec3d& p_world) const {
  return error_at({p_world, s.pixel0, s.pixel1, s.has_right}, rig_, T);
}

// What follows a marginalized state is severed from it.
bool was_removed(const States& states, ProviderId provider, Time time) {
  const Timeline<State>& line = states.timeline(provider);
  const State* next = line.at_or_after(time);
  return next != nullptr ? !next->severed : !line.empty();
}

FrameOverlap overlap_of(const TrackMap& map, Time earlier, const Pose3d& T_world_earlier, Time later,
                        const Pose3d& T_world_later, std::vector<double>& scratch) {
  FrameOverlap overlap;
  scratch.clear();
  for (std::uint32_t k = 0; k < map.extent(); ++k) {
    const Track& t = map.track(k);
    const Sighting* b = t.live ? sighting_at(t, later) : nullptr;
    if (b == nullptr) continue;
    ++overlap.tracks;
    const Sighting* a = sighting_at(t, earlier);
    if (a == nullptr) continue;
    const Mount& mount = map.rig().cameras[0];
    const Vec3d u = ray_of(T_world_earlier, mount, a->bearing).direction;
    const Vec3d v = ray_of(T_world_later, mount, b->bearing).direction;
    scratch.push_back(std::atan2(cross(u, v).norm(), u.dot(v)));
  }
  overlap.shared = static_cast<int>(scratch.size());
  if (!scratch.empty()) overlap.parallax = median(scratch);
  return overlap;
}

double track_motion(const TrackMap& map, Time earlier, Time later, std::vector<double>& scratch) {
  scratch.clear();
  for (std::uint32_t k = 0; k < map.extent(); ++k) {
    const Track& t = map.track(k);
    const Sighting* b = t.live ? sighting_at(t, later) : nullptr;
    const Sighting* a = b != nullptr ? sighting_at(t, earlier) : nullptr;
    if (a != nullptr) scratch.push_back((b->pixel0 - a->pixel0).norm());
  }
  return scratch.empty() ? -1.0 : median(scratch);
}

}  // namespace oriel
