// oriel nees
#include <fmt/format.h>

#include <CLI/App.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "apps/arguments.h"
#include "apps/command.h"
#include "apps/commands.h"
#include "apps/landmark_option.h"
#include "oriel/evaluate/nees.h"
#include "oriel/testing/consistency.h"

namespace oriel::apps {
namespace {

struct NeesArguments {
  int runs = 200;
  std::uint64_t seed = 1;
  double seconds = 25.0, pixel_sigma = 1.0, start = 1.0;
  int tracks = 40, keyframes = 8;
  bool mono = false;
  std::string landmarks = "by-cameras", json;
};

// One way of running: the tables of its quantities.
struct NeesReport {
  bool first_estimates = true;
  std::vector<NeesTable> tables;
  std::vector<double> times;
  std::int64_t dropped = 0;
};

// Rows and columns [first, first + n) of the 9 × 9.
Result<double> part_of(const ConsistencySample& s, int first, int n) {
  std::vector<double> error, covariance;
  for (int j = first; j < first + n; ++j) {
    error.push_back(s.error[j]);
    for (int i = first; i < first + n; ++i) covariance.push_back(s.covariance(i, j));
  }
  return normalized_error_squared(error, covariance);
}

struct Quantity {
  const char* name;
  int first, dof;
};
constexpr Quantity kQuantities[] = {
    {"pose", 0, 6}, {"velocity", 6, 3}, {"orientation", 0, 3}, {"position", 3, 3}, {"pose and velocity", 0, 9}};

Result<void> add_run(const ConsistencyRun& run, NeesReport& report) {
  if (report.tables.empty())
    for (const Quantity& q : kQuantities) report.tables.emplace_back(q.name, q.dof, run.samples.size());
  if (report.times.empty())
    for (const ConsistencySample& s : run.samples) report.times.push_back(s.t);
  for (std::size_t epoch = 0; epoch < run.samples.size(); ++epoch)
    for (std::size_t q = 0; q < report.tables.size(); ++q) {
      const auto value = part_of(run.samples[epoch], kQuantities[q].first, kQuantities[q].dof);
      if (!value) return value.error();
      report.tables[q].add(epoch, *value);
    }
  report.dropped += run.dropped;
  return {};
}

Result<NeesReport> simulate(const NeesArguments& a, bool first_estimates) {
  NeesReport report;
  report.first_estimates = first_estimates;
  ConsistencyOptions options = consistency_options(a.seconds);
  options.odometry.first_estimates = first_estimates;
  options.world.cameras.pixel_sigma = options.odometry.visual.pixel_sigma = a.pixel_sigma;
  options.start.pose *= a.start;
  for (double* sigma : {&options.start.velocity, &options.start.gyro_bias, &options.start.accel_bias})
    *sigma *= a.start;
  options.world.cameras.tracks = options.odometry.keyframes.expected_tracks = a.tracks;
  options.world.cameras.stereo = !a.mono;
  options.odometry.keyframes.max_keyframes = a.keyframes;
  options.odometry.visual.landmarks = landmark_model(a.landmarks);
  for (int k = 0; k < a.runs; ++k) {
    const auto run = consistency_run(options, a.seed + static_cast<std::uint64_t>(k));
    if (!run) return run.error();
    if (auto ok = add_run(*run, report); !ok) return ok.error();
  }
  return report;
}

std::string to_text(const NeesReport& r, const NeesArguments& a) {
  std::string text = fmt::format("first-estimate Jacobians {}: {} runs of {} s, {} epochs, {} sightings dropped\n",
                                 r.first_estimates ? "on" : "off", a.runs, a.seconds, r.times.size(), r.dropped);
  text += fmt::format("  {:<18} {:>4} {:>9} {:>7} {:>9}  {:>18}\n", "NEES of", "dof", "all mean", "/ dof", "at end",
                      "95 % at end");
  for (const NeesTable& t : r.tables) {
    const std::size_t last = t.epochs() - 1;
    const Bounds b = nees_interval(t.dof(), t.runs(last));
    text += fmt::format("  {:<18} {:>4} {:>9.3f} {:>7.3f} {:>9.3f}  [{:.3f}, {:.3f}]{}\n", t.name(), t.dof(), t.mean(),
                        t.mean() / t.dof(), t.mean(last), b.low, b.high, t.consistent_at_end() ? "" : " OUTSIDE");
  }
  return text;
}

nlohmann::ordered_json to_json(const NeesReport& r) {
  nlohmann::ordered_json out = {{"first_estimates", r.first_estimates}, {"dropped", r.dropped}, {"times_s", r.times}};
  for (const NeesTable& t : r.tables) {
    const std::size_t last = t.epochs() - 1;
    const Bounds b = nees_interval(t.dof(), t.runs(last));
    std::vector<double> means;
    for (std::size_t k = 0; k < t.epochs(); ++k) means.push_back(t.mean(k));
    out["nees"].push_back({{"of", t.name()},
                           {"dof", t.dof()},
                           {"mean", t.mean()},
                           {"end", t.mean(last)},
                           {"interval_end", {b.low, b.high}},
                           {"consistent_at_end", t.consistent_at_end()},
                           {"epochs", means}});
  }
  return out;
}

Result<int> nees(const NeesArguments& a) {
  if (auto ok = check_target(a.json); !ok) return ok.error();
  nlohmann::ordered_json json = {{"runs", a.runs}, {"seconds", a.seconds}, {"seed", a.seed}};
  bool consistent = true;
  for (const bool first_estimates : {true, false}) {
    const auto report = simulate(a, first_estimates);
    if (!report) return report.error();
    if (first_estimates)
      for (int q = 0; q < 2; ++q)
        consistent = consistent && report->tables[static_cast<std::size_t>(q)].consistent_at_end();
    if (a.json != "-")
      if (auto ok = write_output("-", to_text(*report, a)); !ok) return ok.error();
    json["variants"].push_back(to_json(*report));
  }
  if (!a.json.empty())
    if (auto ok = write_output(a.json, json.dump(2) + "\n"); !ok) return ok.error();
  return consistent ? kSolved : kNotConverged;
}

int run(const NeesArguments& a) {
  const Result<int> exit_code = nees(a);
  return exit_code ? *exit_code : refuse(exit_code.error());
}

}  // namespace

void add_nees_command(CLI::App& app, int& exit_code) {
  const auto a = std::make_shared<NeesArguments>();
  CLI::App* command = app.add_subcommand(
      "nees", "Consistency: are the visual-inertial window's errors as large as its covariances say? Monte Carlo");
  command->add_option("--runs", a->runs, "Simulated flights (200)")->check(whole_number(2, 1000000));
  command->add_option("--seed", a->seed, "Of the first flight (1)")->check(whole_number(0, 1LL << 53));
  command->add_option("--seconds", a->seconds, "Of each flight (25)")->check(number(2, 3600));
  command->add_option("--pixel-sigma", a->pixel_sigma, "Noise of each coordinate [px] (1)")->check(number(0.01, 100));
  command->add_option("--start", a->start, "Factor on the uncertainty of the first state (1)")
      ->check(number(0.01, 100));
  command->add_option("--tracks", a->tracks, "In view of each frame (40)")->check(whole_number(8, 10000));
  command->add_option("--keyframes", a->keyframes, "Of the window (8)")->check(whole_number(2, 100));
  command
      ->add_option("--landmarks", a->landmarks,
                   "As the window has them (by-cameras: points of two cameras, inverse depths of one)")
      ->check(one_of(landmark_words()));
  command->add_flag("--mono", a->mono, "The left camera alone");
  command->add_option("--json", a->json, "Report as one object; - is standard output");
  command->callback([a, &exit_code] { exit_code = run(*a); });
}

}  // namespace oriel::apps
