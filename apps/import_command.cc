// oriel import SOURCE RECORDING
#include <CLI/App.hpp>
#include <cstdio>
#include <memory>

#include "apps/command.h"
#include "apps/commands.h"
#include "oriel/io/euroc_import.h"

namespace oriel::apps {
namespace {

struct ImportArguments {
  std::string source, recording;
};

int run(const ImportArguments& a) {
  const Result<Recording> r = import_euroc(a.source, a.recording);
  if (!r) return refuse(r.error());
  const double seconds = r->frames.empty() ? 0.0 : (r->frames.back().time - r->frames.front().time).seconds();
  std::printf("%s: %zu frames in %.3f s, %zu observations, %zu cameras, %zu IMU samples, %zu true poses\n",
              a.recording.c_str(), r->frames.size(), seconds, r->observations.size(), r->cameras.size(), r->imu.size(),
              r->groundtruth.size());
  return kSolved;
}

}  // namespace

void add_import_command(CLI::App& app, int& exit_code) {
  const auto a = std::make_shared<ImportArguments>();
  CLI::App* command = app.add_subcommand("import", "Makes a recording of a folder that derives from EuRoC");
  command->add_option("SOURCE", a->source, "Folder with imu.csv, tracks.csv, cam0_sensor.yaml, ...")->required();
  command->add_option("RECORDING", a->recording, "Folder to make; a recording that is there is replaced")->required();
  command->callback([a, &exit_code] { exit_code = run(*a); });
}

}  // namespace oriel::apps
