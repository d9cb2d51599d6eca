// Trajectories as text: TUM (`t x y z qx qy qz qw`, a line a pose) and KITTI (the first three rows of T_world_body,
// twelve numbers a line, no stamps).
//
// Stamps are decimal seconds and are read exactly to the nanosecond, by arithmetic on their digits: a double has no
// nanoseconds left at 1.4e9 s (behaviour W1).
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "oriel/base/matrix.h"
#include "oriel/base/result.h"
#include "oriel/base/time.h"

namespace oriel {

struct TumPose {
  Time time;
  Vec3d p;                // p_world_body [m]
  double qx, qy, qz, qw;  // of R_world_body, Hamilton, unit norm
};

struct TrajectoryFile {
  std::string file_name;
  bool stamped = true;         // false (KITTI): `time` counts lines from 0, one nanosecond each
  std::vector<TumPose> poses;  // in the order of the file
};

// Seconds in decimal (`1403715273.26214`, `1.4e+09`, `-0.000000001`) to nanoseconds, the nearest one where there are
// more digits, halves away from zero. False where the token is no number or leaves the range of ± 292 years.
bool parse_seconds(std::string_view token, Time& out);
// Seconds with nine decimals.
std::string format_seconds(Time time);

// The format is told by the columns of the first line: 8 is TUM, 12 is KITTI. Quaternions are normalised. Errors name
// file and line: wrong count of columns, what is no finite number, a zero quaternion, a matrix that is no rotation, no
// pose at all.
enum class StampOrder { any, rising };  // rising: a stamp that is not later than the one before is an error
Result<TrajectoryFile> read_trajectory(const std::string& path, StampOrder order = StampOrder::any);
Result<TrajectoryFile> parse_trajectory(std::string_view text, std::string file_name,
                                        StampOrder order = StampOrder::any);

std::string format_tum(const std::vector<TumPose>& poses);
Result<void> write_tum(const std::string& path, const std::vector<TumPose>& poses);

}  // namespace oriel
