// InertialOdometry where the body stands still, and one camera sees it (two see depth at rest too).
#include <algorithm>
#include <cmath>

#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/window/inertial_odometry.h"

namespace oriel {
namespace {

constexpr std::size_t kLeastShared = 8;  // tracks that say whether they moved

}  // namespace

// The keyframe since which nothing moved, or none. An even glide is rest to an IMU: the cameras see the difference, but
// for a fast one far from everything, which the speed tells. (Predicted across a long rest, it is what the biases make
// of it: then that of the state before is asked.)
std::optional<InertialState> InertialOdometry::at_rest_since(Time time, const InertialValues& predicted) const {
  const StandstillOptions& o = options_.rest;
  const double speed = std::fmin(predicted.velocity.v.norm(), values(*timeline_.latest()).velocity.v.norm());
  if (!(speed <= o.speed)) return std::nullopt;
  const InertialState* before = nullptr;
  for (const InertialState& s : timeline_)
    if (s.keyframe && s.time <= time - o.span) before = &s;
  if (before == nullptr) return std::nullopt;
  const auto samples = imu_.between(time - o.span, time);
  if (samples.empty() || samples.front().time > time - o.span) return std::nullopt;
  if (!StandstillHook::are_still(samples, predicted.bias, o)) return std::nullopt;
  return median_motion_since(before->time) <= o.pixels ? std::optional(*before) : std::nullopt;
}

// An IMU's noise looks like motion, and what one camera sees at rest has no depth: nothing else holds the state.
void InertialOdometry::hold(GraphEdit& edit, const InertialState& before, const InertialState& state) const {
  const double r = options_.rest.rotation_sigma, t = options_.rest.translation_sigma;
  edit.add(Prior{Velocity3d{}}, Sigma(options_.rest.velocity_sigma), state.velocity);
  edit.add(Between{Pose3d{}}, Sigmas(Vec6d{{r, r, r, t, t, t}}), before.pose, state.pose);
}

// Of the tracks that a state and the newest frame share, in the median [px]; infinite where these are too few.
double InertialOdometry::median_motion_since(Time earlier) const {
  scratch_.clear();
  for (const std::uint32_t place : seen_) {
    const Track& t = map_.track(place);
    for (const Sighting& s : t.sightings)
      if (s.time == earlier) scratch_.push_back((t.sightings.back().pixel0 - s.pixel0).norm());
  }
  if (scratch_.size() < kLeastShared) return HUGE_VAL;
  const auto middle = scratch_.begin() + static_cast<std::ptrdiff_t>(scratch_.size() / 2);
  std::nth_element(scratch_.begin(), middle, scratch_.end());
  return *middle;
}

}  // namespace oriel
