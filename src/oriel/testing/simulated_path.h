// The way of a simulated body: a spline, along which time may stand still for a while.
#pragma once
#include <vector>

#include "oriel/testing/pose_spline.h"

namespace oriel {

struct Interval {
  double from_s = 0.0, to_s = 0.0;  // since the start of the world
};

// A flight of formulas: some metres to and fro at about 1 m/s, for as long as one likes. Body z looks ahead, body x up,
// as EuRoC's IMU is mounted. The first stamp is 0.
std::vector<StampedPose> procedural_flight(double seconds);

class SimulatedPath {
 public:
  SimulatedPath() = default;
  // The body does not move in any of `rests`, and slows down and speeds up again within kRamp [s] before and after
  // (but for one that begins at 0): what it would have done then it does later. Error: rests that overlap with their
  // ramps, or that are not in order.
  static Result<SimulatedPath> make(PoseSpline spline, std::vector<Interval> rests);
  static constexpr double kRamp = 1.0;

  // How long the way takes with its rests [s].
  double duration() const;
  PathState at(double t) const;

 private:
  struct Clock {
    double s, rate, acceleration;  // time of the spline [s], and its derivatives by the world's
  };
  Clock clock(double t) const;

  PoseSpline spline_;
  std::vector<Interval> rests_;
};

}  // namespace oriel
