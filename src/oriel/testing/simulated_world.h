// A world made of a seed: a body flies along a spline, and its sensors say what they measure, with noise and with the
// faults that were asked for, in the order in which it arrives. The truth of everything can be asked at any time.
//
//   auto world = SimulatedWorld::make(options);                      // a flight of formulas
//   auto world = SimulatedWorld::make(options, poses);               // along a trajectory of the user's own
//   for (SimulatedMeasurement m; world->next(m);) ...
//
// It makes measurements as they are asked for, so that a world of hours needs no memory for them. The same options give
// the same numbers with every compiler and standard library (up to the last bits of libm). Each sensor draws from
// random numbers of its own, and faults from others: switching one on changes nothing else.
#pragma once
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "oriel/manifold/vector.h"
#include "oriel/sensor/feature_track.h"
#include "oriel/sensor/imu.h"
#include "oriel/sensor/stereo_rig.h"
#include "oriel/testing/simulated_path.h"

namespace oriel {

enum class SimulatedSensor : std::uint8_t { imu, camera, gnss, odometry, range };
inline constexpr int kSimulatedSensors = 5;

// When a sensor measures, what its clock says, and when that arrives.
struct SensorTiming {
  double rate_hz = 0.0;        // 0: there is no such sensor
  Duration clock_offset{0};    // stamp minus time of the measurement
  Duration latency{0};         // from the measurement to its arrival,
  Duration latency_spread{0};  // and up to so much more, drawn evenly: measurements may overtake each other
};

struct SimulatedImu {
  SensorTiming timing{200.0};
  // EuRoC's ADIS16448, from the imu0/sensor.yaml of its recordings (Burri et al., "The EuRoC micro aerial vehicle
  // datasets", IJRR 2016).
  ImuNoise noise{1.6968e-4, 2.0e-3, 1.9393e-5, 3.0e-3};
  double gyro_bias_sigma = 0.02, accel_bias_sigma = 0.05;  // of the biases at the start [rad/s] [m/s²]
  // Where readings saturate, on each axis: ±1000 deg/s and ±18 g (data sheet of the ADIS16448).
  double gyro_range = 17.45, accel_range = 176.5;  // [rad/s] [m/s²]
};

struct SimulatedCameras {
  SensorTiming timing{20.0};
  bool stereo = true;
  double pixel_sigma = 1.0;                          // of each coordinate [px]
  int tracks = 150;                                  // in view at a time
  double width = 752.0, height = 480.0;              // [px]
  double least_depth = 0.5, greatest_depth = 40.0;   // in camera 0: what is nearer or further is lost [m]
  double nearest_birth = 1.5, farthest_birth = 8.0;  // where landmarks are when they are first seen [m]
  double loss = 0.01;                                // probability with which a tracker loses a track, each frame
};

struct SimulatedGnss {
  SensorTiming timing;
  double sigma = 0.5;                          // [m]
  Vec3d p_body_antenna = {{0.1, 0.0, -0.05}};  // [m]
};
struct SimulatedOdometry {
  SensorTiming timing;
  double velocity_sigma = 0.05;                            // of v_body [m/s]
  double rotation_sigma = 1e-3, translation_sigma = 5e-3;  // of the motion since the last one [rad] [m]
};
struct SimulatedRanges {
  SensorTiming timing;
  double sigma = 0.1;                         // [m]
  int beacons = 4;                            // one after the other
  Vec3d p_body_antenna = {{0.0, 0.05, 0.1}};  // [m]
};

enum class SimulatedFaultKind : std::uint8_t {
  dropout,       // does not arrive
  outlier,       // is anything: features and readings of the IMU anywhere in range, positions and ranges off by 5-50 m
  not_a_number,  // one number of it is a NaN
  repeated_stamp,  // has the stamp of the one before
  backward_stamp,  // has a stamp three periods before the one before
  blind,           // camera: frames without a feature; what was tracked is lost
  saturation,      // IMU: readings end at `range` of their range
};
struct SimulatedFault {
  SimulatedFaultKind kind = SimulatedFaultKind::dropout;
  SimulatedSensor sensor = SimulatedSensor::imu;
  Interval when{0.0, std::numeric_limits<double>::infinity()};  // since the start [s]
  double share = 1.0;  // of the measurements, or of a frame's features where they are outliers
  double range = 0.05;
};

struct SimulatedWorldOptions {
  std::uint64_t seed = 1;
  Time start{1'403'636'580'000'000'000};  // stamp of its beginning
  double seconds = 60.0;                  // at most; 0: to the end of the trajectory
  double spacing_s = 0.1;                 // of the spline's control poses
  // How far back it knows the truth of biases [s]. Where that is finite it also forgets landmarks whose tracks are
  // lost: a world of hours then needs no more memory as it goes on.
  double memory_s = std::numeric_limits<double>::infinity();
  std::vector<Interval> rests;  // the body does not move
  SimulatedImu imu;
  SimulatedCameras cameras;
  SimulatedGnss gnss;
  SimulatedOdometry odometry;
  SimulatedRanges ranges;
  std::vector<SimulatedFault> faults;
};

// Of the sensor's own kind are: imu (stamped as the measurement); features; position of the antenna in world; motion
// since another time and velocity, in the body's frame; range to a beacon.
struct SimulatedMeasurement {
  SimulatedSensor sensor = SimulatedSensor::imu;
  Time stamp, arrival;  // by the sensor's clock; by the world's
  Time time;            // when it was measured, by the world's clock
  bool faulty = false;  // some fault changed it
  ImuSample imu{Time{}, Vec3d::zero(), Vec3d::zero()};
  std::vector<FeatureObservation> features;  // track k is landmark k
  Vec3d position = Vec3d::zero();            // [m]
  Time motion_since;
  Pose3d T_since_body;
  Vec3d v_body = Vec3d::zero();  // [m/s]
  int beacon = 0;
  double range = 0.0;  // [m]
};

struct SimulatedTruth {
  Pose3d T_world_body;
  Velocity3d velocity;
  ImuBiasd bias;
  PathState path;  // the same pose, and its derivatives
};

// EuRoC's stereo rig (sensor.yaml of V1_01): body x up, z ahead.
StereoRigd simulated_rig();

class SimulatedWorld {
 public:
  // Errors: options out of their range; poses that make no spline or are too short; rests that overlap.
  static Result<SimulatedWorld> make(const SimulatedWorldOptions& options);
  static Result<SimulatedWorld> make(const SimulatedWorldOptions& options, std::span<const StampedPose> trajectory);
  SimulatedWorld(SimulatedWorld&&) noexcept;
  SimulatedWorld& operator=(SimulatedWorld&&) noexcept;
  ~SimulatedWorld();

  // The next that arrives; false after the last. `out` keeps its memory.
  bool next(SimulatedMeasurement& out);

  const SimulatedWorldOptions& options() const;
  double seconds() const;  // that it lasts
  Time end() const { return options().start + Duration::from_seconds(seconds()); }
  const StereoRigd& rig() const;
  const std::vector<Vec3d>& beacons() const;  // [m]
  std::int64_t landmarks() const;             // of all tracks so far
  // Of a track, in world [m]; null where it is forgotten, or never was. Until the next measurement.
  const Vec3d* landmark(std::int64_t track) const;
  // At any time of the world (before and after it: at its ends). Biases between two IMU samples are those of the
  // earlier; of times that are forgotten, the earliest that are not.
  SimulatedTruth truth(Time time) const;

 private:
  struct Parts;
  explicit SimulatedWorld(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace oriel
