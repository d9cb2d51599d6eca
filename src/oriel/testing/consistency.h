// Runs of visual-inertial odometry over simulated worlds, for statistics of its errors against its covariances.
//
// A run is a draw of everything that the estimator takes to be random, and of nothing else: the IMU's noise, the walk
// of its biases, the noise of pixels, and the first state, whose error is drawn from the very prior that the window
// gets. So no alignment is needed: the four directions that nothing observes (position and yaw) are as uncertain as
// that prior says, in the error as in the covariance. What a window does beyond its model is off: no robust loss, no
// gate, noise as simulated.
#pragma once
#include <vector>

#include "oriel/testing/simulated_world.h"
#include "oriel/window/inertial_odometry.h"

namespace oriel {

struct ConsistencyOptions {
  SimulatedWorldOptions world;  // its seed is the run's
  OdometryOptions odometry;
  // Of the first state: the body of the simulated flight has x up, so that its first scalar is yaw.
  StartSigmas start{{{0.002, 0.01, 0.01, 0.005, 0.005, 0.005}}, 0.02, 0.002, 0.02};
  int frames_per_epoch = 10;
};

// What the defaults above should be: a stereo flight of `seconds`, a window of 8 keyframes, all that is no model off.
ConsistencyOptions consistency_options(double seconds);

// The newest state's error, truth ⊟ estimate, and the covariance that the window claims for it.
struct ConsistencySample {
  double t = 0.0;        // since the start [s]
  Vec<double, 9> error;  // [rotation; translation; velocity] [rad] [m] [m/s], in the tangent of the estimate
  Mat<double, 9, 9> covariance;
};

struct ConsistencyRun {
  std::vector<ConsistencySample> samples;  // one an epoch
  std::int64_t dropped = 0;                // sightings, landmarks and factors: 0, or the model was not all there was
};

// Error: options that make no world; an update that failed; a covariance that is not there.
Result<ConsistencyRun> consistency_run(const ConsistencyOptions& options, std::uint64_t seed);

}  // namespace oriel
