#include "oriel/window/triangulate.h"

#include <algorithm>
#include <cmath>

namespace oriel {
namespace {

// A x = b for symmetric positive definite A, by its adjugate.
std::optional<Vec3d> solve(const Mat3d& A, const Vec3d& b) {
  const Vec3d r0 = cross(A.col(1), A.col(2)), r1 = cross(A.col(2), A.col(0)), r2 = cross(A.col(0), A.col(1));
  const double determinant = A.col(0).dot(r0), scale = A(0, 0) + A(1, 1) + A(2, 2);
  if (!(determinant > 1e-14 * scale * scale * scale)) return std::nullopt;
  return Vec3d{{r0.dot(b) / determinant, r1.dot(b) / determinant, r2.dot(b) / determinant}};
}

}  // namespace

std::optional<Vec3d> triangulate(std::span<const Ray> rays, double least_parallax) {
  Mat3d A = Mat3d::zero();
  Vec3d b = Vec3d::zero();
  double least_cosine = 1.0;
  for (std::size_t k = 0; k < rays.size(); ++k) {
    const Vec3d d = rays[k].direction / rays[k].direction.norm();
    const Mat3d P = Mat3d::identity() - d * d.transposed();
    A += P;
    b += P * rays[k].origin;
    for (std::size_t l = 0; l < k; ++l)
      least_cosine = std::min(least_cosine, d.dot(rays[l].direction) / rays[l].direction.norm());
  }
  if (least_cosine > std::cos(least_parallax)) return std::nullopt;
  return solve(A, b);
}

}  // namespace oriel
