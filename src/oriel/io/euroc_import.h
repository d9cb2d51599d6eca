// Makes a recording of a folder that derives from EuRoC: imu.csv, tracks.csv, cam0_sensor.yaml, cam1_sensor.yaml (not
// for one camera), imu0_sensor.yaml, and groundtruth.tum where there is one.
#pragma once
#include <string>

#include "oriel/base/result.h"
#include "oriel/io/recording.h"

namespace oriel {

// Errors name file, line and sensor, as read_recording has them; further, a camera that is not pinhole with
// radial-tangential distortion, and an IMU that is not the body frame.
Result<Recording> read_euroc(const std::string& source_folder);

// read_euroc, then write_recording: nothing is written on bad input.
Result<Recording> import_euroc(const std::string& source_folder, const std::string& recording_folder);

}  // namespace oriel
