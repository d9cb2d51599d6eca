#include <algorithm>
#include <cmath>
#include <limits>

#include "oriel/testing/simulated_sensors.h"

namespace oriel::simulated {
namespace {

using Kind = SimulatedFaultKind;

// Off in a random direction by 5 to 50.
Vec3d far_off(SeededRandom& random) {
  const Vec3d d = random.normals<3>(1.0);
  return d * (random.uniform(5.0, 50.0) / d.norm());
}

void clip(Vec3d& v, double range) {
  for (int i = 0; i < 3; ++i) v[i] = std::clamp(v[i], -range, range);
}

}  // namespace

FaultSource::FaultSource(const SimulatedWorldOptions& options, SimulatedSensor sensor)
    : random_(stream(options.seed, Stream::faults, static_cast<std::uint64_t>(sensor))) {
  for (const SimulatedFault& f : options.faults)
    if (f.sensor == sensor) faults_.push_back(f);
}

const SimulatedFault* FaultSource::find(Kind kind, double t) const {
  for (const SimulatedFault& f : faults_)
    if (f.kind == kind && t >= f.when.from_s && t < f.when.to_s) return &f;
  return nullptr;
}

bool FaultSource::strikes(Kind kind, double t) {
  const SimulatedFault* f = find(kind, t);
  return f != nullptr && random_.chance(f->share);
}

bool FaultSource::apply(double t, Duration period, const SimulatedWorldOptions& options, SimulatedMeasurement& m) {
  if (m.sensor == SimulatedSensor::imu) {
    const ImuSample before = m.imu;
    saturate(t, options.imu, m.imu);
    m.faulty = m.faulty || before.gyro != m.imu.gyro || before.accel != m.imu.accel;
  }
  if (find(Kind::outlier, t) != nullptr) make_outlier(t, options, m);
  if (strikes(Kind::not_a_number, t)) make_nan(m);
  if (has_last_ && strikes(Kind::repeated_stamp, t)) m.stamp = last_stamp_, m.faulty = true;
  if (has_last_ && strikes(Kind::backward_stamp, t)) m.stamp = last_stamp_ - Duration{3 * period.ns}, m.faulty = true;
  m.imu.time = m.stamp;
  if (strikes(Kind::dropout, t)) return false;
  has_last_ = true;
  last_stamp_ = m.stamp;
  return true;
}

void FaultSource::make_outlier(double t, const SimulatedWorldOptions& options, SimulatedMeasurement& m) {
  const SimulatedFault& f = *find(Kind::outlier, t);
  if (m.sensor == SimulatedSensor::camera) {
    const double w = options.cameras.width, h = options.cameras.height;
    for (FeatureObservation& o : m.features) {
      if (!random_.chance(f.share)) continue;
      o.pixel0 = {{random_.uniform(0.0, w), random_.uniform(0.0, h)}};
      if (o.has_right) o.pixel1 = {{random_.uniform(0.0, w), random_.uniform(0.0, h)}};
      m.faulty = true;
    }
    return;
  }
  if (!random_.chance(f.share)) return;
  m.faulty = true;
  switch (m.sensor) {
    case SimulatedSensor::imu:
      for (int i = 0; i < 3; ++i) {
        m.imu.gyro[i] = random_.uniform(-1.0, 1.0) * options.imu.gyro_range;
        m.imu.accel[i] = random_.uniform(-1.0, 1.0) * options.imu.accel_range;
      }
      break;
    case SimulatedSensor::gnss:
      m.position += far_off(random_);
      break;
    case SimulatedSensor::odometry:  // a wheel that spins
      m.v_body += far_off(random_);
      m.T_since_body.t += far_off(random_);
      break;
    case SimulatedSensor::range:  // a way that was reflected is longer
      m.range += random_.uniform(5.0, 50.0);
      break;
    case SimulatedSensor::camera:
      break;
  }
}

void FaultSource::make_nan(SimulatedMeasurement& m) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  m.faulty = true;
  const std::size_t k = random_.below(6);
  const int axis = static_cast<int>(k % 3);
  switch (m.sensor) {
    case SimulatedSensor::imu:
      (k < 3 ? m.imu.gyro : m.imu.accel)[axis] = kNaN;
      break;
    case SimulatedSensor::camera:
      if (!m.features.empty()) m.features[random_.below(m.features.size())].pixel0[axis % 2] = kNaN;
      break;
    case SimulatedSensor::gnss:
      m.position[axis] = kNaN;
      break;
    case SimulatedSensor::odometry:
      (k < 3 ? m.v_body : m.T_since_body.t)[axis] = kNaN;
      break;
    case SimulatedSensor::range:
      m.range = kNaN;
      break;
  }
}

void FaultSource::saturate(double t, const SimulatedImu& imu, ImuSample& s) const {
  const SimulatedFault* f = find(Kind::saturation, t);
  const double share = f != nullptr ? f->range : 1.0;
  clip(s.gyro, share * imu.gyro_range);
  clip(s.accel, share * imu.accel_range);
}

}  // namespace oriel::simulated
