// oriel simulate [TRAJECTORY] RECORDING
#include <CLI/App.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "apps/arguments.h"
#include "apps/command.h"
#include "apps/commands.h"
#include "apps/simulated_recording.h"
#include "oriel/evaluate/ate.h"

namespace oriel::apps {
namespace {

struct SimulateArguments {
  std::vector<std::string> paths, faults, rests;
  std::uint64_t seed = 1;
  double seconds = 0.0, rest_s = 2.0, imu_rate = 200.0, camera_rate = 20.0, pixel_sigma = 1.0, noise = 1.0;
  double spacing_s = 0.1, clock_offset_s = 0.0;
  int tracks = 150;
  bool mono = false;
};

constexpr double kProceduralSeconds = 60.0;

Result<SimulatedWorldOptions> options_of(const SimulateArguments& a) {
  SimulatedWorldOptions o;
  o.seed = a.seed;
  o.seconds = a.seconds;
  if (a.paths.size() == 1 && a.seconds == 0.0) o.seconds = kProceduralSeconds;
  o.spacing_s = a.spacing_s;
  o.imu.timing.rate_hz = a.imu_rate;
  for (double* density : {&o.imu.noise.gyro, &o.imu.noise.accel, &o.imu.noise.gyro_walk, &o.imu.noise.accel_walk})
    *density *= a.noise;
  o.cameras.timing.rate_hz = a.camera_rate;
  o.cameras.timing.clock_offset = Duration::from_seconds(a.clock_offset_s);
  o.cameras.pixel_sigma = a.pixel_sigma;
  o.cameras.tracks = a.tracks;
  o.cameras.stereo = !a.mono;
  if (a.rest_s > 0.0) o.rests.push_back({0.0, a.rest_s});
  for (const std::string& text : a.rests) {
    auto rest = parse_interval(text);
    if (!rest) return Error{ErrorCode::bad_input, "--still: " + rest.error().message};
    o.rests.push_back(*rest);
  }
  for (const std::string& text : a.faults) {
    auto fault = parse_fault(text);
    if (!fault) return fault.error();
    o.faults.push_back(*fault);
  }
  return o;
}

Result<SimulatedWorld> world_of(const SimulateArguments& a) {
  auto options = options_of(a);
  if (!options) return options.error();
  if (a.paths.size() == 1) return SimulatedWorld::make(*options);
  const auto poses = read_poses(a.paths[0]);
  if (!poses) return poses.error();
  options->start = poses->front().time;
  auto world = SimulatedWorld::make(*options, *poses);
  if (world) return world;
  Error error = world.error();
  error.file = a.paths[0];
  return error;
}

Result<void> simulate(const SimulateArguments& a) {
  auto world = world_of(a);
  if (!world) return world.error();
  const std::string& folder = a.paths.back();
  const std::string source =
      a.paths.size() == 1 ? "a flight of formulas" : std::filesystem::path(a.paths[0]).filename();
  const std::string name = std::filesystem::path(folder).lexically_normal().filename().string();
  const Recording r = record(*world, name.empty() ? "simulated" : name,
                             "oriel simulate, seed " + std::to_string(a.seed) + ", along " + source);
  if (r.frames.empty() || r.imu.empty())
    return Error{ErrorCode::bad_input, "expected a world with IMU samples and frames: nothing was left to record"};
  if (auto ok = write_recording(folder, r); !ok) return ok;
  std::printf(
      "%s: %zu frames in %.3f s, %zu observations of %lld landmarks, %zu cameras, %zu IMU samples, path %.2f m\n",
      folder.c_str(), r.frames.size(), world->seconds(), r.observations.size(),
      static_cast<long long>(world->landmarks()), r.cameras.size(), r.imu.size(), path_length(r.groundtruth));
  return {};
}

int run(const SimulateArguments& a) {
  const Result<void> done = simulate(a);
  return done ? kSolved : refuse(done.error());
}

}  // namespace

void add_simulate_command(CLI::App& app, int& exit_code) {
  const auto a = std::make_shared<SimulateArguments>();
  CLI::App* command = app.add_subcommand("simulate", "Makes a recording of a simulated world, with its truth");
  command
      ->add_option("PATHS", a->paths,
                   "[TRAJECTORY] RECORDING: TUM poses to fly along (else a flight of formulas), and the folder to make")
      ->required()
      ->expected(1, 2);
  command->add_option("--seed", a->seed, "Of all random numbers (1)")->check(whole_number(0, 1LL << 53));
  command->add_option("--seconds", a->seconds, "How long it lasts (60, or the trajectory's own)")
      ->check(number(0.1, 36000));
  command->add_option("--rest", a->rest_s, "Seconds of rest at the start (2)")->check(number(0, 3600));
  command->add_option("--still", a->rests, "FROM:TO: seconds without any motion; may be repeated");
  command->add_option("--imu-rate", a->imu_rate, "Of the IMU [Hz] (200)")->check(number(10, 10000));
  command->add_option("--camera-rate", a->camera_rate, "Of the cameras [Hz] (20)")->check(number(0.1, 1000));
  command->add_option("--tracks", a->tracks, "In view of each frame (150)")->check(whole_number(1, 10000));
  command->add_option("--pixel-sigma", a->pixel_sigma, "Noise of each coordinate [px] (1)")->check(number(0, 100));
  command->add_option("--noise", a->noise, "Factor on EuRoC's IMU noise (1)")->check(number(0, 1000));
  command->add_option("--spacing", a->spacing_s, "Of the spline's control poses [s] (0.1)")->check(number(0.01, 10));
  command->add_option("--clock-offset", a->clock_offset_s, "Of the cameras' stamps [s] (0)")->check(number(-1, 1));
  command->add_option(
      "--fault", a->faults,
      "KIND:SENSOR:FROM:TO[:SHARE], e.g. outlier:camera:10:11:0.5; dropout, outlier, blind, saturation; "
      "may be repeated");
  command->add_flag("--mono", a->mono, "The left camera alone");
  command->callback([a, &exit_code] { exit_code = run(*a); });
}

}  // namespace oriel::apps
