// One YAML file that says how a recording is run: what works, where it works, and every setting of the estimator.
#pragma once
#include <string>
#include <vector>

#include "oriel/run/assembled_window.h"
#include "oriel/run/run_names.h"
#include "oriel/run/two_frame_task.h"
#include "oriel/window/odometry_options.h"

namespace oriel {

struct RunConfig {
  std::string task = "inertial_odometry";  // what a recording is run through
  std::string engine = "native";           // of the solves
  ExecutorKind executor = ExecutorKind::in_place;
  Duration time_limit{0};             // of a job [ns]; 0: none
  std::uint64_t memory_limit_mb = 0;  // of a worker's process; 0: none
  std::uint64_t cpu_limit_s = 0;      // of a worker's process, in all its jobs [s]; 0: none
  Duration spin{1'000'000};           // that a wait for a result looks for it instead of sleeping [ns]
  int retries = 3;                    // of a job whose worker was lost,
  bool retry_late = false;            // and of one that was not done within time_limit
  bool defer = false;                 // solves go on beside the updates
  OdometryOptions odometry;           // of inertial_odometry
  TwoFrameOptions two_frame;          // of two_frame
  WindowPlan window;                  // of sliding_window
  // Of the tasks that bring settings of their own, by name (NamedTask).
  std::vector<std::pair<std::string, AnyOptions>> own;
  template <class O>
  const O& options_of(std::string_view own_task) const {
    for (const auto& [name, options] : own)
      if (name == own_task) return options.template as<O>();
    contract_violated("RunConfig: the task has no options of its own");
  }
};
// What it says of workers. `zygote`: null where the executor is no process.
ExecutorOptions worker_options(const RunConfig& config, Zygote* zygote);

// With the defaults of the tasks that bring settings, and the parts that a window has by default.
RunConfig default_run_config(const RunNames& names);

// The config, checked whole: wrong types, numbers out of their range or their order, unknown names, missing and unknown
// keys, an engine or executor that the task cannot have, each an error with file and line; a window is put together,
// for sensors of all kinds, to see whether its parts fit. Empty errors: all is well. The keys `task` and `executor`
// must be there; all others have defaults. Sections of other tasks are checked and have no effect.
struct RunConfigReading {
  RunConfig config;
  std::vector<Error> errors;
};
RunConfigReading read_run_config(const std::string& path, const RunNames& names = shipped_names());
RunConfigReading parse_run_config(std::string text, const std::string& name, const RunNames& names = shipped_names());

// Every key with its value in `config`, its unit and a sentence, as a file that read_run_config takes.
std::string run_config_text(const RunConfig& config, const RunNames& names = shipped_names());
std::string run_config_text(const RunNames& names = shipped_names());  // of the defaults

}  // namespace oriel
