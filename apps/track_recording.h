// A recording through two-frame tasks, and how good that was.
#pragma once
#include <string>
#include <vector>

#include "oriel/io/recording.h"
#include "oriel/io/run_config.h"
#include "oriel/run/two_frame_odometry.h"

namespace oriel::apps {

// Where the results of a command go; empty: nowhere.
struct TrackTargets {
  std::string json, out, map;
};

struct TrackReport {
  std::string recording;
  double duration_s = 0.0;  // from the first frame to the last
  TwoFrameStatistics statistics;
  std::int64_t points = 0;
  double frame_ms_p50 = 0.0, frame_ms_p99 = 0.0, frame_ms_max = 0.0;
  double ate_m = 0.0, ate_deg = 0.0, path_m = 0.0;  // SE(3)-aligned; NaN without truth
  std::vector<std::string> warnings;
  std::vector<TumPose> trajectory;  // of every frame
  VisualMap map;
};

// An error: a recording without two cameras or without frames; what TwoFrameOdometry::start says. A process needs the
// zygote. `progress`: a line on standard error.
Result<TrackReport> track_recording(const Recording& recording, const RunConfig& config, Zygote* zygote, bool progress);

// Reads the folder, tracks, and writes what is asked for. Returns an exit code.
Result<int> track_and_report(const RunConfig& config, const std::string& folder, const TrackTargets& targets);

std::string to_json(const TrackReport& report);
std::string to_text(const TrackReport& report);

}  // namespace oriel::apps
