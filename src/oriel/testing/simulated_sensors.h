// The sensors of a SimulatedWorld, one class each. Private to the simulated world.
#pragma once
#include <vector>

#include "oriel/testing/random.h"
#include "oriel/testing/simulated_world.h"

namespace oriel::simulated {

enum class Stream : std::uint64_t {
  imu_noise = 1,
  imu_bias,
  tracks,
  pixels,
  gnss,
  odometry,
  ranges,
  beacons,
  faults = 100,  // + the sensor's number
  latency = 200,
  imu_bias_blocks = 1000,  // + the block's number
};
inline SeededRandom stream(std::uint64_t seed, Stream s, std::uint64_t k = 0) {
  return SeededRandom(seed, static_cast<std::uint64_t>(s) + k);
}

// The walk of the biases over the IMU's ticks: kept once in kBlock ticks, drawn again in between, so that the truth of
// hours needs little memory, and none where it may be forgotten.
class BiasWalk {
 public:
  BiasWalk(const SimulatedImu& imu, std::uint64_t seed);
  ImuBiasd at(std::int64_t tick);  // any tick ≥ 0; the oldest that is known where it has been forgotten
  void forget_before(std::int64_t tick);

 private:
  static constexpr std::int64_t kBlock = 256;
  void begin(std::int64_t block);

  ImuNoise noise_;
  double root_dt_;  // [√s]
  std::uint64_t seed_;
  std::int64_t first_block_ = 0;  // that is known
  std::vector<ImuBiasd> starts_;  // of the blocks from there on
  // The tick that was asked for last, to go on from.
  std::int64_t tick_ = 0;
  ImuBiasd bias_;
  SeededRandom random_;
};

class TrackSource {
 public:
  TrackSource(const SimulatedCameras& cameras, const StereoRigd& rig, std::uint64_t seed)
      : cameras_(cameras), rig_(rig), tracks_(stream(seed, Stream::tracks)), pixels_(stream(seed, Stream::pixels)) {}

  void observe(const Pose3d& T_world_body, std::vector<FeatureObservation>& out);
  void lose_all() { live_.clear(); }
  // Landmarks before the oldest that is still tracked.
  void forget_lost();
  std::int64_t landmarks() const { return first_landmark_ + static_cast<std::int64_t>(landmarks_.size()); }
  const Vec3d* landmark(std::int64_t k) const {
    const bool known = k >= first_landmark_ && k < landmarks();
    return known ? &landmarks_[static_cast<std::size_t>(k - first_landmark_)] : nullptr;
  }

 private:
  bool project(const Pose3d& T_world_body, int camera, const Vec3d& p_world, Vec2d& pixel) const;
  void begin(const Pose3d& T_world_body);

  SimulatedCameras cameras_;
  StereoRigd rig_;
  SeededRandom tracks_, pixels_;
  std::vector<std::int64_t> live_;  // rising
  std::int64_t first_landmark_ = 0;
  std::vector<Vec3d> landmarks_;  // from that one on
};

// What faults do to measurements of one sensor.
class FaultSource {
 public:
  FaultSource(const SimulatedWorldOptions& options, SimulatedSensor sensor);
  // What does not depend on the measurement: is the camera blind?
  bool blind(double t) const { return find(SimulatedFaultKind::blind, t) != nullptr; }
  // Changes m, which was made at t [s] and has its stamp; false where it does not arrive.
  bool apply(double t, Duration period, const SimulatedWorldOptions& options, SimulatedMeasurement& m);

 private:
  const SimulatedFault* find(SimulatedFaultKind kind, double t) const;
  bool strikes(SimulatedFaultKind kind, double t);
  void make_outlier(double t, const SimulatedWorldOptions& options, SimulatedMeasurement& m);
  void make_nan(SimulatedMeasurement& m);
  void saturate(double t, const SimulatedImu& imu, ImuSample& s) const;

  std::vector<SimulatedFault> faults_;  // of this sensor
  SeededRandom random_;
  bool has_last_ = false;
  Time last_stamp_;
};

}  // namespace oriel::simulated
