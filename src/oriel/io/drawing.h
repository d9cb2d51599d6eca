// What of a problem can be drawn: places, and which of them hang together. Pictures (SVG) and clouds (PLY) stand on it.
#pragma once
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "oriel/io/bal.h"
#include "oriel/io/g2o.h"

namespace oriel {

struct Drawing {
  using Line = std::pair<std::int32_t, std::int32_t>;  // indices of poses
  std::vector<Vec3d> poses;                            // of cameras: their centres [m]; z = 0 in the plane
  std::vector<Vec3d> landmarks;                        // [m]
  std::vector<Line> path, loops;                       // edges between neighbours in the order of ids, and all others
};

// The file must have values (VERTEX lines, or copy_values).
Drawing drawing_of(const PoseGraphFile& file);
Drawing drawing_of(const BalFile& file);  // the centre of a camera is -Rᵀ t

// Polygon file format, ASCII: landmarks, then poses, each with a colour, and the edges between poses.
std::string format_ply(const Drawing& drawing);

// Two pictures side by side, each with its own scale: the path, its loop edges and landmarks, seen from where `after`
// is widest. What is not finite is left out; where there are too many loops or landmarks to see, every n-th is drawn
// and the picture says so.
std::string format_svg(const std::string& title, const Drawing& before, const Drawing& after);

}  // namespace oriel
