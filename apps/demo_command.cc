// oriel demo DATA OUT: the main job on the project's own data sets, ending with one table. ./run calls it.
#include <fmt/format.h>

#include <CLI/App.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <vector>

#include "apps/command.h"
#include "apps/commands.h"
#include "apps/solve_files.h"
#include "oriel/io/euroc_import.h"

namespace oriel::apps {
namespace {

struct DemoArguments {
  std::string data, out;
};

constexpr const char* kProblems[] = {"intel.g2o", "sphere2500.g2o", "problem-49-7776-pre.txt"};

std::string table_row(const std::string& name, const std::string& poses, const std::string& landmarks,
                      const std::string& factors, const std::string& cost, const std::string& iterations,
                      const std::string& time) {
  return fmt::format("{:<24} {:>6} {:>9} {:>8}  {:<26} {:>10} {:>9}\n", name, poses, landmarks, factors, cost,
                     iterations, time);
}

std::string table(const std::vector<SolvedFile>& files) {
  std::string text = table_row("problem", "poses", "landmarks", "factors", "cost", "iterations", "time [ms]");
  for (const SolvedFile& f : files)
    text += table_row(std::filesystem::path(f.path).filename(), fmt::to_string(f.poses), fmt::to_string(f.landmarks),
                      fmt::to_string(f.factors),
                      fmt::format("{:.6g} -> {:.8g}", f.summary.initial_cost, f.summary.final_cost),
                      fmt::to_string(f.summary.iterations), fmt::format("{:.1f}", f.summary.seconds.total * 1e3));
  return text;
}

Result<void> make_folder(const std::string& folder) {
  std::error_code fault;
  std::filesystem::create_directories(folder, fault);
  if (fault) return Error{ErrorCode::io, "cannot be made: " + fault.message(), folder};
  return {};
}

Result<SolvedFile> solve_one(const std::filesystem::path& data, const std::filesystem::path& out, const char* name) {
  Result<BatchProblem> problem = load_problem(data / name, {});
  if (!problem) return problem.error();
  return solve_problem(*problem, {}, out / name);
}

Result<int> demo(const DemoArguments& a) {
  const std::filesystem::path data = a.data, out = a.out;
  if (auto ok = make_folder(out); !ok) return ok.error();
  const Result<Recording> recording = import_euroc(data / "euroc_v101", out / "euroc_v101");
  if (!recording) return recording.error();
  std::vector<SolvedFile> solved;
  int exit_code = kSolved;
  for (const char* name : kProblems) {
    Result<SolvedFile> file = solve_one(data, out, name);
    if (!file) return file.error();
    if (!file->summary.converged()) exit_code = kNotConverged;
    solved.push_back(std::move(*file));
  }
  if (auto ok = write_output("-", "\n" + table(solved)); !ok) return ok.error();
  return exit_code;
}

int run(const DemoArguments& a) {
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
  command->callback([a, &exit_code] { exit_code = run(*a); });
}

}  // namespace oriel::apps
