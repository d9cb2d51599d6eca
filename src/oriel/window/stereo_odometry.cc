#include "oriel/window/stereo_odometry.h"

#include <algorithm>

#include "oriel/window/triangulate.h"

namespace oriel {
namespace {

constexpr double kLeastParallax = 0.006;  // [rad]: 20 m for a baseline of 0.11 m

bool earlier(const std::pair<std::int64_t, Vec3d>& p, std::int64_t track) { return p.first < track; }

}  // namespace

int StereoOdometry::add(const StereoFrame& frame, const Rot3d& turn) {
  const std::size_t before = points_.size();
  if (poses_.empty()) {
    triangulate_new(frame, Pose3d{});
    const int points = static_cast<int>(points_.size() - before);
    if (points >= least_points_)
      poses_.push_back({frame.time, Pose3d{}});
    else
      points_.clear();
    return points;
  }
  Pose3d T = poses_.back().T_world_body;
  T.R = (T.R * turn).normalized();
  sightings_.clear();
  for (const FeatureObservation& f : frame.features) {
    const auto at = std::lower_bound(points_.begin(), points_.end(), f.track, earlier);
    if (at != points_.end() && at->first == f.track)
      sightings_.push_back({at->second, f.pixel0, f.pixel1, f.has_right});
  }
  const RefinePoseReport report = find_pose(sightings_, rig_, least_points_, T, work_);
  if (!agrees(report, least_points_)) return 0;
  triangulate_new(frame, T);
  poses_.push_back({frame.time, T});
  return report.inliers;
}

void StereoOdometry::triangulate_new(const StereoFrame& frame, const Pose3d& T_world_body) {
  for (const FeatureObservation& f : frame.features) {
    if (!f.has_right) continue;
    const auto at = std::lower_bound(points_.begin(), points_.end(), f.track, earlier);
    if (at != points_.end() && at->first == f.track) continue;
    Ray rays[2];
    const Vec2d pixels[2] = {f.pixel0, f.pixel1};
    bool fits = true;
    for (int c = 0; c < 2 && fits; ++c) {
      const Result<Vec2d> b = rig_.cameras[c].camera.unproject(pixels[c]);
      fits = b.ok();
      if (fits)
        rays[c] = {rig_.cameras[c].t_body_camera, rig_.cameras[c].R_body_camera * Vec3d{{(*b)[0], (*b)[1], 1.0}}};
    }
    if (!fits) continue;
    const std::optional<Vec3d> p_body = triangulate(rays, kLeastParallax);
    if (!p_body || rays[0].direction.dot(*p_body - rays[0].origin) <= 0.0) continue;
    points_.insert(at, {f.track, T_world_body * *p_body});
  }
}

}  // namespace oriel
