// Which true pose belongs to which estimated one: nearest stamp.
#pragma once
#include <cstddef>
#include <vector>

#include "oriel/base/result.h"
#include "oriel/base/time.h"
#include "oriel/io/tum.h"

namespace oriel {

struct PosePair {
  std::size_t estimate, truth;  // indices into the two
};

// For each pose of the shorter trajectory the nearest stamp of the other, not further than max_dt (a tie: the earlier).
// Where two poses claim the same, the nearer keeps it (a tie: the first). Both must be in order of time.
std::vector<PosePair> nearest_stamps(const std::vector<TumPose>& estimate, const std::vector<TumPose>& truth,
                                     Duration max_dt);

// In order of time; of poses at one stamp the first stays. Logs of real runs hold both faults.
std::vector<TumPose> sorted_by_stamp(std::vector<TumPose> poses);

// Pairs by stamp, or line by line where neither file has stamps (KITTI; the same count is then expected). Sorts both.
Result<std::vector<PosePair>> associate(TrajectoryFile& estimate, TrajectoryFile& truth, Duration max_dt);

}  // namespace oriel
