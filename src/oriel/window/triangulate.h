// From rays to points.
#pragma once
#include <optional>
#include <span>

#include "oriel/manifold/se3.h"

namespace oriel {

// A direction seen from a place, both in one frame. The direction's length does not matter.
struct Ray {
  Vec3d origin;     // [m]
  Vec3d direction;  // not zero
};

// The point with the least sum of squared distances to the rays: Σ (I - d dᵀ)(p - o) = 0 with unit d (the midpoint
// method for any number of views; Hartley & Zisserman, Multiple View Geometry, 2004, section 12.3, for two). None where
// the largest angle between two rays is less than `least_parallax` [rad], or the system is singular.
std::optional<Vec3d> triangulate(std::span<const Ray> rays, double least_parallax);

}  // namespace oriel
