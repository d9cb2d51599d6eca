// oriel demo DATA OUT: the main job on the project's own data sets, ending with one table. ./run calls it.
#include <fmt/format.h>

#include <CLI/App.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <vector>

#include "apps/command.h"
#include "apps/commands.h"
#include "apps/run_recording.h"
#include "apps/solve_files.h"
#include "oriel/io/euroc_import.h"

namespace oriel::apps {
namespace {

struct DemoArguments {
  std::string data, out;
};

constexpr const char* kRecording = "euroc_v101";
constexpr const char* kProblems[] = {"intel.g2o", "sphere2500.g2o", "problem-49-7776-pre.txt"};

std::string row(const std::string& name, const std::string& poses, const std::string& landmarks,
                const std::string& factors, const std::string& result, const std::string& iterations,
                const std::string& time) {
  return fmt::format("{:<24} {:>6} {:>10} {:>8}  {:<29} {:>11}  {}\n", name, poses, landmarks, factors, result,
                     iterations, time);
}

std::string row(const RunReport& r) {
  return row(r.recording, fmt::to_string(r.states), "", "",
             fmt::format("ATE {:.3f} m over {:.1f} m", r.ate_m, r.path_m), "",
             fmt::format("{:.2f} p50, {:.2f} p99", r.update_ms_p50, r.update_ms_p99));
}

std::string row(const SolvedFile& f) {
  const Summary& s = f.summary;
  return row(std::filesystem::path(f.path).filename(), fmt::to_string(f.poses),
             f.landmarks > 0 ? fmt::to_string(f.landmarks) : "", fmt::to_string(f.factors),
             fmt::format("cost {:.6g} -> {:.8g}", s.initial_cost, s.final_cost), fmt::to_string(s.iterations),
             fmt::format("{:.1f}", s.seconds.total * 1e3));
}

Result<void> make_folder(const std::string& folder) {
  std::error_code fault;
  std::filesystem::create_directories(folder, fault);
  if (fault) return Error{ErrorCode::io, "cannot be made: " + fault.message(), folder};
  return {};
}

Result<RunReport> replay(const std::filesystem::path& data, const std::filesystem::path& out) {
  const Result<Recording> recording = import_euroc(data / kRecording, out / kRecording);
  if (!recording) return recording.error();
  RunOptions options;
  options.progress = true;
  Result<RunReport> report = run_recording(*recording, options);
  if (!report) return report;
  report->recording = kRecording;
  const std::string trajectory = out / (std::string(kRecording) + ".tum");
  if (auto ok = write_tum(trajectory, report->causal); !ok) return ok.error();
  const std::string text = fmt::format("\n{}  trajectory: {}\n\n", to_text(*report), trajectory);
  if (auto ok = write_output("-", text); !ok) return ok.error();
  return report;
}

Result<SolvedFile> solve_one(const std::filesystem::path& data, const std::filesystem::path& out, const char* name) {
  Result<BatchProblem> problem = load_problem(data / name, {});
  if (!problem) return problem.error();
  const std::filesystem::path picture = std::filesystem::path(name).stem() += ".svg";
  return solve_problem(*problem, {{}, {out / name, out / picture}, false, {}});
}

Result<int> demo(const DemoArguments& a) {
  if (auto ok = make_folder(a.out); !ok) return ok.error();
  const Result<RunReport> run = replay(a.data, a.out);
  if (!run) return run.error();
  std::string table = row("problem", "poses", "landmarks", "factors", "result", "iterations", "time [ms]") + row(*run);
  bool all_solved = !std::isnan(run->initialised_after_s);
  for (const char* name : kProblems) {
    const Result<SolvedFile> file = solve_one(a.data, a.out, name);
    if (!file) return file.error();
    all_solved = all_solved && file->converged();
    if (auto ok = write_output("-", solve_text(*file)); !ok) return ok.error();
    table += row(*file);
  }
  if (auto ok = write_output("-", "\n" + table); !ok) return ok.error();
  return all_solved ? kSolved : kNotConverged;
}

int run_demo(const DemoArguments& a) {
  const Result<int> exit_code = demo(a);
  return exit_code ? *exit_code : refuse(exit_code.error());
}

}  // namespace

void add_demo_command(CLI::App& app, int& exit_code) {
  const auto a = std::make_shared<DemoArguments>();
  CLI::App* command =
      app.add_subcommand("demo", "The project's own data sets, one after the other; ends with one table");
  command->add_option("DATA", a->data, "Folder of the data sets")->required();
  command->add_option("OUT", a->out, "Folder for what is found; made if it is not there")->required();
  command->callback([a, &exit_code] { exit_code = run_demo(*a); });
}

}  // namespace oriel::apps
