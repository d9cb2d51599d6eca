// A recording through the sliding window, as fast as it goes, and how good that was.
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "oriel/io/recording.h"
#include "oriel/run/executor.h"
#include "oriel/window/odometry_options.h"

namespace oriel::apps {

struct RunOptions {
  OdometryOptions odometry;
  std::string engine = "native";  // one that this program has, for the window's solves
  // Where the window's solves run; all but in place for the native engine alone.
  ExecutorKind executor = ExecutorKind::in_place;
  ExecutorOptions worker;
  bool defer = false;         // an update begins a solve and returns; the next one merges it
  double front_end_ms = 0.0;  // CPU time that is burnt before each frame, in the place of a front end
  std::string journal;        // file that every edit and solve is written to; empty: none
  bool progress = false;      // a line on standard error
};

struct RunReport {
  std::string recording;
  double duration_s = 0.0;  // from the first frame to the last
  std::int64_t states = 0;  // frames with an estimate
  std::int64_t updates = 0;
  std::int64_t solves_refused = 0;  // by an engine that cannot, or because their worker was lost
  double frames_per_second = 0.0;   // of everything, the front end included
  double update_ms_p50 = 0.0, update_ms_p99 = 0.0, update_ms_p999 = 0.0, update_ms_max = 0.0;
  double initialised_after_s = 0.0;  // NaN: never
  double coverage = 0.0;             // share of the frames after initialisation that have an estimate
  double ate_m = 0.0, ate_final_m = 0.0, ate_deg = 0.0;       // SE(3)-aligned; NaN without truth. ate_deg is causal
  double path_m = 0.0;                                        // of the truth where there is one, else of the estimate
  std::vector<std::pair<std::string, std::int64_t>> dropped;  // by reason
  double allocations_per_update = 0.0;                        // mean over the updates from the first full window on
  double peak_rss_mb = 0.0;
  std::vector<std::string> warnings;
  std::vector<TumPose> causal, final;  // each pose at the moment of its own update; and when it left the window
};

// Errors: a recording that has no cameras, IMU samples or frames; a journal that can't be written.
Result<RunReport> run_recording(const Recording& recording, const RunOptions& options);

std::string to_json(const RunReport& report);
std::string to_text(const RunReport& report);  // a few lines for people

}  // namespace oriel::apps
