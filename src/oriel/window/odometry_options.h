// Settings of visual-inertial odometry. The defaults are what the command uses, for every recording.
#pragma once
#include "oriel/base/time.h"
#include "oriel/residual/loss.h"
#include "oriel/solve/options.h"
#include "oriel/window/standstill_hook.h"

namespace oriel {

// Which frames stay in the window. Others are states while they are the newest, then give way to the next frame.
struct KeyframeOptions {
  double parallax = 0.05;            // median angle by which tracks moved since the last keyframe [rad]
  double least_shared = 0.6;         // share of the frame's tracks that the last keyframe saw [-]
  Duration interval{1'000'000'000};  // since the last keyframe [ns]
  int max_keyframes = 12;            // in the window; the oldest is marginalized when there are more
  int expected_tracks = 300;         // in a frame: more are welcome, but may ask for memory in an update
};

// What a landmark is in the graph. An inverse depth along the bearing of its first sighting is one scalar; it takes
// that bearing for exact, and the window claims to know more than it does (docs/estimator.md has the figures). A point
// has three, for which every sighting is a measurement with its noise: the covariances are honest. A point that one
// camera sees with little parallax has no depth to speak of and is far from linear: by_cameras is points where there
// are two and inverse depths where there is one (docs/decisions/0015-landmarks.md).
enum class LandmarkModel { by_cameras, inverse_depth, point };

struct VisualOptions {
  LandmarkModel landmarks = LandmarkModel::by_cameras;
  double pixel_sigma = 1.0;  // of a coordinate [px]
  Loss loss = Cauchy(2.0);   // scale in sigmas of one camera's coordinates
  double gate = 5.0;         // a sighting whose error in either camera is longer is taken out after the solve [px]
  double match_gate = 15.0;  // a sighting of a known point further off is no match, where the frame's pose is sure [px]
  double start_gate = 30.0;  // a landmark does not start while a sighting is further off [px]
  double least_depth = 0.2, greatest_depth = 150.0;  // [m]
  double least_parallax = 0.003;                     // of a landmark's rays [rad],
  double least_mono_parallax = 0.012;                // where one camera alone saw it [rad]
  double refine_above = 4.0;  // median error of a predicted pose above which it is refined before the solve [px]
};

struct InertialOptions {
  // What multiplies the densities of the sensor's data sheet: it leaves out vibration, scale and axis errors.
  double noise_factor = 8.0, walk_factor = 1.0;
  Loss loss = Huber(10.0);  // of a link's 15 scalars together [sigmas]: no noise reaches it, a saturated sensor does
  double gravity = 9.81;    // [m/s²]
  double gyro_bias_sigma = 0.01, accel_bias_sigma = 0.1;  // of the first state [rad/s] [m/s²]
};

struct InitialisationOptions {
  Duration still{1'000'000'000};                   // standstill at least as long starts the window at rest [ns]
  Duration block{500'000'000};                     // over which the IMU is averaged to see whether it is still [ns]
  double still_gyro = 0.01;                        // how far the averages of blocks may lie apart [rad/s]
  double still_accel = 0.1;                        // [m/s²]
  double still_pixels = 3.0;                       // how far tracks may move in the meantime, in the median [px]
  Duration moving{1'500'000'000};                  // of frames, where it starts in motion [ns]
  int least_frames = 5;                            // with a known relative pose
  int least_inliers = 8;                           // points that a relative pose is found from
  double gravity_tolerance = 1.0;                  // of the length of the gravity that is found [m/s²]
  Duration longest{4'000'000'000};                 // frames that are older are given up [ns]
  double position_sigma = 1e-3, yaw_sigma = 1e-3;  // of the first pose: where and how the world is put [m] [rad]
  double tilt_sigma = 0.1;                         // roll and pitch are for gravity to say [rad]
  double rest_velocity_sigma = 0.02;               // at standstill [m/s]
};

struct OdometryOptions {
  KeyframeOptions keyframes;
  VisualOptions visual;
  InertialOptions inertial;
  InitialisationOptions initialisation;
  // At rest: tracks since the last keyframe that is `span` old or older move by their noise alone, twice. [px] [m/s]
  StandstillOptions rest = {.pixels = 3.0, .velocity_sigma = 0.02, .rotation_sigma = 0.01, .translation_sigma = 0.01};
  int max_iterations = 12;           // of an update
  double function_tolerance = 1e-4;  // relative decrease of cost that ends an update
  int most_missed_frames = 3;        // without IMU samples, before the window starts anew
  int most_failed_solves = 3;        // one after the other, before the window starts anew
  // Beyond these no estimate is believed, and the window starts anew.
  double greatest_speed = 100.0, greatest_gyro_bias = 1.0, greatest_accel_bias = 5.0;  // [m/s] [rad/s] [m/s²]
  bool keep_trajectory = true;  // every pose for causal() and final(); a robot that runs for weeks keeps its own
  bool first_estimates = true;
};

}  // namespace oriel
