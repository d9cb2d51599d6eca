// Reads the stereo example of GTSAM (VO_calibration00s.txt, VO_stereo_factors00s.txt, VO_camera_poses00s.txt):
// landmarks seen by a rectified pair, the camera being the body.
//
//   VO_calibration00s.txt     fx fy s cx cy b              [px], baseline b [m]; the skew s must be 0
//   VO_stereo_factors00s.txt  pose landmark uL uR v X Y Z  [px]; in any order, X Y Z are passed over
//   VO_camera_poses00s.txt    pose and 4 × 4 numbers by rows, T_world_camera; optional
#pragma once
#include <string>

#include "oriel/base/result.h"
#include "oriel/io/recording.h"

namespace oriel {

inline constexpr const char* kGtsamCalibration = "VO_calibration00s.txt";

// Errors name file and line. The files have no times: pose k stands at k · 0.1 s, as KITTI's camera has it. The poses
// become the recording's truth; they are the values that the example begins from, and no survey.
Result<Recording> read_gtsam_stereo(const std::string& folder);

}  // namespace oriel
