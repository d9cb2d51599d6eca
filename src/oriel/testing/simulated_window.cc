#include "oriel/testing/simulated_window.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "oriel/sensor/imu.h"

namespace oriel {
namespace {

// std::normal_distribution differs between standard libraries; Box and Muller's method (1958) does not.
class Random {
 public:
  explicit Random(std::uint64_t seed) : bits_(seed) {}
  double uniform() { return (static_cast<double>(bits_() >> 11) + 0.5) * 0x1p-53; }  // in (0, 1)
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  double normal() {
    const double radius = std::sqrt(-2.0 * std::log(uniform()));  // one after the other: operands have no order
    return radius * std::cos(2.0 * std::numbers::pi * uniform());
  }
  template <int N>
  Vec<double, N> normals(double sigma) {
    Vec<double, N> v;
    for (int i = 0; i < N; ++i) v[i] = sigma * normal();
    return v;
  }

 private:
  std::mt19937_64 bits_;
};

// a sin(w t + phase), and its derivatives by time.
struct Wave {
  double a, w, phase;
  double at(double t) const { return a * std::sin(w * t + phase); }
  double rate(double t) const { return a * w * std::cos(w * t + phase); }
  double acceleration(double t) const { return -w * w * at(t); }
};

// A Lissajous figure of some metres, flown at about 1 m/s while the head turns to and fro.
constexpr Wave kPosition[3] = {{4.0, 0.25, 0.0}, {3.0, 0.31, 1.0}, {0.5, 0.9, 0.3}};  // [m]
constexpr Wave kYaw{1.5, 0.13, 0.5}, kPitch{0.12, 0.8, 0.0}, kRoll{0.10, 0.7, 1.0};   // [rad]

struct Motion {
  Pose3d T_world_body;
  Velocity3d v;
  Vec3d rate, force;  // what an IMU without errors says: [rad/s], [m/s²]
};

// R = Rz(yaw) Ry(pitch) Rx(roll); the body's rates by those of the angles: Diebel, "Representing Attitude", 2006,
// eq. 77.
Motion motion_at(double t) {
  Motion m;
  Vec3d a;
  for (int i = 0; i < 3; ++i) {
    m.T_world_body.t[i] = kPosition[i].at(t);
    m.v.v[i] = kPosition[i].rate(t);
    a[i] = kPosition[i].acceleration(t);
  }
  const double pitch = kPitch.at(t), roll = kRoll.at(t);
  m.T_world_body.R = Rot3d::exp({{0, 0, kYaw.at(t)}}) * Rot3d::exp({{0, pitch, 0}}) * Rot3d::exp({{roll, 0, 0}});
  const double yaw_rate = kYaw.rate(t), pitch_rate = kPitch.rate(t);
  m.rate = {{kRoll.rate(t) - yaw_rate * std::sin(pitch),
             pitch_rate * std::cos(roll) + yaw_rate * std::cos(pitch) * std::sin(roll),
             -pitch_rate * std::sin(roll) + yaw_rate * std::cos(pitch) * std::cos(roll)}};
  m.force = m.T_world_body.R.inverse() * (a - kStandardGravity);
  return m;
}

constexpr double kWidth = 752, kHeight = 480;  // [px]

// EuRoC's cameras, looking along the body's x, side by side along its y.
StereoRigd rig() {
  StereoRigd r;
  Mat3d R = Mat3d::zero();  // camera's x, y, z are the body's -y, -z, x
  R(1, 0) = -1.0, R(2, 1) = -1.0, R(0, 2) = 1.0;
  const Rot3d forward = Rot3d::from_matrix(R);
  r.cameras[0] = {RadTanCamerad{458.654, 457.296, 367.215, 248.375, -0.28340811, 0.07395907, 0.00019359, 1.76e-05},
                  Pose3d{forward * Rot3d::exp({{0.01, -0.02, 0.015}}), {{0.05, 0.055, 0.01}}}};
  r.cameras[1] = {RadTanCamerad{457.587, 456.134, 379.999, 255.238, -0.28368365, 0.07451284, -0.00010473, -3.55e-05},
                  Pose3d{forward * Rot3d::exp({{-0.01, 0.01, 0.005}}), {{0.05, -0.055, 0.01}}}};
  return r;
}

Time half_way(Time t0, Time t1) { return {t0.ns + (t1.ns - t0.ns) / 2}; }

// The IMU of an interval, integrated over all of it and over its first half.
struct MeasuredMotion {
  Preintegration all, half;
};

// Integrates the IMU of one interval with its errors; the bias walks on.
MeasuredMotion measure_motion(const SimulatedWindowOptions& options, Time t0, Time t1, Random& random, ImuBiasd& bias) {
  const double dt = options.imu_interval.seconds(), root = std::sqrt(dt);
  const ImuBiasd start = bias;
  std::vector<ImuSample> samples;
  for (Time t = t0; t <= t1; t = t + options.imu_interval) {
    const Motion m = motion_at(Duration{t.ns}.seconds());
    samples.push_back({t, m.rate + bias.gyro + random.normals<3>(options.imu.gyro / root),
                       m.force + bias.accel + random.normals<3>(options.imu.accel / root)});
    if (t == t1) break;
    bias.gyro += random.normals<3>(options.imu.gyro_walk * root);
    bias.accel += random.normals<3>(options.imu.accel_walk * root);
  }
  // An estimator knows the biases about as well as this.
  ImuBiasd known = start;
  known.gyro += random.normals<3>(2e-4);
  known.accel += random.normals<3>(5e-3);
  MeasuredMotion measured;
  measured.all = *preintegrate(samples, t0, t1, known, options.imu);
  if (options.frames_between) measured.half = *preintegrate(samples, t0, half_way(t0, t1), known, options.imu);
  return measured;
}

class Simulation {
 public:
  explicit Simulation(const SimulatedWindowOptions& options)
      : options_(options), random_(options.seed), random_between_(~options.seed) {
    out_.rig = rig();
  }

  SimulatedWindow run() {
    fly();
    for (int k = 0; k < options_.keyframes; ++k) {
      // As many begin in each keyframe as leave; a remainder is spread over the keyframes.
      const int born = (k + 1) * options_.landmarks / options_.window - k * options_.landmarks / options_.window;
      for (int i = 0; i < born; ++i) begin_track(k);
    }
    return std::move(out_);
  }

 private:
  void fly() {
    ImuBiasd bias;
    bias.gyro = random_.normals<3>(0.02);
    bias.accel = random_.normals<3>(0.05);
    for (int k = 0; k < options_.keyframes; ++k) {
      SimulatedKeyframe& frame = out_.keyframes.emplace_back();
      frame.time = {k * options_.keyframe_interval.ns};
      if (k > 0) {
        const Time before = out_.keyframes[k - 1].time;
        const MeasuredMotion measured = measure_motion(options_, before, frame.time, random_, bias);
        frame.motion = measured.all;
        if (options_.frames_between) add_between(half_way(before, frame.time), measured.half);
      }
      const Motion m = motion_at(Duration{frame.time.ns}.seconds());
      frame.T_world_body = m.T_world_body, frame.v = m.v, frame.bias = bias;
    }
  }

  void add_between(Time time, const Preintegration& motion) {
    out_.between.push_back({time, motion_at(Duration{time.ns}.seconds()).T_world_body, motion, {}});
  }

  // True pixel of a point of the world in camera c at keyframe k; false where it is not in the image.
  bool see(int k, int c, const Vec3d& p_world, Vec2d& pixel) const {
    return see(out_.keyframes[k].T_world_body, c, p_world, pixel);
  }
  bool see(const Pose3d& T_world_body, int c, const Vec3d& p_world, Vec2d& pixel) const {
    const auto& mount = out_.rig.cameras[c];
    const Vec3d p_body = T_world_body.inverse() * p_world;
    const Vec3d h = transposed_times(mount.R_body_camera, p_body - mount.t_body_camera);
    return h[2] > 0.3 && mount.camera.project(h, pixel, nullptr) && pixel[0] > 0 && pixel[0] < kWidth && pixel[1] > 0 &&
           pixel[1] < kHeight;
  }

  // Draws points in front of camera 0 until one stays in view for as long as its track is to be.
  void begin_track(int k) {
    int length = options_.window;
    if (random_.uniform() > 0.63) length = std::max(3, length - 1 - static_cast<int>(random_.uniform() * 5));
    double parallax = 0.02;  // [rad]
    const auto& mount = out_.rig.cameras[0];
    for (int attempt = 0;; ++attempt) {
      if (attempt % 200 == 199) {
        if (length > 3) --length;
        parallax *= 0.7;
      }
      const Vec2d pixel = {{random_.uniform(15, kWidth - 15), random_.uniform(15, kHeight - 15)}};
      const Vec2d noisy = pixel + random_.normals<2>(0.1 * options_.pixel_sigma);
      const double depth = 1.5 * std::pow(4.0, random_.uniform());  // [m], 1.5 to 6
      const auto ray = mount.camera.unproject(pixel), bearing = mount.camera.unproject(noisy);
      if (!ray || !bearing) continue;
      const Vec3d p_camera = Vec3d{{(*ray)[0], (*ray)[1], 1.0}} * depth;
      const Vec3d p_world = out_.keyframes[k].T_world_body * (mount.R_body_camera * p_camera + mount.t_body_camera);
      if (!stays_in_view(k, std::min(length, options_.keyframes - k), p_world) || moves(k, p_world) < parallax)
        continue;
      const double guess = std::max(0.3, 1.0 + options_.depth_error * random_.normal()) / depth;
      out_.tracks.push_back({k, std::min(length, options_.keyframes - k), *bearing, 1.0 / depth, guess});
      observe(p_world);
      return;
    }
  }
  bool stays_in_view(int k, int length, const Vec3d& p_world) const {
    Vec2d pixel;
    for (int i = k; i < k + length; ++i)
      if (!see(i, 0, p_world, pixel) || !see(i, 1, p_world, pixel)) return false;
    return true;
  }
  // Angle between the rays to a point from the bodies at keyframe k and two later [rad]: without parallax a depth is
  // anybody's guess, and where its estimate ends says more about the guess than about the estimator.
  double moves(int k, const Vec3d& p_world) const {
    const Vec3d a = p_world - out_.keyframes[k].T_world_body.t;
    const Vec3d b = p_world - out_.keyframes[std::min(k + 2, options_.keyframes - 1)].T_world_body.t;
    return k + 2 < options_.keyframes ? cross(a, b).norm() / (a.norm() * b.norm()) : 1.0;
  }
  void observe(const Vec3d& p_world) {
    const SimulatedTrack& track = out_.tracks.back();
    for (int i = track.anchor; i < track.anchor + track.length; ++i) {
      SimulatedObservation o{static_cast<int>(out_.tracks.size()) - 1, {}, {}};
      see(i, 0, p_world, o.pixel0);
      see(i, 1, p_world, o.pixel1);
      o.pixel0 += random_.normals<2>(options_.pixel_sigma);
      o.pixel1 += random_.normals<2>(options_.pixel_sigma);
      out_.keyframes[i].observations.push_back(o);
    }
    for (int i = track.anchor; options_.frames_between && i + 1 < track.anchor + track.length; ++i)
      observe_between(out_.between[i], p_world);
  }
  void observe_between(SimulatedFrame& frame, const Vec3d& p_world) {
    SimulatedObservation o{static_cast<int>(out_.tracks.size()) - 1, {}, {}};
    if (!see(frame.T_world_body, 0, p_world, o.pixel0) || !see(frame.T_world_body, 1, p_world, o.pixel1)) return;
    o.pixel0 += random_between_.normals<2>(options_.pixel_sigma);
    o.pixel1 += random_between_.normals<2>(options_.pixel_sigma);
    frame.observations.push_back(o);
  }

  SimulatedWindowOptions options_;
  Random random_, random_between_;  // two, so that keyframes are the same with and without frames between them
  SimulatedWindow out_;
};

}  // namespace

SimulatedWindow simulate_window(const SimulatedWindowOptions& options) { return Simulation(options).run(); }

PredictedState predict_state(const PreintegratedImud& motion, const Pose3d& T_world_body, const Velocity3d& v,
                             const ImuBiasd& bias) {
  const Vec3d dg = bias.gyro - motion.bias.gyro, da = bias.accel - motion.bias.accel, g = kStandardGravity;
  const Vec3d dv = motion.dv + motion.dv_dg * dg + motion.dv_da * da;
  const Vec3d dp = motion.dp + motion.dp_dg * dg + motion.dp_da * da;
  const double dt = motion.dt;
  PredictedState next;
  next.T_world_body.R = (T_world_body.R * motion.dR * Rot3d::exp(motion.dR_dg * dg)).normalized();
  next.T_world_body.t = T_world_body.t + v.v * dt + g * (0.5 * dt * dt) + T_world_body.R * dp;
  next.v.v = v.v + g * dt + T_world_body.R * dv;
  return next;
}

}  // namespace oriel
