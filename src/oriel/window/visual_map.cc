#include "oriel/window/visual_map.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <string>

namespace oriel {
namespace {

constexpr double kRounding = 1e-9;

template <int R, int C>
bool finite(const Mat<double, R, C>& a) {
  for (int i = 0; i < R * C; ++i)
    if (!std::isfinite(a[i])) return false;
  return true;
}

// Symmetric to the bit (files hold a triangle), with pivots that are not negative beyond rounding.
template <int N>
bool is_covariance(Mat<double, N, N> a) {
  if (!finite(a)) return false;
  double diagonal[N];
  for (int i = 0; i < N; ++i) {
    diagonal[i] = a(i, i);
    if (diagonal[i] < 0.0) return false;
    for (int j = 0; j < i; ++j)
      if (a(i, j) != a(j, i)) return false;
  }
  for (int i = 0; i < N; ++i) {
    const double tolerance = kRounding * diagonal[i], pivot = a(i, i);
    if (pivot < -tolerance) return false;
    if (pivot <= tolerance) continue;
    for (int j = i + 1; j < N; ++j)
      for (int k = i + 1; k < N; ++k) a(j, k) -= a(j, i) * a(i, k) / pivot;
  }
  return true;
}

bool is_pose(const Pose3d& T) {
  const Vec4d q = {{T.R.qw, T.R.qx, T.R.qy, T.R.qz}};
  return finite(T.t) && finite(q) && std::fabs(q.squared_norm() - 1.0) < 1e-6;
}

class Checker {
 public:
  Checker(const VisualMap& map, MapFault* where) : map_(map), where_(where) {}
  Result<void> operator()() {
    if (!lengths()) return Error{ErrorCode::size_mismatch, "visual map: expected columns of one length"};
    for (std::uint32_t i = 0; i < map_.rigs.size(); ++i)
      if (!rig(map_.rigs[i])) return wrong(MapGroup::rig, i, "finite numbers");
    for (std::uint32_t i = 0; i < map_.frames.size(); ++i)
      if (const char* expected = frame(i)) return wrong(MapGroup::frame, i, expected);
    if (!ends_with_last_frame()) return wrong(MapGroup::observation, covered_, "an observation of a frame");
    for (std::uint32_t i = 0; i < map_.points.size(); ++i)
      if (const char* expected = point(i)) return wrong(MapGroup::point, i, expected);
    for (std::uint32_t i = 0; i < map_.observations.size(); ++i)
      if (const char* expected = observation(i)) return wrong(MapGroup::observation, i, expected);
    return {};
  }

 private:
  Error wrong(MapGroup group, std::uint32_t row, const char* expected) const {
    constexpr const char* kNames[] = {"rig", "frame", "point", "observation"};
    if (where_ != nullptr) *where_ = {group, row};
    return {ErrorCode::bad_input, std::string("visual map: ") + kNames[static_cast<std::size_t>(group)] + " " +
                                      std::to_string(row) + ": expected " + expected};
  }
  static bool same(std::size_t n, std::initializer_list<std::size_t> sizes) {
    for (const std::size_t s : sizes)
      if (s != n) return false;
    return n < kNoRow;
  }
  bool lengths() const {
    const auto& f = map_.frames;
    const auto& p = map_.points;
    const auto& o = map_.observations;
    return same(f.time.size(), {f.T_world_body.size(), f.covariance.size(), f.previous.size(), f.rig.size(),
                                f.status.size(), f.first.size(), f.count.size()}) &&
           same(p.track.size(), {p.p.size(), p.covariance.size(), p.frame.size(), p.sightings.size()}) &&
           same(o.frame.size(),
                {o.point.size(), o.track.size(), o.has_right.size(), o.inlier.size(), o.pixel0.size(), o.pixel1.size(),
                 o.covariance0.size(), o.covariance1.size(), o.p_camera.size(), o.covariance.size()});
  }
  static bool rig(const StereoRigd& r) {
    for (const auto& c : r.cameras) {
      const auto& k = c.camera;
      const Vec<double, 8> numbers = {{k.fx, k.fy, k.cx, k.cy, k.k1, k.k2, k.p1, k.p2}};
      if (!finite(numbers) || !finite(c.R_body_camera) || !finite(c.t_body_camera)) return false;
    }
    return true;
  }
  // What was expected, or null.
  const char* frame(std::uint32_t i) {
    const auto& f = map_.frames;
    if (i > 0 && f.time[i] <= f.time[i - 1]) return "a later stamp than the frame before";
    if (!is_pose(f.T_world_body[i])) return "a finite pose with a unit quaternion";
    if (!is_covariance(f.covariance[i])) return "a covariance";
    if (f.previous[i] != kNoRow && f.previous[i] >= i) return "a previous frame before it";
    if (f.rig[i] >= map_.rigs.size()) return "a rig that is there";
    if (static_cast<int>(f.status[i]) >= kFrameStatuses) return "a status that there is";
    if (f.first[i] != covered_ || f.count[i] > map_.observations.size() - covered_)
      return "observations that follow those of the frame before";
    covered_ += f.count[i];
    return nullptr;
  }
  bool ends_with_last_frame() const { return covered_ == map_.observations.size(); }
  const char* point(std::uint32_t i) const {
    const auto& p = map_.points;
    if (!finite(p.p[i])) return "a finite position";
    if (!is_covariance(p.covariance[i])) return "a covariance";
    if (p.frame[i] != kNoRow && p.frame[i] >= map_.frames.size()) return "a frame that is there";
    return nullptr;
  }
  const char* observation(std::uint32_t i) const {
    const auto& o = map_.observations;
    const std::uint32_t f = o.frame[i];
    if (f >= map_.frames.size() || i < map_.frames.first[f] || i - map_.frames.first[f] >= map_.frames.count[f])
      return "the frame that lists it";
    if (o.point[i] != kNoRow && o.point[i] >= map_.points.size()) return "a point that is there";
    if (o.point[i] != kNoRow && map_.points.track[o.point[i]] != o.track[i]) return "a point of its own track";
    if (o.has_right[i] > 1 || o.inlier[i] > 1) return "flags of 0 or 1";
    if (!finite(o.pixel0[i]) || !finite(o.pixel1[i]) || !finite(o.p_camera[i])) return "finite numbers";
    if (!is_covariance(o.covariance0[i]) || !is_covariance(o.covariance1[i]) || !is_covariance(o.covariance[i]))
      return "covariances";
    return nullptr;
  }

  const VisualMap& map_;
  MapFault* where_;
  std::uint32_t covered_ = 0;  // observations of the frames so far
};

// The nearest anchored frames about frame k: two of them, the earlier first; fewer only where there are no more.
struct Anchors {
  std::uint32_t a = kNoRow, b = kNoRow;
};
Anchors anchors_of(const std::vector<std::uint32_t>& anchored, std::uint32_t k) {
  const std::size_t n = anchored.size();
  if (n == 1) return {anchored[0], kNoRow};
  const auto after = static_cast<std::size_t>(std::lower_bound(anchored.begin(), anchored.end(), k) - anchored.begin());
  const std::size_t b = std::min(std::max<std::size_t>(after, 1), n - 1);
  return {anchored[b - 1], anchored[b]};
}

}  // namespace

std::string_view name_of(FrameStatus status) {
  constexpr std::string_view kNames[kFrameStatuses] = {"pending", "origin",       "solved", "held",
                                                       "few",     "no_agreement", "failed"};
  return kNames[static_cast<std::size_t>(status)];
}

Result<void> VisualMap::check(MapFault* where) const { return Checker(*this, where)(); }

std::uint32_t VisualMap::add_frame(Time time, const Pose3d& T_world_body, std::uint32_t rig) {
  const std::uint32_t row = frames.size();
  frames.time.push_back(time);
  frames.T_world_body.push_back(T_world_body);
  frames.covariance.push_back(Mat6d::zero());
  frames.previous.push_back(kNoRow);
  frames.rig.push_back(rig);
  frames.status.push_back(FrameStatus::pending);
  frames.first.push_back(observations.size());
  frames.count.push_back(0);
  return row;
}

std::uint32_t VisualMap::add_observation(const Observation& o) {
  MapObservations& c = observations;
  const std::uint32_t row = c.size();
  c.frame.push_back(frames.size() - 1);
  c.point.push_back(kNoRow);
  c.track.push_back(o.track);
  c.has_right.push_back(o.has_right ? 1 : 0);
  c.inlier.push_back(0);
  c.pixel0.push_back(o.pixel0);
  c.pixel1.push_back(o.pixel1);
  c.covariance0.push_back(o.covariance0);
  c.covariance1.push_back(o.covariance1);
  c.p_camera.push_back(o.p_camera);
  c.covariance.push_back(o.covariance);
  ++frames.count.back();
  return row;
}

std::uint32_t VisualMap::add_point(std::int64_t track, const Vec3d& p, const Mat3d& covariance, std::uint32_t frame) {
  const std::uint32_t row = points.size();
  points.track.push_back(track);
  points.p.push_back(p);
  points.covariance.push_back(covariance);
  points.frame.push_back(frame);
  points.sightings.push_back(1);
  return row;
}

Pose3d interpolated(Time t, Time t_a, const Pose3d& T_a, Time t_b, const Pose3d& T_b) {
  const double s = static_cast<double>((t - t_a).ns) / static_cast<double>((t_b - t_a).ns);
  return T_a.plus((T_a.inverse() * T_b).log() * s);
}

int interpolate_poses(MapFrames& frames) {
  std::vector<std::uint32_t> anchored;
  for (std::uint32_t k = 0; k < frames.size(); ++k)
    if (is_anchored(frames.status[k])) anchored.push_back(k);
  if (anchored.empty()) return 0;
  int set = 0;
  for (std::uint32_t k = 0; k < frames.size(); ++k) {
    if (is_anchored(frames.status[k])) continue;
    const auto [a, b] = anchors_of(anchored, k);
    frames.T_world_body[k] = b == kNoRow ? frames.T_world_body[a]
                                         : interpolated(frames.time[k], frames.time[a], frames.T_world_body[a],
                                                        frames.time[b], frames.T_world_body[b]);
    ++set;
  }
  return set;
}

}  // namespace oriel
