#include "oriel/window/landmark_builder.h"

#include <algorithm>
#include <cmath>

#include "oriel/residual/reprojection.h"

namespace oriel {
namespace {

Ray ray_of(const Pose3d& T_world_body, const MountedCamera<double, RadTanCamera>& mount, const Vec2d& bearing) {
  const Vec3d direction = mount.R_body_camera * Vec3d{{bearing[0], bearing[1], 1.0}};
  return {T_world_body * mount.t_body_camera, T_world_body.R * direction};
}

Vec3d in_camera(const Pose3d& T_world_body, const MountedCamera<double, RadTanCamera>& mount, const Vec3d& p_world) {
  const Vec3d p_body = T_world_body.R.inverse() * (p_world - T_world_body.t);
  return transposed_times(mount.R_body_camera, p_body - mount.t_body_camera);
}

Vec2d point_errors(const Pose3d& body, const Point3d& point, const StereoRigd& rig, const Sighting& s) {
  Vec2d left, right = Vec2d::zero(), errors = Vec2d::constant(HUGE_VAL);
  if (MonoPointReprojectiond{s.pixel0}.evaluate(body, point, rig, left, nullptr, nullptr)) errors[0] = left.norm();
  const MonoPointReprojection<double, 1> in_right{s.pixel1};
  if (!s.has_right || in_right.evaluate(body, point, rig, right, nullptr, nullptr)) errors[1] = right.norm();
  return errors;
}

}  // namespace

bool LandmarkBuilder::start(GraphEdit& edit, Track& track, bool at_rest) {
  if (track.sightings.size() < 2) return false;
  rays_.clear();
  poses_.clear();
  bool stereo = false;
  for (const Sighting& s : track.sightings) {
    const Pose3d& pose = poses_.emplace_back(edit.value(s.pose));
    rays_.push_back(ray_of(pose, rig_.cameras[0], s.bearing));
    if (s.has_right) rays_.push_back(ray_of(pose, rig_.cameras[1], s.bearing1));
    stereo = stereo || s.has_right;
  }
  if (at_rest && !stereo) return false;
  const std::optional<Vec3d> p_world =
      triangulate(rays_, stereo ? options_.least_parallax : options_.least_mono_parallax);
  if (!p_world) return false;
  const double depth = in_camera(poses_[0], rig_.cameras[0], *p_world)[2];
  if (!(depth >= options_.least_depth && depth <= options_.greatest_depth)) return false;
  for (std::size_t k = 0; k < poses_.size(); ++k) {
    const Vec2d e = errors_at(track.sightings[0].bearing, poses_[0], poses_[k], 1.0 / depth, track.sightings[k]);
    if (!(std::max(e[0], e[1]) <= options_.start_gate)) return false;
  }
  if (has_points())
    track.point = edit.add(Point3d{*p_world});
  else
    track.landmark = edit.add(InverseDepthd{1.0 / depth});
  track.has_landmark = true;
  for (Sighting& s : track.sightings) add_factor(edit, track, s);
  return true;
}

void LandmarkBuilder::remove(GraphEdit& edit, Track& track) const {
  if (has_points())
    edit.remove(track.point);
  else
    edit.remove(track.landmark);
  track.has_landmark = false;
  for (Sighting& s : track.sightings) s.in_graph = false;
}

void LandmarkBuilder::add_point_factor(GraphEdit& edit, Track& track, Sighting& s) const {
  const IsotropicNoise noise = Sigma(options_.pixel_sigma);
  if (s.has_right)
    s.factor =
        edit.add(StereoPointReprojectiond{s.pixel0, s.pixel1}, noise, options_.loss, s.pose, track.point, rig_id_);
  else
    s.factor = edit.add(MonoPointReprojectiond{s.pixel0}, noise, options_.loss, s.pose, track.point, rig_id_);
  s.in_graph = true;
}

void LandmarkBuilder::add_factor(GraphEdit& edit, Track& track, Sighting& s) const {
  if (has_points()) return add_point_factor(edit, track, s);
  const Sighting& anchor = track.sightings.front();
  const IsotropicNoise noise = Sigma(options_.pixel_sigma);
  const Loss& loss = options_.loss;
  if (&s == &anchor) {
    if (!s.has_right) return;
    s.factor = edit.add(AnchorReprojectiond{anchor.bearing, s.pixel1}, noise, loss, track.landmark, rig_id_);
  } else if (s.has_right) {
    s.factor = edit.add(StereoReprojectiond{anchor.bearing, s.pixel0, s.pixel1}, noise, loss, anchor.pose, s.pose,
                        track.landmark, rig_id_);
  } else {
    s.factor = edit.add(MonoReprojectiond{anchor.bearing, s.pixel0}, noise, loss, anchor.pose, s.pose, track.landmark,
                        rig_id_);
  }
  s.in_graph = true;
}

std::optional<Vec3d> LandmarkBuilder::position(const Graph& graph, const Track& track) const {
  const Sighting& anchor = track.sightings.front();
  const Pose3d* pose = graph.find(anchor.pose);
  if (pose == nullptr) return std::nullopt;  // the newest frame's own
  if (track.has_landmark && has_points()) return graph.value(track.point).p;
  const Ray ray = ray_of(*pose, rig_.cameras[0], anchor.bearing);
  if (track.has_landmark) return ray.origin + ray.direction / graph.value(track.landmark).rho;
  if (!anchor.has_right) return std::nullopt;
  const Ray rays[2] = {ray, ray_of(*pose, rig_.cameras[1], anchor.bearing1)};
  const std::optional<Vec3d> p = triangulate(rays, options_.least_parallax);
  return p && in_camera(*pose, rig_.cameras[0], *p)[2] > options_.least_depth ? p : std::nullopt;
}

double LandmarkBuilder::inverse_depth(const Graph& graph, const Track& track) const {
  if (!has_points()) return graph.value(track.landmark).rho;
  const Pose3d& anchor = graph.value(track.sightings.front().pose);
  return 1.0 / in_camera(anchor, rig_.cameras[0], graph.value(track.point).p)[2];
}

Vec2d LandmarkBuilder::errors(const Graph& graph, const Track& track, const Sighting& sighting) const {
  if (has_points()) return point_errors(graph.value(sighting.pose), graph.value(track.point), rig_, sighting);
  const Sighting& anchor = track.sightings.front();
  return errors_at(anchor.bearing, graph.value(anchor.pose), graph.value(sighting.pose),
                   graph.value(track.landmark).rho, sighting);
}

Vec2d LandmarkBuilder::errors_at(const Vec2d& anchor_bearing, const Pose3d& anchor, const Pose3d& body, double rho,
                                 const Sighting& s) const {
  Vec2d left, right = Vec2d::zero(), errors = Vec2d::constant(HUGE_VAL);
  const InverseDepthd depth{rho};
  const MonoReprojectiond in_left{anchor_bearing, s.pixel0};
  if (in_left.evaluate(anchor, body, depth, rig_, left, nullptr, nullptr, nullptr)) errors[0] = left.norm();
  const MonoReprojection<double, 1> in_right{anchor_bearing, s.pixel1};
  if (!s.has_right || in_right.evaluate(anchor, body, depth, rig_, right, nullptr, nullptr, nullptr))
    errors[1] = right.norm();
  return errors;
}

void LandmarkBuilder::forget_right(GraphEdit& edit, Track& track, Sighting& s) const {
  if (s.in_graph) edit.remove(s.factor);
  s.has_right = s.in_graph = false;
  add_factor(edit, track, s);
}

}  // namespace oriel
