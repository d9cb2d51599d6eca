// VisualMap: frames, points and observations with their covariances, as structure of arrays: what a pose is found from,
// what travels to a worker (run/transfer.h takes it as it is), and what a file holds (io/visual_map_file.h).
//
// Plain vectors: a row of a group is the same place in each of its columns. `check` says whether they fit together.
#pragma once
#include <cstdint>
#include <string_view>
#include <vector>

#include "oriel/base/result.h"
#include "oriel/base/time.h"
#include "oriel/manifold/se3.h"
#include "oriel/sensor/stereo_rig.h"

namespace oriel {

// What became of a frame. Its order is that of the words in a file.
enum class FrameStatus : std::uint8_t {
  pending,       // no pose was asked for yet
  origin,        // where a chain of poses begins
  solved,        // its pose was found
  held,          // too little in common with what came before: the motion was held, and the chain begins anew here
  few,           // fewer observations than a pose is found from; its pose is interpolated
  no_agreement,  // no pose agrees with enough of its observations; interpolated
  failed,        // the solve, or what ran it, failed; interpolated
};
inline constexpr int kFrameStatuses = 7;
std::string_view name_of(FrameStatus status);
// Its pose was found or decided on at its own time, and not made of its neighbours'.
constexpr bool is_anchored(FrameStatus s) {
  return s == FrameStatus::origin || s == FrameStatus::solved || s == FrameStatus::held;
}

// A place in a group, or none.
inline constexpr std::uint32_t kNoRow = ~std::uint32_t{0};

struct MapFrames {
  std::vector<Time> time;  // rising strictly
  std::vector<Pose3d> T_world_body;
  std::vector<Mat6d> covariance;        // of the pose given its `previous`, in the tangent on the right [rad] [m]
  std::vector<std::uint32_t> previous;  // the frame that it was found from, or kNoRow
  std::vector<std::uint32_t> rig;       // row of VisualMap::rigs
  std::vector<FrameStatus> status;
  std::vector<std::uint32_t> first, count;  // its observations: rows [first, first + count)

  std::uint32_t size() const { return static_cast<std::uint32_t>(time.size()); }
};

struct MapPoints {
  std::vector<std::int64_t> track;       // the tracker's name for it; several points may have been of one track
  std::vector<Vec3d> p;                  // [m], in the body frame of `frame`, or in world
  std::vector<Mat3d> covariance;         // [m²], in the same frame, given the poses
  std::vector<std::uint32_t> frame;      // whose coordinates; kNoRow: world
  std::vector<std::uint32_t> sightings;  // that it was made of

  std::uint32_t size() const { return static_cast<std::uint32_t>(track.size()); }
};

struct MapObservations {
  std::vector<std::uint32_t> frame, point;  // point: kNoRow where the track has none
  std::vector<std::int64_t> track;
  std::vector<std::uint8_t> has_right;          // the right camera saw it
  std::vector<std::uint8_t> inlier;             // agreed with the pose of its frame
  std::vector<Vec2d> pixel0, pixel1;            // [px] raw, left and right
  std::vector<Mat2d> covariance0, covariance1;  // of the pixels [px²]
  // Of what both cameras saw, in the left camera's coordinates: the point [m] and its covariance [m²] by propagation of
  // the pixels' (window/stereo_point.h). A covariance of zero: there is none.
  std::vector<Vec3d> p_camera;
  std::vector<Mat3d> covariance;

  std::uint32_t size() const { return static_cast<std::uint32_t>(frame.size()); }
  bool has_point(std::uint32_t row) const { return covariance[row](0, 0) > 0.0; }
  // Variance of the disparity u0 - u1 [px²].
  double disparity_variance(std::uint32_t row) const { return covariance0[row](0, 0) + covariance1[row](0, 0); }
};

enum class MapGroup : std::uint8_t { rig, frame, point, observation };
struct MapFault {
  MapGroup group = MapGroup::rig;
  std::uint32_t row = 0;
};

struct VisualMap {
  std::vector<StereoRigd> rigs;
  MapFrames frames;
  MapPoints points;
  MapObservations observations;

  // Columns of one length, rows that exist, stamps that rise, frames whose observations follow one another, numbers
  // that are finite, covariances that are positive semidefinite and symmetric to the bit. The first fault names group
  // and row, in words and in `where`.
  Result<void> check(MapFault* where = nullptr) const;

  // A new row; its observations follow by add_observation.
  std::uint32_t add_frame(Time time, const Pose3d& T_world_body, std::uint32_t rig);
  // Of the newest frame.
  struct Observation {
    std::int64_t track = 0;
    bool has_right = false;
    Vec2d pixel0 = Vec2d::zero(), pixel1 = Vec2d::zero();
    Mat2d covariance0 = Mat2d::identity(), covariance1 = Mat2d::identity();
    Vec3d p_camera = Vec3d::zero();
    Mat3d covariance = Mat3d::zero();
  };
  std::uint32_t add_observation(const Observation& o);
  std::uint32_t add_point(std::int64_t track, const Vec3d& p, const Mat3d& covariance, std::uint32_t frame);
  Vec3d p_world(std::uint32_t point) const {
    const std::uint32_t f = points.frame[point];
    return f == kNoRow ? points.p[point] : frames.T_world_body[f] * points.p[point];
  }
};

// Poses of frames that are not anchored, from the nearest anchored ones before and after by time, on the manifold:
// T(t) = T_a Exp(s Log(T_a⁻¹ T_b)), s = (t - t_a)/(t_b - t_a). Before the first and after the last the motion between
// the two nearest anchored frames is held; with one anchored frame its pose is. None: nothing changes. Returns how many
// poses were set.
int interpolate_poses(MapFrames& frames);
// The same at one time between, or beyond, two others.
Pose3d interpolated(Time t, Time t_a, const Pose3d& T_a, Time t_b, const Pose3d& T_b);

}  // namespace oriel
