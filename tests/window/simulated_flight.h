// A flight in a room of points, for tests of the odometry: raw IMU samples and stereo tracks with noise, from a seed.
#pragma once
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"
#include "oriel/sensor/feature_track.h"
#include "oriel/sensor/imu.h"
#include "oriel/sensor/stereo_rig.h"

namespace oriel {

struct FlightOptions {
  double rest_s = 0.0;  // at the start
  double glide = 0.0;   // an even motion besides, from the start on [m/s]
  double duration_s = 12.0;
  double frame_interval_s = 0.1;
  double pixel_sigma = 0.5;    // [px]
  double gross_errors = 0.01;  // share of observations that are anywhere in the image
  int points = 700;
  std::uint64_t seed = 1;
};

class SimulatedFlight {
 public:
  explicit SimulatedFlight(const FlightOptions& options) : o_(options), random_(options.seed) {
    const RadTanCamerad camera{458.0, 457.0, 367.0, 248.0, -0.283, 0.074, 0.0002, 0.00002};
    rig.cameras[0] = {camera, Pose3d{Rot3d::exp({{0.01, -0.02, 0.01}}), {{0.0, -0.05, 0.02}}}};
    rig.cameras[1] = {camera, Pose3d{Rot3d::exp({{0.0, -0.01, 0.02}}), {{0.11, -0.05, 0.02}}}};
    for (int k = 0; k < o_.points; ++k) points_.push_back(wall_point());
    make_imu();
    for (int k = 0; k * o_.frame_interval_s <= o_.duration_s; ++k) make_frame(k * o_.frame_interval_s);
  }

  struct Frame {
    Time time;
    std::vector<FeatureObservation> features;
  };
  StereoRigd rig;
  ImuNoise noise{1.7e-4, 2.0e-3, 1.9e-5, 3.0e-4};
  ImuBiasd bias{{{0.002, -0.02, 0.07}}, {{0.02, 0.05, -0.03}}};
  std::vector<ImuSample> imu;
  std::vector<Frame> frames;

  static Time time_of(double t) { return Time{1'403'636'579'000'000'000} + Duration::from_seconds(t); }
  // T_world_body; the body's z looks ahead, its y down.
  Pose3d pose(double t) const {
    const double s = std::fmax(0.0, t - o_.rest_s), u = s * s / (s + 1.0);  // starts without a jump in velocity
    const Rot3d ahead = Rot3d::from_matrix({{0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0}});
    const Rot3d turn = Rot3d::exp({{0.0, 0.0, 0.5 * std::sin(0.7 * u)}});
    const Rot3d sway = Rot3d::exp({{0.1 * std::sin(1.3 * u), 0.08 * std::sin(0.9 * u), 0.0}});
    return {(turn * ahead * sway).normalized(),
            {{0.8 * std::sin(0.6 * u), o_.glide * t + 0.7 * std::sin(0.8 * u) * std::cos(0.3 * u),
              0.4 * std::sin(0.5 * u)}}};
  }

 private:
  double normal(double sigma) { return sigma * std::normal_distribution<double>()(random_); }
  double uniform(double a, double b) { return std::uniform_real_distribution<double>(a, b)(random_); }

  Vec3d wall_point() {  // on one of the walls of a room of 10 × 8 × 5 m
    Vec3d p = {{uniform(-5.0, 5.0), uniform(-4.0, 4.0), uniform(-2.5, 2.5)}};
    if (uniform(0.0, 1.0) < 0.6)
      p[0] = 5.0;
    else
      p[1] = p[1] < 0.0 ? -4.0 : 4.0;
    return p;
  }

  void make_imu() {
    constexpr double kStep = 0.005, h = 1e-3;
    for (int k = 0; k * kStep <= o_.duration_s + 0.1; ++k) {
      const double t = k * kStep;
      const Pose3d before = pose(t - h), now = pose(t), after = pose(t + h);
      const Vec3d w = (before.R.inverse() * after.R).log() / (2.0 * h);
      const Vec3d a = (after.t - now.t * 2.0 + before.t) / (h * h);
      ImuSample s{time_of(t), w + bias.gyro, now.R.inverse() * (a - kStandardGravity) + bias.accel};
      for (int i = 0; i < 3; ++i) {
        s.gyro[i] += normal(noise.gyro / std::sqrt(kStep));
        s.accel[i] += normal(noise.accel / std::sqrt(kStep));
      }
      imu.push_back(s);
    }
  }

  bool project(const Pose3d& T, int camera, const Vec3d& p_world, Vec2d& pixel) {
    const auto& mount = rig.cameras[camera];
    const Vec3d h = mount.T_body_camera().inverse() * (T.inverse() * p_world);
    if (h[2] < 0.3 || !mount.camera.project(h, pixel, nullptr)) return false;
    for (int i = 0; i < 2; ++i) pixel[i] += normal(o_.pixel_sigma);
    return pixel[0] > 0.0 && pixel[0] < 752.0 && pixel[1] > 0.0 && pixel[1] < 480.0;
  }

  void make_frame(double t) {
    Frame frame{time_of(t), {}};
    const Pose3d T = pose(t);
    for (std::size_t k = 0; k < points_.size(); ++k) {
      FeatureObservation f;
      f.track = static_cast<std::int64_t>(k);
      if (!project(T, 0, points_[k], f.pixel0)) continue;
      f.has_right = project(T, 1, points_[k], f.pixel1);
      if (uniform(0.0, 1.0) < o_.gross_errors) f.pixel0 = {{uniform(0.0, 752.0), uniform(0.0, 480.0)}};
      frame.features.push_back(f);
    }
    frames.push_back(frame);
  }

  FlightOptions o_;
  std::mt19937_64 random_;
  std::vector<Vec3d> points_;
};

}  // namespace oriel
