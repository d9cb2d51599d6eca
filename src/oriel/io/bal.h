// Bundle adjustment in the large (Agarwal, Snavely, Seitz, Szeliski, ECCV 2010), plain text:
//
//   cameras points observations
//   camera point u v              one line an observation [px]
//   nine numbers a camera: angle-axis [rad], translation, focal length [px], k1, k2; then three a point
//
// P = R·X + t, p = −P_xy / P_z, (u, v) = f·(1 + k1·|p|² + k2·|p|⁴)·p. The camera looks along −z.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "oriel/base/matrix.h"
#include "oriel/base/result.h"

namespace oriel {

struct BalFile {
  struct Observation {
    std::int32_t camera, point;  // indices
    double u, v;                 // [px], from the centre of the image
    std::int64_t line;           // of the file, for messages
  };
  std::string file_name;
  std::vector<std::array<double, 9>> cameras;
  std::vector<Vec3d> points;
  std::vector<Observation> observations;  // as in the file
};

// Errors name file, line and what was expected: counts that are not positive or that the file is too short to hold
// (nothing is allocated for them), an index out of range, a number that is none or not finite, an end too early, and
// anything after the last number.
Result<BalFile> read_bal(const std::string& path);
Result<BalFile> parse_bal(std::string_view text, std::string file_name);

std::string format_bal(const BalFile& problem);
Result<void> write_bal(const std::string& path, const BalFile& problem);

}  // namespace oriel
