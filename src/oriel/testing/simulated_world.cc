#include "oriel/testing/simulated_world.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "oriel/testing/simulated_sensors.h"

namespace oriel {
namespace {

using simulated::Stream;
using simulated::stream;

constexpr SimulatedSensor kSensors[] = {SimulatedSensor::imu, SimulatedSensor::camera, SimulatedSensor::gnss,
                                        SimulatedSensor::odometry, SimulatedSensor::range};

const SensorTiming& timing_of(const SimulatedWorldOptions& o, SimulatedSensor sensor) {
  const SensorTiming* all[] = {&o.imu.timing, &o.cameras.timing, &o.gnss.timing, &o.odometry.timing, &o.ranges.timing};
  return *all[static_cast<std::size_t>(sensor)];
}

// Of the k-th measurement since the start, the nearest nanosecond.
Duration tick_time(const SensorTiming& timing, std::int64_t k) {
  return Duration::from_seconds(static_cast<double>(k) / timing.rate_hz);
}

Result<void> check_options(const SimulatedWorldOptions& o) {
  const auto refuse = [](const std::string& what) {
    return Error{ErrorCode::bad_input, "simulated world: expected " + what};
  };
  for (const SimulatedSensor s : kSensors) {
    const SensorTiming& t = timing_of(o, s);
    if (!(t.rate_hz >= 0.0 && t.rate_hz <= 1e5)) return refuse("rates from 0 to 100000 Hz");
    if (t.latency.ns < 0 || t.latency_spread.ns < 0) return refuse("latencies of 0 or more");
  }
  const ImuNoise& n = o.imu.noise;
  if (!(n.gyro >= 0.0 && n.accel >= 0.0 && n.gyro_walk >= 0.0 && n.accel_walk >= 0.0))
    return refuse("IMU noise of 0 or more");
  const SimulatedCameras& c = o.cameras;
  if (!(c.pixel_sigma >= 0.0 && c.tracks >= 0 && c.width >= 1.0 && c.height >= 1.0))
    return refuse("a camera with pixels, noise and tracks of 0 or more");
  if (!(0.0 < c.least_depth && c.least_depth <= c.nearest_birth && c.nearest_birth <= c.farthest_birth &&
        c.farthest_birth <= c.greatest_depth))
    return refuse("0 < least depth <= nearest <= farthest <= greatest depth of landmarks");
  if (!(o.seconds >= 0.0) || !std::isfinite(o.seconds)) return refuse("seconds of 0 or more");
  if (!(o.memory_s > 0.0)) return refuse("a memory of more than 0 s");
  if (o.ranges.timing.rate_hz > 0.0 && o.ranges.beacons < 1) return refuse("a beacon or more to measure ranges to");
  for (const SimulatedFault& f : o.faults)
    if (!(f.share >= 0.0 && f.share <= 1.0 && f.range > 0.0)) return refuse("a fault's share from 0 to 1, range > 0");
  return {};
}

std::size_t place(SimulatedSensor s) { return static_cast<std::size_t>(s); }

// Of a heap whose front arrives first; of two that arrive at once, by sensor, then by time.
bool arrives_later(const SimulatedMeasurement& a, const SimulatedMeasurement& b) {
  if (a.arrival != b.arrival) return a.arrival > b.arrival;
  return a.sensor != b.sensor ? a.sensor > b.sensor : a.time > b.time;
}

}  // namespace

struct SimulatedWorld::Parts {
  Parts(const SimulatedWorldOptions& o, SimulatedPath p)
      : options(o),
        path(std::move(p)),
        rig(simulated_rig()),
        bias(o.imu, o.seed),
        tracks(o.cameras, rig, o.seed),
        imu_noise(stream(o.seed, Stream::imu_noise)),
        gnss_noise(stream(o.seed, Stream::gnss)),
        odometry_noise(stream(o.seed, Stream::odometry)),
        range_noise(stream(o.seed, Stream::ranges)) {
    for (const SimulatedSensor s : kSensors) {
      faults.emplace_back(o, s);
      latencies.push_back(stream(o.seed, Stream::latency, place(s)));
    }
    seconds = o.seconds > 0.0 ? std::fmin(o.seconds, path.duration()) : path.duration();
    SeededRandom random = stream(o.seed, Stream::beacons);
    for (int k = 0; k < o.ranges.beacons; ++k)
      beacons.push_back(path.at(random.uniform(0.0, seconds)).T_world_body.t + random.normals<3>(4.0));
  }

  // The sensor that measures next, and when; none at the end of the world.
  bool next_tick(SimulatedSensor& sensor, Duration& at) const {
    bool found = false;
    for (const SimulatedSensor s : kSensors) {
      const SensorTiming& t = timing_of(options, s);
      if (!(t.rate_hz > 0.0)) continue;
      const Duration d = tick_time(t, ticks[place(s)]);
      if (d.seconds() > seconds + 1e-9 || (found && at <= d)) continue;
      sensor = s, at = d, found = true;
    }
    return found;
  }

  void measure(SimulatedSensor sensor, Duration at) {
    SimulatedMeasurement m;
    if (!spare.empty()) {
      m.features = std::move(spare.back());
      spare.pop_back();
    }
    m.features.clear();
    const std::int64_t tick = ticks[place(sensor)]++;
    const SensorTiming& timing = timing_of(options, sensor);
    m.sensor = sensor;
    m.time = options.start + at;
    m.stamp = m.time + timing.clock_offset;
    const double late = latencies[place(sensor)].uniform();
    m.arrival = m.time + timing.latency + Duration::from_seconds(late * timing.latency_spread.seconds());
    fill(m, tick, at.seconds());
    if (sensor == SimulatedSensor::camera) forget(at.seconds() - options.memory_s);
    if (!faults[place(sensor)].apply(at.seconds(), tick_time(timing, 1), options, m)) return;
    pending.push_back(std::move(m));
    std::push_heap(pending.begin(), pending.end(), arrives_later);
  }

  void forget(double before) {
    if (!(before > 0.0)) return;
    tracks.forget_lost();
    bias.forget_before(static_cast<std::int64_t>(before * options.imu.timing.rate_hz));
  }

  void fill(SimulatedMeasurement& m, std::int64_t tick, double t) {
    const PathState x = path.at(t);
    switch (m.sensor) {
      case SimulatedSensor::imu:
        fill_imu(m.imu, tick, x);
        break;
      case SimulatedSensor::camera:
        m.faulty = faults[place(m.sensor)].blind(t);
        if (m.faulty)
          tracks.lose_all();
        else
          tracks.observe(x.T_world_body, m.features);
        break;
      case SimulatedSensor::gnss:
        m.position = x.T_world_body * options.gnss.p_body_antenna + gnss_noise.normals<3>(options.gnss.sigma);
        break;
      case SimulatedSensor::odometry:
        fill_odometry(m, tick, x);
        break;
      case SimulatedSensor::range:
        m.beacon = static_cast<int>(tick % static_cast<std::int64_t>(beacons.size()));
        m.range =
            (x.T_world_body * options.ranges.p_body_antenna - beacons[static_cast<std::size_t>(m.beacon)]).norm() +
            options.ranges.sigma * range_noise.normal();
        break;
    }
  }

  void fill_imu(ImuSample& s, std::int64_t tick, const PathState& x) {
    const double root = std::sqrt(options.imu.timing.rate_hz);  // white noise of density σ, sampled: σ √rate
    const ImuBiasd b = bias.at(tick);
    s.gyro = x.rate_body + b.gyro + imu_noise.normals<3>(options.imu.noise.gyro * root);
    s.accel = x.T_world_body.R.inverse() * (x.a_world - kStandardGravity) + b.accel +
              imu_noise.normals<3>(options.imu.noise.accel * root);
  }

  void fill_odometry(SimulatedMeasurement& m, std::int64_t tick, const PathState& x) {
    const SimulatedOdometry& o = options.odometry;
    const Duration before = tick_time(o.timing, std::max<std::int64_t>(0, tick - 1));
    m.motion_since = options.start + before + o.timing.clock_offset;
    m.T_since_body = path.at(before.seconds()).T_world_body.inverse() * x.T_world_body;
    Vec6d noise;
    noise.set_segment(0, odometry_noise.normals<3>(o.rotation_sigma));
    noise.set_segment(3, odometry_noise.normals<3>(o.translation_sigma));
    m.T_since_body = m.T_since_body.plus(noise);
    m.v_body = x.T_world_body.R.inverse() * x.v_world + odometry_noise.normals<3>(o.velocity_sigma);
  }

  SimulatedWorldOptions options;
  SimulatedPath path;
  double seconds = 0.0;
  StereoRigd rig;
  std::vector<Vec3d> beacons;
  simulated::BiasWalk bias;
  simulated::TrackSource tracks;
  SeededRandom imu_noise, gnss_noise, odometry_noise, range_noise;
  std::vector<simulated::FaultSource> faults;  // by sensor
  std::vector<SeededRandom> latencies;         // by sensor
  std::int64_t ticks[kSimulatedSensors] = {};
  std::vector<SimulatedMeasurement> pending;  // a heap
  std::vector<std::vector<FeatureObservation>> spare;
};

SimulatedWorld::SimulatedWorld(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
SimulatedWorld::SimulatedWorld(SimulatedWorld&&) noexcept = default;
SimulatedWorld& SimulatedWorld::operator=(SimulatedWorld&&) noexcept = default;
SimulatedWorld::~SimulatedWorld() = default;

Result<SimulatedWorld> SimulatedWorld::make(const SimulatedWorldOptions& options) {
  if (!(options.seconds > 0.0 && options.seconds <= 1e6))
    return Error{ErrorCode::bad_input, "simulated world: expected seconds > 0 where there is no trajectory"};
  return make(options, procedural_flight(options.seconds));
}

Result<SimulatedWorld> SimulatedWorld::make(const SimulatedWorldOptions& options,
                                            std::span<const StampedPose> trajectory) {
  if (auto ok = check_options(options); !ok) return ok.error();
  auto spline = PoseSpline::through(trajectory, options.spacing_s);
  if (!spline) return spline.error();
  auto path = SimulatedPath::make(std::move(*spline), options.rests);
  if (!path) return path.error();
  return SimulatedWorld(std::make_unique<Parts>(options, std::move(*path)));
}

// A measurement may go out once nothing that is still to be measured can arrive before it.
bool SimulatedWorld::next(SimulatedMeasurement& out) {
  Parts& p = *parts_;
  SimulatedSensor sensor = SimulatedSensor::imu;
  Duration at;
  while (p.next_tick(sensor, at)) {
    if (!p.pending.empty() && p.pending.front().arrival < p.options.start + at) break;
    p.measure(sensor, at);
  }
  if (p.pending.empty()) return false;
  std::pop_heap(p.pending.begin(), p.pending.end(), arrives_later);
  std::swap(out, p.pending.back());
  p.spare.push_back(std::move(p.pending.back().features));
  p.pending.pop_back();
  return true;
}

const SimulatedWorldOptions& SimulatedWorld::options() const { return parts_->options; }
double SimulatedWorld::seconds() const { return parts_->seconds; }
const StereoRigd& SimulatedWorld::rig() const { return parts_->rig; }
const std::vector<Vec3d>& SimulatedWorld::beacons() const { return parts_->beacons; }
std::int64_t SimulatedWorld::landmarks() const { return parts_->tracks.landmarks(); }
const Vec3d* SimulatedWorld::landmark(std::int64_t track) const { return parts_->tracks.landmark(track); }

SimulatedTruth SimulatedWorld::truth(Time time) const {
  const double t = std::clamp((time - parts_->options.start).seconds(), 0.0, parts_->seconds);
  SimulatedTruth truth;
  truth.path = parts_->path.at(t);
  truth.T_world_body = truth.path.T_world_body;
  truth.velocity.v = truth.path.v_world;
  const double rate = parts_->options.imu.timing.rate_hz;
  truth.bias = parts_->bias.at(static_cast<std::int64_t>(std::floor(t * rate + 1e-6)));
  return truth;
}

StereoRigd simulated_rig() {
  StereoRigd r;
  const Mat3d R0 = {{0.0148655429818, 0.999557249008, -0.0257744366974, -0.999880929698, 0.0149672133247,
                     0.00375618835797, 0.00414029679422, 0.025715529948, 0.999660727178}};
  const Mat3d R1 = {{0.0125552670891, 0.999598781151, -0.0253898008918, -0.999755099723, 0.0130119051815,
                     0.0179005838253, 0.0182237714554, 0.0251588363115, 0.999517347078}};
  r.cameras[0] = {
      RadTanCamerad{458.654, 457.296, 367.215, 248.375, -0.28340811, 0.07395907, 0.00019359, 1.76187114e-05},
      Pose3d{Rot3d::from_matrix(R0), {{-0.0216401454975, -0.064676986768, 0.00981073058949}}}};
  r.cameras[1] = {
      RadTanCamerad{457.587, 456.134, 379.999, 255.238, -0.28368365, 0.07451284, -0.00010473, -3.55590700e-05},
      Pose3d{Rot3d::from_matrix(R1), {{-0.0198435579556, 0.0453689425024, 0.00786212447038}}}};
  return r;
}

}  // namespace oriel
