#include "oriel/window/relocate.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "oriel/window/triangulate.h"

namespace oriel {
namespace {

constexpr int kTriples = 150;             // 1 - (1 - 0.33³)^150 = 0.996 that one is free of errors if a third is right
constexpr double kCut = 10.0;             // of an error: stereo depth is rough [px]
constexpr double kLeastParallax = 0.006;  // [rad]: 20 m for a baseline of 0.11 m
constexpr double kTolerance = 0.3;        // stereo depth is rough

double square(double x) { return x * x; }

std::optional<Vec3d> place_in_body(const PointSighting& s, const StereoRigd& rig) {
  if (!s.has_right) return std::nullopt;
  Ray rays[2];
  const Vec2d pixels[2] = {s.pixel0, s.pixel1};
  for (int c = 0; c < 2; ++c) {
    const Result<Vec2d> b = rig.cameras[c].camera.unproject(pixels[c]);
    if (!b) return std::nullopt;
    rays[c] = {rig.cameras[c].t_body_camera, rig.cameras[c].R_body_camera * Vec3d{{(*b)[0], (*b)[1], 1.0}}};
  }
  const std::optional<Vec3d> p = triangulate(rays, kLeastParallax);
  return p && rays[0].direction.dot(*p - rays[0].origin) > 0.0 ? p : std::nullopt;
}

// Orthonormal: along the first side, and normal to the plane.
std::optional<Mat3d> frame_of(const Vec3d p[3]) {
  const Vec3d u = p[1] - p[0], n = cross(u, p[2] - p[0]);
  if (!(n.norm() > 1e-3 * u.squared_norm()) || !(u.norm() > 0.0)) return std::nullopt;
  const Vec3d x = u / u.norm(), z = n / n.norm(), y = cross(z, x);
  Mat3d F;
  F.set_block(0, 0, x);
  F.set_block(0, 1, y);
  F.set_block(0, 2, z);
  return F;
}

// A short repeatable sequence (Knuth's MMIX constants).
struct Sequence {
  std::uint64_t state = 1;
  std::size_t below(std::size_t n) {
    state = state * 6364136223846793005u + 1442695040888963407u;
    return static_cast<std::size_t>((state >> 33) % n);
  }
};

}  // namespace

std::optional<Pose3d> lay_triangle(const Vec3d a[3], const Vec3d b[3], double tolerance) {
  for (int i = 0; i < 3; ++i) {
    const double la = (a[(i + 1) % 3] - a[i]).norm(), lb = (b[(i + 1) % 3] - b[i]).norm();
    if (!(std::fabs(la - lb) <= tolerance * la)) return std::nullopt;
  }
  const std::optional<Mat3d> A = frame_of(a), B = frame_of(b);
  if (!A || !B) return std::nullopt;
  const Rot3d R = Rot3d::from_matrix(*A * B->transposed());
  return Pose3d{R, a[0] - R * b[0]};
}

std::optional<Pose3d> relocate(std::span<const PointSighting> sightings, const StereoRigd& rig, int least_points,
                               PoseWorkspace& work) {
  auto& pairs = work.pairs;
  pairs.clear();
  for (const PointSighting& s : sightings)
    if (const std::optional<Vec3d> p = place_in_body(s, rig)) pairs.push_back({s.p_world, *p});
  if (pairs.size() < 3 || pairs.size() < static_cast<std::size_t>(least_points)) return std::nullopt;
  std::optional<Pose3d> best;
  double least = HUGE_VAL;
  Sequence random;
  for (int k = 0; k < kTriples; ++k) {
    Vec3d a[3], b[3];
    for (int i = 0; i < 3; ++i) {
      const PoseWorkspace::Pair& p = pairs[random.below(pairs.size())];
      a[i] = p.p_world;
      b[i] = p.p_body;
    }
    const std::optional<Pose3d> T = lay_triangle(a, b, kTolerance);
    if (!T) continue;
    double sum = 0.0;
    for (const PointSighting& s : sightings) sum += square(std::min(kCut, error_at(s, rig, *T)));
    if (!(sum < least)) continue;
    least = sum;
    best = T;
  }
  return best;
}

bool agrees(const RefinePoseReport& report, int least_points) {
  return report.solved && report.inliers >= least_points && 3 * report.inliers >= report.valid;
}

RefinePoseReport find_pose(std::span<const PointSighting> sightings, const StereoRigd& rig, int least_points,
                           Pose3d& T_world_body, PoseWorkspace& work) {
  const RefinePoseReport report = refine_pose(sightings, rig, {}, T_world_body, work.errors);
  if (agrees(report, least_points)) return report;
  std::optional<Pose3d> T = relocate(sightings, rig, least_points, work);
  if (!T) return report;
  const RefinePoseReport anew = refine_pose(sightings, rig, {}, *T, work.errors);
  if (!agrees(anew, least_points)) return report;
  T_world_body = *T;
  return anew;
}

}  // namespace oriel
