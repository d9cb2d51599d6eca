// oriel run RECORDING
#include <unistd.h>

#include <CLI/App.hpp>
#include <cmath>
#include <cstdio>
#include <memory>

#include "apps/arguments.h"
#include "apps/command.h"
#include "apps/commands.h"
#include "apps/engine_choice.h"
#include "apps/landmark_option.h"
#include "apps/recording_run.h"
#include "apps/run_recording.h"
#include "apps/run_window.h"
#include "apps/track_recording.h"
#include "oriel/io/run_config.h"
#include "oriel/run/solve_beside.h"

namespace oriel::apps {
namespace {

struct RunArguments {
  std::string recording, engine = "native", executor = "inline", config, json, out, journal, landmarks = "by-cameras";
  bool defer = false;
  double front_end_ms = 0.0;
};

// The config where one is given; then what the command line says beside it.
RunConfigReading settings(const CLI::App& command, const RunArguments& a) {
  RunConfigReading reading;
  if (!a.config.empty()) reading = read_run_config(a.config);
  RunConfig& c = reading.config;
  if (command.count("--engine") > 0) c.engine = a.engine;
  if (command.count("--executor") > 0) c.executor = *executor_kind(a.executor);
  if (a.defer) c.defer = true;
  if (command.count("--landmarks") > 0) c.odometry.visual.landmarks = landmark_model(a.landmarks);
  return reading;
}

Result<int> run_and_report(const RunConfig& config, const RunArguments& a) {
  for (const std::string& target : {a.json, a.out, a.journal})
    if (auto ok = check_target(target); !ok) return ok.error();
  auto zygote = zygote_for(config.executor, SolveBeside::kTask);
  if (!zygote) return zygote.error();
  const Result<Recording> recording = read_recording(a.recording);
  if (!recording) return recording.error();
  RunOptions options;
  options.odometry = config.odometry;
  options.engine = config.engine;
  options.executor = config.executor;
  options.defer = config.defer;
  options.front_end_ms = a.front_end_ms;
  options.worker = worker_options(config, *zygote ? &**zygote : nullptr);
  options.journal = a.journal;
  options.progress = ::isatty(STDERR_FILENO) == 1;
  const bool general = config.task == "sliding_window";
  const Result<RunReport> report =
      general ? run_window(*recording, config, shipped_names(), options.worker, options.progress)
              : run_recording(*recording, options);
  if (!report) return report.error();
  if (!a.out.empty())
    if (auto ok = write_tum(a.out, report->causal); !ok) return ok.error();
  if (!a.json.empty())
    if (auto ok = write_output(a.json, to_json(*report) + "\n"); !ok) return ok.error();
  if (a.json != "-")
    if (auto ok = write_output("-", to_text(*report)); !ok) return ok.error();
  return std::isnan(report->initialised_after_s) ? kNotConverged : kSolved;
}

// What only the odometry has, and what two frames have not.
Result<void> refuse_options(const CLI::App& command, const RunConfig& config) {
  for (const char* option : {"--journal", "--landmarks", "--front-end-ms"})
    if (command.count(option) > 0 && config.task != "inertial_odometry")
      return Error{ErrorCode::bad_input,
                   std::string(option) + ": expected the task inertial_odometry, found " + config.task};
  if (config.defer && config.task == "two_frame")
    return Error{ErrorCode::bad_input, "--defer: expected a task with a window, found two_frame"};
  return {};
}

// By the task of the config.
Result<int> track_instead(const RunConfig& config, const RunArguments& a) {
  if (config.engine != "native")
    return Error{ErrorCode::bad_input, "expected the engine native for the task two_frame, found " + config.engine};
  return track_and_report(config, a.recording, {a.json, a.out, ""});
}

int run(const CLI::App& command, const RunArguments& a) {
  const RunConfigReading reading = settings(command, a);
  for (const Error& e : reading.errors) refuse(e);
  if (!reading.errors.empty()) return kBadInput;
  if (!has_engine(reading.config.engine)) return refuse(become_one_with(reading.config.engine));
  if (auto ok = refuse_options(command, reading.config); !ok) return refuse(ok.error());
  const Result<int> exit_code =
      reading.config.task == "two_frame" ? track_instead(reading.config, a) : run_and_report(reading.config, a);
  return exit_code ? *exit_code : refuse(exit_code.error());
}

}  // namespace

void add_run_command(CLI::App& app, int& exit_code) {
  const auto a = std::make_shared<RunArguments>();
  CLI::App* command = app.add_subcommand("run", "Visual-inertial odometry over a recording, with a sliding window");
  command->add_option("RECORDING", a->recording, "Folder that `oriel import` made")->required();
  add_engine_option(*command, a->engine);
  command->add_option("--executor", a->executor, "Where the window's solves run: in place, in a thread, in a process")
      ->check(one_of(shipped_executors().list()))
      ->capture_default_str();
  command->add_flag(
      "--defer", a->defer,
      "An update begins its solve and returns, the next one merges it; what is said of a frame is predicted");
  command
      ->add_option("--front-end-ms", a->front_end_ms, "CPU time to burn before each frame, as a front end would [ms]")
      ->check(CLI::Range(0.0, 1e6));
  command->add_option("--config", a->config, "Settings of the run (YAML); `oriel config` prints them all");
  command->add_option("--json", a->json, "Report as one object; - is standard output");
  command->add_option("--out", a->out, "Trajectory to write (TUM): each pose as it was known at its own update");
  command
      ->add_option("--landmarks", a->landmarks,
                   "As the window has them (by-cameras: points of two cameras, inverse depths of one)")
      ->check(one_of(landmark_words()));
  command->add_option("--journal", a->journal, "File for every edit and solve, for `oriel replay`");
  command->callback([a, command, &exit_code] { exit_code = run(*command, *a); });
}

}  // namespace oriel::apps
