// What an update of the window has to compute, counted: flops of each stage, and the bytes that it reads and writes if
// every array is touched once in a pass. No solver of this kind (Schur complement, Cholesky) does with much less.
#pragma once
#include "benchmarks/support/window_race.h"

namespace oriel::benchmark {

// A window as it is solved.
struct WindowCounts {
  int states = 0, landmarks = 0;
  int pairs = 0;              // reprojections that name two states
  int anchors = 0;            // and those in the anchor's other camera
  double schur_entries = 0;   // Σ over landmarks of n (n + 1), n: scalars of the poses that see it
  double schur_scalars = 0;   // Σ n
  int leaving_landmarks = 0;  // those of the oldest state, and the same of them
  int leaving_pairs = 0;
  double leaving_entries = 0;
  int pose_dim() const { return 6 * states; }
  int kept_dim() const { return 15 * states; }
  int prior_dim() const { return 6 * (states - 1) + 9; }  // all poses that stay, and one velocity with biases
};
// The window whose newest state is keyframe `newest`, or the frame after the one before it.
WindowCounts count_window(const WindowData& data, const WindowOptions& options, int newest, bool keyframe);

struct Work {
  double flops = 0.0, bytes = 0.0;
};
struct WindowWork {
  Work evaluate, linearize, eliminate, factor, solve, fold;
  double flops() const {
    return evaluate.flops + linearize.flops + eliminate.flops + factor.flops + solve.flops + fold.flops;
  }
};
// factor_flops: of one factorization, velocities and biases first along the chain, as the solver's symbolic part has
// counted it.
WindowWork window_work(const WindowCounts& counts, const WindowOptions& options, double factor_flops, bool keyframe);

// What one core is taken to do in such small blocks [flop/s]: the floor is flops over this.
inline constexpr double kFloorRate = 12e9;

}  // namespace oriel::benchmark
