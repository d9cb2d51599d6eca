// Pose graphs, with landmarks where there are any, from text in three spellings, which are told by their tags. Lines
// stand in any order; blank lines and comments are passed over; what begins a comment is '#'.
//
// g2o: poses and landmarks share one range of ids.
//   VERTEX_SE2 id x y theta                       [m m rad]
//   VERTEX_XY id x y                              a landmark of the plane [m]
//   EDGE_SE2 from to dx dy dtheta + 6             + the upper triangle of the information, row by row
//   EDGE_SE2_XY pose landmark dx dy + 3           the landmark in the pose's frame
//   EDGE_BEARING_SE2_XY pose landmark angle + 1   [rad]
//   VERTEX_SE3:QUAT id x y z qx qy qz qw          [m], Hamilton
//   VERTEX_TRACKXYZ id x y z                      a landmark [m]
//   EDGE_SE3:QUAT from to dx dy dz qx qy qz qw + 21, order x y z, rx ry rz
//   PARAMS_SE3OFFSET id x y z qx qy qz qw         T_body_sensor, in a range of ids of its own
//   EDGE_SE3_TRACKXYZ pose landmark offset dx dy dz + 6   the landmark in the sensor's frame
//   FIX id...                                     poses or landmarks
//   The information of a 3D edge refers to g2o's own error: translation, and the vector part of the quaternion (about
//   half the angle; data conventions: docs/conventions.md).
// TORO (openslam.org/toro): VERTEX2 (or VERTEX), EDGE2 (or EDGE) with the information in the order ff fs ss rr fr sr
//   (forward, sideward, rotation), VERTEX3 id x y z roll pitch yaw, EDGE3 from to dx dy dz roll pitch yaw + 21.
// iSAM (its data/README): ODOMETRY or EDGE2 from to dx dy dtheta + 6, LANDMARK pose landmark dx dy + 3, EDGE3 as
// TORO's,
//   POINT3 pose landmark dx dy dz + 6. No vertices; landmarks have a range of ids of their own. What the last numbers
//   of a line are, files of this spelling do not agree on: see IsamNoise.
// R = Rz(yaw) Ry(pitch) Rx(roll). Angles of TORO and iSAM are whole ones: their information is brought to g2o's error.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "oriel/base/matrix.h"
#include "oriel/base/result.h"

namespace oriel {

enum class PoseGraphSpelling { g2o, toro, isam };

struct PoseGraphFile {
  struct SpatialPose {
    Vec3d t;                // [m]
    double qx, qy, qz, qw;  // of unit norm
  };
  struct PlanarEdge {
    std::int32_t from, to;              // indices into `ids`
    Vec3d measurement;                  // [dx m, dy m, dtheta rad] of `to` seen from `from`
    std::array<double, 6> information;  // 11 12 13 22 23 33
    std::int64_t line;                  // of the file, for messages
  };
  struct SpatialEdge {
    std::int32_t from, to;
    SpatialPose measurement;
    std::array<double, 21> information;  // 11 12 .. 16 22 .. 66
    std::int64_t line;
  };
  struct PlanarSighting {
    std::int32_t pose, landmark;        // indices into `ids` and `landmark_ids`
    Vec2d measurement;                  // [m], in the pose's frame
    std::array<double, 3> information;  // 11 12 22
    std::int64_t line;
  };
  struct PlanarBearing {
    std::int32_t pose, landmark;
    double measurement;                 // [rad]
    std::array<double, 1> information;  // [1/rad²]
    std::int64_t line;
  };
  struct SpatialSighting {
    std::int32_t pose, landmark;
    std::int32_t offset;                // index into `offsets`
    Vec3d measurement;                  // [m], in the sensor's frame
    std::array<double, 6> information;  // 11 12 13 22 23 33
    std::int64_t line;
  };
  struct SensorOffset {
    std::int64_t id;
    SpatialPose T_body_sensor;
    std::int64_t line;  // 0: not of the file, the sensor of iSAM's POINT3
  };

  std::string file_name;
  PoseGraphSpelling spelling = PoseGraphSpelling::g2o;
  bool is_3d = false;
  bool has_vertices = false;               // false: no VERTEX line; the poses are those that edges name, values unknown
  std::vector<std::int64_t> ids;           // of the poses, ascending; the index of a pose is its place in here
  std::vector<std::int64_t> pose_lines;    // where each was declared; empty without VERTEX lines
  std::vector<Vec3d> planar_poses;         // [x m, y m, theta rad]; 2D with VERTEX lines, else empty
  std::vector<SpatialPose> spatial_poses;  // 3D with VERTEX lines, else empty
  std::vector<PlanarEdge> planar_edges;    // as in the file: repeated pairs and to < from stay
  std::vector<SpatialEdge> spatial_edges;
  std::vector<std::int32_t> fixed;  // indices of poses, ascending, each once

  // Landmarks, by the same rules.
  std::vector<std::int64_t> landmark_ids, landmark_lines;
  std::vector<Vec2d> planar_landmarks;
  std::vector<Vec3d> spatial_landmarks;
  std::vector<PlanarSighting> planar_sightings;
  std::vector<PlanarBearing> planar_bearings;
  std::vector<SpatialSighting> spatial_sightings;
  std::vector<SensorOffset> offsets;  // ascending by id
  std::vector<std::int32_t> fixed_landmarks;

  std::int64_t self_edges_left_out = 0;       // an edge from a pose to itself says nothing about it
  std::int64_t information_repaired = 0;      // edges whose indefinite information was projected
  std::vector<std::int64_t> self_edge_lines;  // both by their lines
  std::vector<std::int64_t> repaired_lines;
};

Mat3d information_matrix(const PoseGraphFile::PlanarEdge& edge);
Mat6d information_matrix(const PoseGraphFile::SpatialEdge& edge);  // order x y z, rx ry rz

// iSAM's data/README says square roots (upper triangular, row by row). The public conversions of its files (city10000,
// sphere2500, torus, published optima included) and other readers take the same numbers for the information itself, and
// copies of victoria_park hold covariances; the text does not tell them apart.
enum class IsamNoise { information, root, covariance };

struct PoseGraphReading {
  bool project_information = false;  // indefinite information: repaired and counted, or else refused
  IsamNoise isam_noise = IsamNoise::information;
};

// Errors name file, line and what was expected: a tag that is none of the above, spellings mixed, a wrong count of
// numbers, a NaN, a word, an id that is negative, too large, declared twice or not at all (any VERTEX line: every end
// must have one), a zero quaternion, indefinite information with the edges that have it (positive semidefinite is
// fine), 2D and 3D in one file, no pose at all. Quaternions are normalised.
Result<PoseGraphFile> read_g2o(const std::string& path, const PoseGraphReading& reading = {});
Result<PoseGraphFile> parse_g2o(std::string_view text, std::string file_name, const PoseGraphReading& reading = {});

// In g2o's spelling: poses, landmarks, FIX, edges; numbers in the shortest form that reads back to the same bits.
std::string format_g2o(const PoseGraphFile& graph);
Result<void> write_g2o(const std::string& path, const PoseGraphFile& graph);

}  // namespace oriel
