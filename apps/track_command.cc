// oriel track RECORDING
#include <CLI/App.hpp>
#include <memory>

#include "apps/arguments.h"
#include "apps/command.h"
#include "apps/commands.h"
#include "apps/track_recording.h"
#include "oriel/run/words.h"

namespace oriel::apps {
namespace {

struct TrackArguments {
  std::string recording, config, executor = "inline", residual = "stereo", coordinates = "previous", source = "map";
  TrackTargets targets;
};

// The config where one is given; then what the command line says beside it.
RunConfigReading settings(const CLI::App& command, const TrackArguments& a) {
  RunConfigReading reading;
  reading.config.task = "two_frame";
  if (!a.config.empty()) reading = read_run_config(a.config);
  RunConfig& c = reading.config;
  if (reading.errors.empty() && c.task != "two_frame")
    reading.errors.push_back(
        {ErrorCode::bad_input, "expected the task two_frame; oriel run takes the others", a.config});
  if (command.count("--executor") > 0) c.executor = *executor_kind(a.executor);
  if (command.count("--residual") > 0) c.two_frame.residual = *match_residuals().find(a.residual);
  if (command.count("--coordinates") > 0) c.two_frame.coordinates = *match_coordinates().find(a.coordinates);
  if (command.count("--source") > 0) c.two_frame.source = *match_sources().find(a.source);
  return reading;
}

int run(const CLI::App& command, const TrackArguments& a) {
  const RunConfigReading reading = settings(command, a);
  for (const Error& e : reading.errors) refuse(e);
  if (!reading.errors.empty()) return kBadInput;
  const Result<int> exit_code = track_and_report(reading.config, a.recording, a.targets);
  return exit_code ? *exit_code : refuse(exit_code.error());
}

}  // namespace

void add_track_command(CLI::App& app, int& exit_code) {
  const auto a = std::make_shared<TrackArguments>();
  CLI::App* command = app.add_subcommand("track", "Stereo odometry by two-frame tasks: no IMU, no window");
  command
      ->add_option(
          "RECORDING", a->recording,
          "Folder that `oriel import` made, or one with calib.yaml (stereo tracks) or cam0_sensor.yaml (EuRoC)")
      ->required();
  command->add_option("--executor", a->executor, "Where the tasks run: in place, in a thread, in a process")
      ->check(one_of(shipped_executors().list()))
      ->capture_default_str();
  command->add_option("--residual", a->residual, "What is compared")
      ->check(one_of(match_residuals().list()))
      ->capture_default_str();
  command->add_option("--coordinates", a->coordinates, "In which a task is written down; equal results")
      ->check(one_of(match_coordinates().list()))
      ->capture_default_str();
  command->add_option("--source", a->source, "What is known of a point: by the previous frame, by all frames")
      ->check(one_of(match_sources().list()))
      ->capture_default_str();
  command->add_option("--config", a->config, "Settings (YAML, task: two_frame); `oriel config` prints them all");
  command->add_option("--json", a->targets.json, "Report as one object; - is standard output");
  command->add_option("--out", a->targets.out, "Trajectory to write (TUM)");
  command->add_option("--map", a->targets.map, "Visual map to write: frames, points, observations, covariances");
  command->callback([a, command, &exit_code] { exit_code = run(*command, *a); });
}

}  // namespace oriel::apps
