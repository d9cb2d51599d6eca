// A recording: a folder of what the sensors said, in one layout whatever it came from.
//
//   recording.yaml   format, name, origin, files, imu (rate, noise), cameras (calibration)
//   imu.csv          optional: timestamp_ns,wx,wy,wz,ax,ay,az                [rad/s] [m/s²], body frame = IMU frame
//   tracks.csv       timestamp_ns,frame,track_id,u0,v0,u1,v1       [px], raw (distorted); u1,v1 empty: not seen there
//   groundtruth.tum  optional: t x y z qx qy qz qw, body to world
//
// Every stamp is in nanoseconds of one clock, and they rise strictly.
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "oriel/base/matrix.h"
#include "oriel/base/result.h"
#include "oriel/base/time.h"
#include "oriel/io/tum.h"

namespace oriel {

struct RecordedImu {
  Time time;
  Vec3d gyro;   // [rad/s]
  Vec3d accel;  // [m/s²], gravity included (at rest it points up)
};

struct RecordedImuNoise {
  double rate_hz = 0;
  double gyroscope_noise_density = 0;      // [rad/s/√Hz]
  double gyroscope_random_walk = 0;        // [rad/s²/√Hz]
  double accelerometer_noise_density = 0;  // [m/s²/√Hz]
  double accelerometer_random_walk = 0;    // [m/s³/√Hz]
};

// A pinhole camera with radial-tangential distortion.
struct RecordedCamera {
  int width = 0, height = 0;              // [px]; 0: not known
  double fx = 0, fy = 0, cx = 0, cy = 0;  // [px]
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0;
  Mat3d R_body_camera = Mat3d::identity();  // orthonormal to rounding
  Vec3d p_body_camera = Vec3d::zero();      // [m]
  Vec2d pixel_sigma = Vec2d::zero();        // noise of u and v of its observations [px]; 0: not known
};

struct RecordedObservation {
  std::int64_t track_id;
  double u0, v0;   // [px] in camera 0
  bool has_right;  // seen by camera 1 too
  double u1, v1;   // [px] in camera 1; 0 where it was not seen
};

struct RecordedFrame {
  Time time;
  std::int64_t number;       // as in the file
  std::size_t first, count;  // its rows in `observations`
};

struct Recording {
  std::string name, origin;
  RecordedImuNoise imu_noise;
  std::vector<RecordedCamera> cameras;  // 1 or 2; the first sees every track
  std::vector<RecordedImu> imu;         // empty where there is none
  std::vector<RecordedFrame> frames;
  std::vector<RecordedObservation> observations;  // frame by frame, in the order of the file
  std::vector<TumPose> groundtruth;               // empty where there is none

  std::span<const RecordedObservation> observations_of(const RecordedFrame& frame) const {
    return {observations.data() + frame.first, frame.count};
  }
};

inline constexpr std::string_view kRecordingFormat = "oriel-recording/1";

// Errors name file, line and sensor, and what was expected: a file or a key that is missing, a key that nobody knows, a
// wrong count of columns, what is no finite number, stamps that do not rise, a track twice in a frame.
Result<Recording> read_recording(const std::string& folder);

// Into a new folder beside it, renamed at the end: a failure leaves nothing. A folder that is there already is replaced
// only if it is a recording (or empty) and holds nothing else.
Result<void> write_recording(const std::string& folder, const Recording& recording);

// The tables alone, for importers.
Result<std::vector<RecordedImu>> parse_imu_csv(std::string_view text, const std::string& file_name);
struct RecordedTracks {
  std::vector<RecordedFrame> frames;
  std::vector<RecordedObservation> observations;
};
Result<RecordedTracks> parse_tracks_csv(std::string_view text, const std::string& file_name, std::size_t cameras);
// A trajectory with stamps that rise strictly.
Result<std::vector<TumPose>> parse_groundtruth(std::string_view text, const std::string& file_name);

}  // namespace oriel
