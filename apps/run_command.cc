// oriel run RECORDING
#include <unistd.h>

#include <CLI/App.hpp>
#include <cmath>
#include <cstdio>
#include <memory>

#include "apps/arguments.h"
#include "apps/command.h"
#include "apps/commands.h"
#include "apps/landmark_option.h"
#include "apps/run_recording.h"

namespace oriel::apps {
namespace {

struct RunArguments {
  std::string recording, json, out, journal, landmarks = "by-cameras";
};

Result<int> run_and_report(const RunArguments& a) {
  for (const std::string& target : {a.json, a.out, a.journal})
    if (auto ok = check_target(target); !ok) return ok.error();
  const Result<Recording> recording = read_recording(a.recording);
  if (!recording) return recording.error();
  RunOptions options;
  options.journal = a.journal;
  options.odometry.visual.landmarks = landmark_model(a.landmarks);
  options.progress = ::isatty(STDERR_FILENO) == 1;
  const Result<RunReport> report = run_recording(*recording, options);
  if (!report) return report.error();
  if (!a.out.empty())
    if (auto ok = write_tum(a.out, report->causal); !ok) return ok.error();
  if (!a.json.empty())
    if (auto ok = write_output(a.json, to_json(*report) + "\n"); !ok) return ok.error();
  if (a.json != "-")
    if (auto ok = write_output("-", to_text(*report)); !ok) return ok.error();
  return std::isnan(report->initialised_after_s) ? kNotConverged : kSolved;
}

int run(const RunArguments& a) {
  const Result<int> exit_code = run_and_report(a);
  return exit_code ? *exit_code : refuse(exit_code.error());
}

}  // namespace

void add_run_command(CLI::App& app, int& exit_code) {
  const auto a = std::make_shared<RunArguments>();
  CLI::App* command = app.add_subcommand("run", "Visual-inertial odometry over a recording, with a sliding window");
  command->add_option("RECORDING", a->recording, "Folder that `oriel import` made")->required();
  command->add_option("--json", a->json, "Report as one object; - is standard output");
  command->add_option("--out", a->out, "Trajectory to write (TUM): each pose as it was known at its own update");
  command
      ->add_option("--landmarks", a->landmarks,
                   "As the window has them (by-cameras: points of two cameras, inverse depths of one)")
      ->check(one_of(kLandmarkModels));
  command->add_option("--journal", a->journal, "File for every edit and solve, for `oriel replay`");
  command->callback([a, &exit_code] { exit_code = run(*a); });
}

}  // namespace oriel::apps
