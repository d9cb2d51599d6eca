#include "oriel/testing/simulated_path.h"

#include <cmath>
#include <string>

namespace oriel {
namespace {

// a sin(w t + phase).
struct Wave {
  double a, w, phase;
  double at(double t) const { return a * std::sin(w * t + phase); }
};
// Frequencies without a common period, so that no two minutes are alike.
constexpr Wave kPosition[3][2] = {{{4.0, 0.25, 0.0}, {0.6, 0.813, 0.4}},
                                  {{3.0, 0.31, 1.0}, {0.5, 0.937, 1.7}},
                                  {{0.5, 0.9, 0.3}, {0.3, 0.417, 2.1}}};             // [m]
constexpr Wave kYaw{1.5, 0.13, 0.5}, kPitch{0.12, 0.8, 0.0}, kRoll{0.10, 0.7, 1.0};  // [rad]
constexpr double kStep = 0.1;                                                        // [s]

// How far the spline's time falls behind while its rate goes from 1 to 0 as 1 - (10 x³ - 15 x⁴ + 6 x⁵) with x from 0 to
// 1: the integral of that polynomial, its value and its slope.
struct Brake {
  double lost, share, slope;
  explicit Brake(double x)
      : lost(x * x * x * x * (2.5 - x * (3.0 - x))),
        share(x * x * x * (10.0 - x * (15.0 - 6.0 * x))),
        slope(30.0 * x * x * (1.0 - x) * (1.0 - x)) {}
};

}  // namespace

std::vector<StampedPose> procedural_flight(double seconds) {
  const Rot3d ahead = Rot3d::from_matrix({{0, 0, 1, 0, -1, 0, 1, 0, 0}});  // columns: body x up, y right, z ahead
  std::vector<StampedPose> poses;
  // Five control poses more than pieces, and one for rounding.
  const auto count = static_cast<std::int64_t>(std::ceil(seconds / kStep)) + PoseSpline::kDegree + 2;
  for (std::int64_t k = 0; k < count; ++k) {
    const double t = kStep * static_cast<double>(k);
    Pose3d T;
    for (int i = 0; i < 3; ++i) T.t[i] = kPosition[i][0].at(t) + kPosition[i][1].at(t);
    const Rot3d yaw = Rot3d::exp({{0, 0, kYaw.at(t)}}), pitch = Rot3d::exp({{0, kPitch.at(t), 0}}),
                roll = Rot3d::exp({{kRoll.at(t), 0, 0}});
    T.R = (yaw * pitch * roll * ahead).normalized();
    poses.push_back({Time{k * 100'000'000}, T});
  }
  return poses;
}

Result<SimulatedPath> SimulatedPath::make(PoseSpline spline, std::vector<Interval> rests) {
  double free_from = 0.0;
  for (std::size_t k = 0; k < rests.size(); ++k) {
    const Interval& r = rests[k];
    const double begins = r.from_s > 0.0 ? r.from_s - kRamp : r.from_s;
    if (!(begins >= free_from) || !(r.to_s >= r.from_s) || !std::isfinite(r.to_s))
      return Error{ErrorCode::bad_input, "rest " + std::to_string(k) + " from " + std::to_string(r.from_s) + " to " +
                                             std::to_string(r.to_s) + " s: expected rests in order, " +
                                             std::to_string(2.0 * kRamp) + " s or more apart"};
    free_from = r.to_s + kRamp;
  }
  SimulatedPath path;
  path.spline_ = std::move(spline);
  path.rests_ = std::move(rests);
  return path;
}

double SimulatedPath::duration() const {
  double seconds = spline_.duration();
  for (const Interval& r : rests_) seconds += r.to_s - r.from_s + (r.from_s > 0.0 ? 1.0 : 0.5) * kRamp;
  return seconds;
}

SimulatedPath::Clock SimulatedPath::clock(double t) const {
  Clock c{t, 1.0, 0.0};
  for (const Interval& r : rests_) {
    if (r.from_s > 0.0) {
      const double x = (t - r.from_s) / kRamp + 1.0;
      if (x <= 0.0) break;
      const Brake b(x < 1.0 ? x : 1.0);
      c.s -= kRamp * b.lost;
      c.rate -= b.share;
      c.acceleration -= b.slope / kRamp;
      if (x < 1.0) break;
    } else {
      c.rate -= 1.0;
    }
    c.s -= std::fmin(t, r.to_s) - r.from_s;
    if (t <= r.to_s) break;
    const double x = (t - r.to_s) / kRamp;
    const Brake b(x < 1.0 ? x : 1.0);
    c.s -= kRamp * ((x < 1.0 ? x : 1.0) - b.lost);
    c.rate += b.share;
    c.acceleration += b.slope / kRamp;
    if (x < 1.0) break;
  }
  return c;
}

PathState SimulatedPath::at(double t) const {
  const Clock c = clock(t);
  PathState x = spline_.at(c.s);
  x.acceleration_body = x.acceleration_body * (c.rate * c.rate) + x.rate_body * c.acceleration;
  x.a_world = x.a_world * (c.rate * c.rate) + x.v_world * c.acceleration;
  x.rate_body *= c.rate;
  x.v_world *= c.rate;
  return x;
}

}  // namespace oriel
