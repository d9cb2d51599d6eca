// What both sides of the window benchmark are told, and what they report of each slide.
#pragma once
#include <cstdint>
#include <string_view>
#include <vector>

#include "oriel/residual/imu_residual.h"
#include "oriel/residual/loss.h"
#include "oriel/solve/summary.h"
#include "oriel/testing/simulated_window.h"

namespace oriel::benchmark {

struct WindowOptions {
  bool stereo = true;
  int window = 10;     // keyframes at the solve
  int iterations = 4;  // of Levenberg–Marquardt, accepted or rejected
  double initial_lambda = 1e-4;
  bool first_estimates = true;  // all Jacobians at first estimates, where a prior has fixed them
  double pixel_sigma = 1.0;     // [px]
  Loss loss;                    // of reprojections
  // Stages of Oriel by the thread's CPU time, on a busy machine: reading it takes a call of the system each time, about
  // 1 % of an update. Else by the wall.
  bool cpu_stages = false;
};

// Without stereo a landmark comes into the window with its third observation, all of them at once.
inline constexpr int kMonoObservations = 3;

// How well the first state is known.
inline constexpr double kStartRotation = 1e-3, kStartPosition = 1e-3, kStartVelocity = 1e-2;  // [rad, m, m/s]
inline constexpr double kStartGyroBias = 1e-2, kStartAccelBias = 5e-2;                        // [rad/s, m/s²]

// One reprojection: an observation of a track at a keyframe.
struct View {
  int track = 0, keyframe = 0;
  const SimulatedObservation* observation = nullptr;
};

// What is made from measurements before any clock runs.
struct WindowData {
  SimulatedWindow stream;
  std::vector<std::vector<View>> views;  // by the keyframe with which they come into the window
  std::vector<FullNoise<15>> imu_noise;  // by keyframe; nothing in the first
  // The same of the frame after each keyframe. Its views name the next keyframe, whose place it takes for one update.
  std::vector<std::vector<View>> between_views;
  std::vector<FullNoise<15>> between_noise;
};

// The state of the first keyframe, off the truth by about what its prior says.
struct FirstState {
  Pose3d T_world_body;
  Velocity3d v;
  ImuBiasd bias;
};
FirstState first_state(const WindowData& data);
WindowData simulate(const SimulatedWindowOptions& options, bool stereo);

// Of one update: of a keyframe, which stays until it is the oldest, or of another frame, which is optimised with the
// window and gives way.
struct SlideReport {
  double initial_cost = 0.0, final_cost = 0.0;
  int iterations = 0;
  int landmarks = 0, reprojections = 0, residual_rows = 0;
  int prior_cols = 0;
  double factor_flops = 0.0, schur_flops = 0.0;  // of one iteration, as the solver reports them
  // [s]; build: edits and their application, or the Problem; fold: marginalization and the slide itself, or the removal
  // of the frame.
  double build = 0.0, solve = 0.0, fold = 0.0;
  double wall = 0.0, cpu = 0.0;  // of the whole update
  // Inside of `solve` [s]. Ceres has no more than structure (its preprocessing), evaluate, linearize and solve.
  StageTimes stages;
};

}  // namespace oriel::benchmark
