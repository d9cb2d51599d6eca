// A visual map as text: one line a row, groups one after the other, words and numbers separated by blanks.
//
//   oriel-visual-map/1
//   rigs N        then N × 2 lines, left and right:  fx fy cx cy k1 k2 p1 p2 · R_body_camera (9, by rows) · t (3)
//   frames N      ns x y z qx qy qz qw status previous rig observations · covariance (21)
//   points N      track x y z frame sightings · covariance (6)
//   observations N   point track right inlier u0 v0 u1 v1 · covariance0 (3) · covariance1 (3) · p_camera (3) ·
//                    covariance (6)
//   end
//
// In the file as in the map: frames rise by time, observations stand frame by frame, as many for each as it says;
// `previous`, `frame` and `point` are rows, or - for none (a point without a frame is in world). Covariances are upper
// triangles by rows. Numbers are the shortest decimals that read back to the same bits, so that saving and loading
// changes none. # begins a comment.
#pragma once
#include <string>
#include <string_view>

#include "oriel/base/result.h"
#include "oriel/window/visual_map.h"

namespace oriel {

inline constexpr std::string_view kVisualMapFormat = "oriel-visual-map/1";

// Errors name file and line and what was expected: another format, a group that is missing or cut short, what is no
// finite number, a row that is not there; or, of the whole, what VisualMap::check says.
Result<VisualMap> read_visual_map(const std::string& path);
Result<VisualMap> parse_visual_map(std::string_view text, const std::string& file_name);

// An error where the map does not pass its check, or the file cannot be written.
Result<void> write_visual_map(const std::string& path, const VisualMap& map);
std::string format_visual_map(const VisualMap& map);

}  // namespace oriel
