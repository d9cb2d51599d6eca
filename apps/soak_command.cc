// oriel soak
#include <fmt/format.h>

#include <CLI/App.hpp>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "apps/arguments.h"
#include "apps/command.h"
#include "apps/commands.h"
#include "apps/landmark_option.h"
#include "oriel/testing/allocation_counter.h"
#include "oriel/testing/soak.h"

namespace oriel::apps {
namespace {

struct SoakArguments {
  std::int64_t updates = 100'000;
  std::uint64_t seed = 1;
  double camera_rate = 10.0;
  int tracks = 100;
  bool mono = false, no_faults = false;
  std::string landmarks = "by-cameras", json;
};

// What of a run is no lasting: growth beyond these.
constexpr double kLatencyGrowth = 2.0;  // of the p99.9
constexpr double kMemoryGrowth = 2.0;   // [MB], of the process with its simulated world, after the first tenth

const char* name_of(SoakFault::Outcome o) {
  return o == SoakFault::Outcome::survived ? "survived" : o == SoakFault::Outcome::reset ? "reset" : "lost";
}

// NaN and infinities have no place in JSON.
nlohmann::ordered_json number_or_null(double x) {
  return std::isfinite(x) ? nlohmann::ordered_json(x) : nlohmann::ordered_json(nullptr);
}

struct FaultRow {
  int survived = 0, reset = 0, lost = 0;
  double worst_m = 0.0;
};

std::map<std::string, FaultRow> by_name(const SoakReport& r) {
  std::map<std::string, FaultRow> rows;
  for (const SoakFault& f : r.faults) {
    FaultRow& row = rows[f.name];
    ++(f.outcome == SoakFault::Outcome::survived ? row.survived
       : f.outcome == SoakFault::Outcome::reset  ? row.reset
                                                 : row.lost);
    if (f.error_m > row.worst_m) row.worst_m = f.error_m;
  }
  return rows;
}

std::string to_text(const SoakReport& r) {
  std::string text = fmt::format("{} updates: {} with an estimate, {} failed; {} IMU samples refused\n", r.updates,
                                 r.tracking, r.failed, r.refused_samples);
  text += fmt::format("  {:>9} {:>9} {:>9} {:>9} {:>9} {:>12} {:>11}\n", "updates", "p50 [ms]", "p99", "p99.9", "max",
                      "allocations", "memory [MB]");
  for (const SoakSlice& s : r.slices)
    text += fmt::format("  {:>9} {:>9.3f} {:>9.3f} {:>9.3f} {:>9.3f} {:>12} {:>11.1f}\n", s.updates, s.p50_ms, s.p99_ms,
                        s.p999_ms, s.max_ms, s.allocations, s.resident_mb);
  if (!r.faults.empty())
    text += fmt::format("  {:<36} {:>9} {:>6} {:>5} {:>24}\n", "fault", "survived", "reset", "lost",
                        "worst error in 1 s [m]");
  for (const auto& [name, row] : by_name(r))
    text += fmt::format("  {:<36} {:>9} {:>6} {:>5} {:>24.4f}\n", name, row.survived, row.reset, row.lost, row.worst_m);
  for (const auto& [reason, count] : r.resets) text += fmt::format("  {} times anew: {}\n", count, reason);
  if (r.slices.size() >= 3)
    text +=
        fmt::format("  p99.9 of the last slice by the second's: {:.2f}{}; memory since the first slice: {:+.2f} MB{}\n",
                    r.latency_growth(), r.latency_growth() > kLatencyGrowth ? " TOO MUCH" : "", r.memory_growth_mb(),
                    r.memory_growth_mb() > kMemoryGrowth ? " TOO MUCH" : "");
  return text;
}

nlohmann::ordered_json to_json(const SoakReport& r) {
  nlohmann::ordered_json out = {
      {"updates", r.updates}, {"tracking", r.tracking}, {"failed", r.failed}, {"refused_samples", r.refused_samples}};
  for (const SoakSlice& s : r.slices)
    out["slices"].push_back(
        {{"updates", s.updates},
         {"update_ms", {{"p50", s.p50_ms}, {"p99", s.p99_ms}, {"p999", s.p999_ms}, {"max", s.max_ms}}},
         {"allocations", s.allocations},
         {"resident_mb", s.resident_mb}});
  out["faults"] = nlohmann::ordered_json::array();
  for (const SoakFault& f : r.faults)
    out["faults"].push_back({{"fault", f.name},
                             {"from_s", f.when.from_s},
                             {"to_s", f.when.to_s},
                             {"outcome", name_of(f.outcome)},
                             {"reason", f.reason},
                             {"error_m", number_or_null(f.error_m)}});
  out["resets"] = nlohmann::ordered_json::array();
  for (const auto& [reason, count] : r.resets) out["resets"].push_back({{"reason", reason}, {"count", count}});
  out["latency_growth"] = number_or_null(r.latency_growth());
  out["memory_growth_mb"] = number_or_null(r.memory_growth_mb());
  return out;
}

Result<int> soak_as_asked(const SoakArguments& a) {
  if (auto ok = check_target(a.json); !ok) return ok.error();
  SoakOptions options;
  options.updates = a.updates;
  options.seed = a.seed;
  options.camera_rate_hz = a.camera_rate;
  options.tracks = a.tracks;
  options.stereo = !a.mono;
  options.faults = !a.no_faults;
  options.odometry.keep_trajectory = false;
  options.odometry.keyframes.expected_tracks = a.tracks;
  options.odometry.visual.landmarks = landmark_model(a.landmarks);
  options.allocations = [] { return allocation_count(); };
  const auto report = soak(options, [&](const SoakReport& r) {
    std::fprintf(stderr, "\r%lld of %lld updates, p99.9 %.2f ms, %.0f MB  ", static_cast<long long>(r.updates),
                 static_cast<long long>(a.updates), r.slices.back().p999_ms, r.slices.back().resident_mb);
  });
  std::fputs("\n", stderr);
  if (!report) return report.error();
  if (a.json != "-")
    if (auto ok = write_output("-", to_text(*report)); !ok) return ok.error();
  if (!a.json.empty())
    if (auto ok = write_output(a.json, to_json(*report).dump(2) + "\n"); !ok) return ok.error();
  const bool lasts = report->count(SoakFault::Outcome::lost) == 0 && !(report->latency_growth() > kLatencyGrowth) &&
                     !(report->memory_growth_mb() > kMemoryGrowth);
  return lasts ? kSolved : kNotConverged;
}

int run(const SoakArguments& a) {
  const Result<int> exit_code = soak_as_asked(a);
  return exit_code ? *exit_code : refuse(exit_code.error());
}

}  // namespace

void add_soak_command(CLI::App& app, int& exit_code) {
  const auto a = std::make_shared<SoakArguments>();
  CLI::App* command = app.add_subcommand(
      "soak", "Endurance: visual-inertial odometry in a simulated world that goes wrong all the time");
  command->add_option("--updates", a->updates, "Frames (100000)")->check(whole_number(100, 1LL << 40));
  command->add_option("--seed", a->seed, "Of the world (1)")->check(whole_number(0, 1LL << 53));
  command->add_option("--camera-rate", a->camera_rate, "Frames a second (10)")->check(number(1, 100));
  command->add_option("--tracks", a->tracks, "Features in a frame (100)")->check(whole_number(10, 5000));
  command->add_flag("--mono", a->mono, "One camera instead of two");
  command
      ->add_option("--landmarks", a->landmarks,
                   "As the window has them (by-cameras: points of two cameras, inverse depths of one)")
      ->check(one_of(landmark_words()));
  command->add_flag("--no-faults", a->no_faults, "Nothing goes wrong");
  command->add_option("--json", a->json, "Report as one object; - is standard output");
  command->callback([a, &exit_code] { exit_code = run(*a); });
}

}  // namespace oriel::apps
