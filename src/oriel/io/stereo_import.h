// Reads folders of stereo tracks without an IMU: tracks.csv in the pixels of a rectified pair, calib.yaml, and
// groundtruth.tum where there is one. calib.yaml has
//   fu, fv, cu, cv         [px] of both cameras
//   baseline_m             u_right = u_left - fu·baseline/z
//   T_VC                   left camera to body, p_V = T_VC p_C, sixteen numbers row by row
//   pixel_variance_px2     optional: of u and v, left, then of u and v, right
// and may have gyro_variance_rad2_s2 and velocity_variance_m2_s2, which nothing here needs.
#pragma once
#include <string>

#include "oriel/base/result.h"
#include "oriel/io/recording.h"

namespace oriel {

// Errors name file and line, as read_recording has them. The body frame is that of T_VC.
Result<Recording> read_stereo_tracks(const std::string& source_folder);

// A folder of whatever layout is known: a recording (recording.yaml), stereo tracks (calib.yaml), one that derives from
// EuRoC, GTSAM's stereo example (gtsam_import.h). None of them: an error that lists these.
Result<Recording> read_any_recording(const std::string& folder);

}  // namespace oriel
