// A visual-inertial stream made of formulas: a smooth trajectory, an IMU with noise and walking biases, and tracks of
// landmarks, from a seed. Benchmarks and tests run windows over it for as long as they like, with the truth at hand.
//
// The same options give the same numbers with every compiler and standard library (up to the last bits of libm).
#pragma once
#include <cstdint>
#include <vector>

#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"
#include "oriel/sensor/preintegration.h"
#include "oriel/sensor/stereo_rig.h"

namespace oriel {

struct SimulatedWindowOptions {
  std::uint64_t seed = 1;
  int keyframes = 100;                      // of the stream
  int window = 10;                          // keyframes that a window holds: no track is longer
  int landmarks = 150;                      // anchored in a full window
  Duration keyframe_interval{250'000'000};  // [ns]
  Duration imu_interval{5'000'000};         // [ns]
  double pixel_sigma = 1.0;                 // of each coordinate of an observation [px]
  double depth_error = 0.1;                 // of the first guess of an inverse depth, relative
  ImuNoise imu{1.7e-4, 2.0e-3, 1.9e-5, 3.0e-3};
  bool frames_between = false;  // a frame half way between two keyframes; the keyframes are the same without
};

// A landmark, seen in `length` successive keyframes from the one that anchors it on.
struct SimulatedTrack {
  int anchor = 0, length = 0;  // keyframes
  Vec2d bearing;               // of the anchor observation, undistorted [x/z, y/z]
  double inverse_depth = 0.0;  // true [1/m]
  double first_guess = 0.0;    // of the inverse depth, with its error [1/m]
};

struct SimulatedObservation {
  int track = 0;
  Vec2d pixel0, pixel1;  // in both cameras [px]
};

struct SimulatedKeyframe {
  Time time;
  Pose3d T_world_body;    // the truth: pose,
  Velocity3d v;           // velocity,
  ImuBiasd bias;          // and biases
  Preintegration motion;  // measured, from the keyframe before this one; nothing in the first
  std::vector<SimulatedObservation> observations;
};

// A frame that is no keyframe, half way to the next one.
struct SimulatedFrame {
  Time time;
  Pose3d T_world_body;                             // the truth
  Preintegration motion;                           // measured, from the keyframe before
  std::vector<SimulatedObservation> observations;  // of tracks that both keyframes beside it see
};

struct SimulatedWindow {
  StereoRigd rig;
  std::vector<SimulatedTrack> tracks;  // in the order of their anchors
  std::vector<SimulatedKeyframe> keyframes;
  std::vector<SimulatedFrame> between;  // after each keyframe but the last, where they were asked for
};

SimulatedWindow simulate_window(const SimulatedWindowOptions& options);

// What the IMU says of the next keyframe ([F] eq. 33 the other way round; biases are taken to stay).
struct PredictedState {
  Pose3d T_world_body;
  Velocity3d v;
};
PredictedState predict_state(const PreintegratedImud& motion, const Pose3d& T_world_body, const Velocity3d& v,
                             const ImuBiasd& bias);

}  // namespace oriel
