// oriel import SOURCE RECORDING
#include <CLI/App.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "apps/command.h"
#include "apps/commands.h"
#include "oriel/io/euroc_import.h"
#include "oriel/io/stereo_import.h"

namespace oriel::apps {
namespace {

struct ImportArguments {
  std::string source, recording;
};

Result<Recording> import(const ImportArguments& a) {
  std::error_code code;
  if (!std::filesystem::exists(std::filesystem::path(a.source) / "calib.yaml", code))
    return import_euroc(a.source, a.recording);
  Result<Recording> r = read_stereo_tracks(a.source);
  if (r)
    if (auto ok = write_recording(a.recording, *r); !ok) return ok.error();
  return r;
}

int run(const ImportArguments& a) {
  const Result<Recording> r = import(a);
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
  CLI::App* command =
      app.add_subcommand("import", "Makes a recording of a folder that derives from EuRoC, or of stereo tracks");
  command->add_option("SOURCE", a->source, "Folder with tracks.csv, and imu.csv, cam0_sensor.yaml, ... or calib.yaml")
      ->required();
  command->add_option("RECORDING", a->recording, "Folder to make; a recording that is there is replaced")->required();
  command->callback([a, &exit_code] { exit_code = run(*a); });
}

}  // namespace oriel::apps
