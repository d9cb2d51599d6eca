// One YAML file that says how a recording is run: what works, where it works, and every setting of the estimator.
#pragma once
#include <string>
#include <vector>

#include "oriel/run/executor.h"
#include "oriel/run/two_frame_task.h"
#include "oriel/window/odometry_options.h"

namespace oriel {

// What a recording is run through: the sliding window, or two-frame tasks (run/two_frame_odometry.h).
enum class RunTask { inertial_odometry, two_frame };

struct RunConfig {
  RunTask task = RunTask::inertial_odometry;
  std::string engine = "native";  // of the solves
  ExecutorKind executor = ExecutorKind::in_place;
  Duration time_limit{0};             // of a job [ns]; 0: none
  std::uint64_t memory_limit_mb = 0;  // of a worker's process; 0: none
  OdometryOptions odometry;           // of inertial_odometry
  TwoFrameOptions two_frame;          // of two_frame
};

// The config, checked whole: wrong types, numbers out of their range, missing and unknown keys, each an error with file
// and line. Empty errors: all is well. The keys `task` and `executor` must be there; all others have defaults.
struct RunConfigReading {
  RunConfig config;
  std::vector<Error> errors;
};
RunConfigReading read_run_config(const std::string& path);
RunConfigReading parse_run_config(std::string text, const std::string& name);

// Every key with its value in `config`, its unit and a sentence, as a file that read_run_config takes.
std::string run_config_text(const RunConfig& config = {});

}  // namespace oriel
