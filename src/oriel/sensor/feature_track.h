// What a tracker hands over: in a frame, where each of its tracks was seen.
#pragma once
#include <cstdint>
#include <span>

#include "oriel/base/matrix.h"
#include "oriel/base/time.h"

namespace oriel {

// One point in one frame, in raw (distorted) pixels. Camera 0 sees every track; camera 1 where the stereo match held.
struct FeatureObservation {
  std::int64_t track = 0;
  Vec2d pixel0 = Vec2d::zero(), pixel1 = Vec2d::zero();  // [px]
  bool has_right = false;                                // pixel1 was measured
};

struct StereoFrame {
  Time time;
  std::span<const FeatureObservation> features;  // each track once
};

}  // namespace oriel
