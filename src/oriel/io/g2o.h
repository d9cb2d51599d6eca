// Pose graphs in g2o's text format: VERTEX_SE2, EDGE_SE2, VERTEX_SE3:QUAT, EDGE_SE3:QUAT and FIX, in any order.
//
//   VERTEX_SE2 id x y theta                       [m m rad]
//   EDGE_SE2 from to dx dy dtheta I11 I12 I13 I22 I23 I33
//   VERTEX_SE3:QUAT id x y z qx qy qz qw          [m], Hamilton
//   EDGE_SE3:QUAT from to dx dy dz qx qy qz qw + 21 entries of the information, order x y z, rx ry rz
//   FIX id...
//
// The information (upper triangle, row by row) refers to g2o's own error: translation and angle in 2D, translation and
// vector part of the quaternion in 3D (about half the angle; data conventions: docs/conventions.md).
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "oriel/base/matrix.h"
#include "oriel/base/result.h"

namespace oriel {

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

  std::string file_name;
  bool is_3d = false;
  bool has_vertices = false;               // false: no VERTEX line; the poses are those that edges name, values unknown
  std::vector<std::int64_t> ids;           // of the poses, ascending; the index of a pose is its place in here
  std::vector<std::int64_t> pose_lines;    // where each was declared; empty without VERTEX lines
  std::vector<Vec3d> planar_poses;         // [x m, y m, theta rad]; 2D with VERTEX lines, else empty
  std::vector<SpatialPose> spatial_poses;  // 3D with VERTEX lines, else empty
  std::vector<PlanarEdge> planar_edges;    // as in the file: repeated pairs and to < from stay
  std::vector<SpatialEdge> spatial_edges;
  std::vector<std::int32_t> fixed;       // indices, ascending, each once
  std::int64_t self_edges_left_out = 0;  // an edge from a pose to itself says nothing about it
};

Mat3d information_matrix(const PoseGraphFile::PlanarEdge& edge);
Mat6d information_matrix(const PoseGraphFile::SpatialEdge& edge);  // order x y z, rx ry rz

// Errors name file, line and what was expected: a tag that is none of the above, a wrong count of numbers, a NaN, a
// word, an id that is negative, too large, declared twice or not at all, a zero quaternion, indefinite information
// (positive semidefinite is fine), 2D and 3D in one file, no pose at all. Quaternions are normalised.
Result<PoseGraphFile> read_g2o(const std::string& path);
Result<PoseGraphFile> parse_g2o(std::string_view text, std::string file_name);

// Poses, FIX, edges; numbers in the shortest form that reads back to the same bits.
std::string format_g2o(const PoseGraphFile& graph);
Result<void> write_g2o(const std::string& path, const PoseGraphFile& graph);

}  // namespace oriel
