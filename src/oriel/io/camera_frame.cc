#include "oriel/io/camera_frame.h"

#include <cmath>

namespace oriel::io_detail {

void read_pinhole_radtan(YamlFields& fields, const CameraKeys& keys, RecordedCamera& camera) {
  std::vector<double> size, f, d;
  const bool has_size = !keys.resolution_may_lack || fields.has(keys.resolution);
  if (has_size) fields.numbers(keys.resolution, 2, size);
  fields.numbers(keys.intrinsics, 4, f);
  fields.numbers(keys.distortion, 4, d);
  if (!fields.ok()) return;
  if (!has_size) size = {0, 0};
  if (has_size && !(size[0] >= 1 && size[1] >= 1 && size[0] <= 1e6 && size[1] <= 1e6))
    return fields.fail(keys.resolution, "expected width and height of 1 px or more");
  if (!(f[0] > 0 && f[1] > 0)) return fields.fail(keys.intrinsics, "expected positive focal lengths [px]");
  camera.width = static_cast<int>(size[0]), camera.height = static_cast<int>(size[1]);
  camera.fx = f[0], camera.fy = f[1], camera.cx = f[2], camera.cy = f[3];
  camera.k1 = d[0], camera.k2 = d[1], camera.p1 = d[2], camera.p2 = d[3];
}

bool set_camera_frame(const std::vector<double>& rows, RecordedCamera& camera) {
  Mat3d R;
  std::size_t at = 0;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) R(i, j) = rows[at++];
    camera.p_body_camera[i] = rows[at++];
  }
  const double determinant = R.col(0).dot(cross(R.col(1), R.col(2)));
  if (!((R.transposed() * R - Mat3d::identity()).norm() < 1e-3) || !(determinant > 0)) return false;
  // Newton's iteration to the nearest orthogonal matrix (Higham 1986), R ← R·(3I − RᵀR)/2, squares the error. A matrix
  // that is a rotation to rounding is left as it is, so that writing and reading a recording keeps its bits.
  for (int k = 0; k < 4; ++k) {
    const Mat3d RtR = R.transposed() * R;
    if ((RtR - Mat3d::identity()).norm() < 1e-15) break;
    R = R * (0.5 * (3.0 * Mat3d::identity() - RtR));
  }
  camera.R_body_camera = R;
  return true;
}

}  // namespace oriel::io_detail
