// The pose of one frame from its matches with another, weighted by the covariances of both sides, as a task that runs
// in place, in a thread or in a process (run/task.h).
//
// A match is a point known in the body frame of `a` with its covariance, and what the cameras of `b` see of it. Four
// kinds of residual, by option:
//   points     e = p_a - T_a_b p_b with Σ = Σ_a + R_ab Σ_b R_abᵀ (Generalized-ICP, residual/registration.h)
//   pixel      of the left camera
//   disparity  left pixel and disparity
//   stereo     the pixels of both cameras; of the left one where the right has none
// the last three with Σ = Σ_px + M Σ_a Mᵀ (residual/matched_point.h). R_ab and M are those of the estimate that a round
// begins with, held in the round and taken anew in the next: a Σ that moves with the estimate would reward poses that
// make it large. A round leaves out what is beyond the gate and weighs the rest with Huber's loss.
//
// The first round begins where refine_pose and, if too few points agree, relocate find a start in pixels: gross errors
// are out before covariances count.
#pragma once
#include <string>
#include <vector>

#include "oriel/run/transfer.h"
#include "oriel/solve/summary.h"
#include "oriel/window/visual_map.h"

namespace oriel {

enum class MatchResidual : std::uint8_t { points, pixel, disparity, stereo };
// In which coordinates the problem is written down: those of frame a, or world. The results are the same to rounding.
enum class MatchCoordinates : std::uint8_t { previous, world };
// What is known of a point: what frame a alone saw of it, or what all frames up to a say (the map's points).
enum class MatchSource : std::uint8_t { previous, map };

struct TwoFrameOptions {
  MatchResidual residual = MatchResidual::stereo;
  MatchCoordinates coordinates = MatchCoordinates::previous;
  MatchSource source = MatchSource::map;
  bool robust_start = true;     // else it begins at the guess
  int least_observations = 10;  // a pose is found from
  double pixel_sigma = 0.3;     // of a coordinate of a pixel, where the recording says nothing [px]
  double huber = 1.5;           // [sigma]
  double gate = 4.0;            // of ‖r‖/√dim of a match: beyond it is left out of a round, and no inlier [sigma]
  int rounds = 3;
  int max_iterations = 30;            // of a round
  double greatest_depth_share = 0.5;  // of a point that is made: σ of its depth over the depth
};

struct PointMatch {
  std::uint32_t observation = 0;  // row of the map, in b
  std::uint32_t has_right = 0, has_point = 0;
  Vec3d p_a;           // [m] in the body of a
  Mat3d covariance_a;  // [m²]
  Vec2d pixel0, pixel1;
  Mat2d covariance0, covariance1;  // [px²]
  Vec3d p_b;                       // what both cameras of b say, where has_point
  Mat3d covariance_b;
};

struct TwoFrameInput {
  std::uint32_t frame_a = 0, frame_b = 0;
  std::uint32_t observations = 0;  // of frame b, matched or not
  Pose3d T_world_a, T_a_b;         // T_a_b: a guess
  std::vector<PointMatch> matches;
};

struct TwoFrameFigures {
  double initial_cost = 0.0, final_cost = 0.0;  // of the last round
  int iterations = 0;                           // of all rounds
  int matches = 0, inliers = 0;
};

struct TwoFrameOutput {
  std::uint32_t frame_a = 0, frame_b = 0;
  // solved; few where there are not enough matches, none among them; no_agreement; failed.
  FrameStatus status = FrameStatus::few;
  std::string reason = {};           // one line
  Pose3d T_a_b, T_world_b;           // as the guess unless solved
  Mat6d covariance = Mat6d::zero();  // of T_a_b given the points, tangent on the right [rad] [m]
  TwoFrameFigures figures;
  std::vector<std::uint32_t> inlier_observations = {};  // rows of the map, rising
};

struct TwoFrameTask {
  static constexpr const char* kName = "two_frame";
  struct Config {
    TwoFrameOptions options;
    StereoRigd rig;
  };
  struct Context {  // nothing is kept from job to job, so that a lost worker loses nothing
    TwoFrameOptions options;
    StereoRigd rig;
  };
  using Input = TwoFrameInput;
  using Output = TwoFrameOutput;
  struct Map {
    VisualMap visual;
    TwoFrameOutput last;  // of the last job that was written back
  };

  // An error: options that make no sense, or a rig without two cameras' focal lengths.
  static Result<Context> init_context(const Config& config);
  // Matches of frame b with frame a, which must have a pose; `point_of` says which point of the map an observation of b
  // is one of, kNoRow for none. Their rows rise.
  Input collect(const VisualMap& map, std::uint32_t a, std::uint32_t b, const Pose3d& T_a_b,
                const TwoFrameOptions& options, const std::vector<std::uint32_t>& point_of) const;
  static Output optimize(Context& context, const Input& input);
  // The pose, its covariance and which observations agree, if it was solved; else the frame's status alone.
  static void write(const Output& output, Map& map);
};

// One line where options make no sense; empty where all is well.
std::string fault_of(const TwoFrameOptions& options);

}  // namespace oriel
