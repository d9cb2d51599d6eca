// The tables of a recording, read into it. Private to the readers of recordings.
#pragma once
#include "oriel/io/recording.h"

namespace oriel::io_detail {

// As many cameras as the recording has.
Result<void> read_tracks_into(const std::string& path, Recording& recording);
Result<void> read_truth_into(const std::string& path, Recording& recording);
Result<void> read_imu_into(const std::string& path, Recording& recording);

}  // namespace oriel::io_detail
