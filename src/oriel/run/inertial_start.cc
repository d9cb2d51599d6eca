#include "oriel/run/inertial_start.h"

namespace oriel {
namespace {

OdometryOptions start_options(const InitialisationOptions& initialisation, const InertialStartOptions& options) {
  OdometryOptions out;
  out.initialisation = initialisation;
  out.inertial = options.inertial;
  return out;
}

class InertialStart final : public WindowStart {
 public:
  InertialStart(ImuProvider& imu, const ImuNoise& noise, const SensorSuite& sensors,
                const InitialisationOptions& initialisation, const InertialStartOptions& options)
      : imu_(imu),
        options_(options),
        initialisation_(initialisation),
        initialiser_(sensors.rig, sensors.cameras > 1, noise, start_options(initialisation, options)) {}

  bool add(const StereoFrame& frame) override {
    initialiser_.add(frame);
    const Initialisation found = initialiser_.attempt(imu_.samples());
    reason_ = found.reason;
    if (found.kind == Initialisation::Kind::none) return false;
    first_ = found.states.front().frame;
    imu_.start_at(first_state(found));
    return true;
  }
  const char* reason() const override { return reason_; }
  std::size_t frames() const override { return initialiser_.size() - first_; }
  StereoFrame frame(std::size_t k) const override { return initialiser_.frame(first_ + k); }

 private:
  ImuStart first_state(const Initialisation& found) const {
    const InitialisationOptions& o = initialisation_;
    const bool still = found.kind == Initialisation::Kind::standstill;
    ImuStart start;
    start.T_world_body = found.states.front().T_world_body;
    start.velocity.v = still ? Vec3d::zero() : found.states.front().v_world;
    start.bias.gyro = found.bias.gyro;  // what a second says of the accelerometer's is mostly noise
    start.pose_noise = level_pose_noise(start.T_world_body, o.position_sigma, o.yaw_sigma, o.tilt_sigma);
    start.velocity_noise = Sigma(still ? o.rest_velocity_sigma : options_.moving_velocity_sigma);
    const double g = options_.inertial.gyro_bias_sigma, a = options_.inertial.accel_bias_sigma;
    start.bias_noise = Sigmas(Vec6d{{g, g, g, a, a, a}});
    return start;
  }

  ImuProvider& imu_;
  InertialStartOptions options_;
  InitialisationOptions initialisation_;
  Initialiser initialiser_;
  std::size_t first_ = 0;
  const char* reason_ = "no frame";
};

}  // namespace

std::unique_ptr<WindowStart> make_inertial_start(ImuProvider& imu, const ImuNoise& noise, const SensorSuite& sensors,
                                                 const InitialisationOptions& initialisation,
                                                 const InertialStartOptions& options) {
  return std::make_unique<InertialStart>(imu, noise, sensors, initialisation, options);
}

}  // namespace oriel
