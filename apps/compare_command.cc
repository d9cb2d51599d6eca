// oriel compare FILE...: every engine on the same problem from the same start, each in a process of its own.
#include <fmt/format.h>

#include <CLI/App.hpp>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "apps/arguments.h"
#include "apps/batch_problem.h"
#include "apps/command.h"
#include "apps/commands.h"
#include "apps/engine_choice.h"
#include "oriel/evaluate/certificate.h"

namespace oriel::apps {
namespace {

using Json = nlohmann::ordered_json;

struct CompareArguments {
  std::vector<std::string> files;
  std::string init = "auto", json;
  int iterations = 100;
};

// A folder for what the engines find, gone with this; none where nobody asks.
class Solutions {
 public:
  explicit Solutions(bool wanted) {
    if (!wanted) return;
    std::error_code ignored;
    std::string pattern = (std::filesystem::temp_directory_path(ignored) / "oriel-compare-XXXXXX").string();
    if (::mkdtemp(pattern.data()) != nullptr) folder_ = pattern;
  }
  ~Solutions() {
    std::error_code ignored;
    if (!folder_.empty()) std::filesystem::remove_all(folder_, ignored);
  }
  Solutions(const Solutions&) = delete;
  Solutions& operator=(const Solutions&) = delete;
  bool empty() const { return folder_.empty(); }
  std::string of(const std::string& engine) const { return folder_ + "/" + engine; }

 private:
  std::string folder_;
};

// What one engine says of one file: an object of `oriel solve --json`, or why there is none.
struct Run {
  std::string engine, error;
  Json report;
};

Result<Run> run_engine(const std::string& engine, const std::string& file, const CompareArguments& a,
                       const Solutions& solutions) {
  Run run{engine, "", {}};
  const Result<std::string> program = program_of(engine);
  if (!program) {
    run.error = program.error().message;
    return run;
  }
  std::vector<std::string> words = {
      "solve", file, "--engine", engine, "--init", a.init, "--iterations", std::to_string(a.iterations), "--json", "-"};
  if (!solutions.empty()) words.insert(words.end(), {"--out", solutions.of(engine)});
  int exit_code = 0;
  const Result<std::string> text = output_of(*program, words, exit_code);
  if (!text) return text.error();
  if (exit_code == kBadInput) return Error{ErrorCode::bad_input, file + ": the engine " + engine + " refused it"};
  const Json array = Json::parse(*text, nullptr, false);
  if (array.is_discarded() || !array.is_array() || array.empty())
    return Error{ErrorCode::io, "the engine " + engine + " said nothing of " + file};
  run.report = array[0];
  return run;
}

struct Verdict {
  Certificate certificate;
  std::string refused;  // why there is none
};

template <class Pose, class Ids, class Edges>
Verdict verdict_of(const Graph& graph, const Ids& ids, const Result<Edges>& edges) {
  if (!edges) return {{}, edges.error().message};
  std::vector<Pose> poses;
  poses.reserve(ids.size());
  for (const auto id : ids) poses.push_back(graph.value(id));
  return {certify(poses, *edges), ""};
}

Result<BatchProblem> load(const std::string& file, const CompareArguments& a) {
  ProblemOptions options;
  options.start = start_choice(a.init);
  return load_problem(file, options);
}

// Of the poses that the engine of this library found. None for bundle adjustments.
std::optional<Verdict> judge(const Solutions& solutions) {
  if (solutions.empty()) return {};
  ProblemOptions as_found;
  as_found.start = StartChoice::file;
  const Result<BatchProblem> solved = load_problem(solutions.of("native"), as_found);
  if (!solved) return Verdict{{}, "the engine native found no poses"};
  const auto& file = std::get<PoseGraphFile>(solved->file);
  if (const auto* planar = std::get_if<PoseGraph2>(&solved->ids))
    return verdict_of<Pose2d>(*solved->graph, planar->poses, isotropic_edges2(file));
  return verdict_of<Pose3d>(*solved->graph, std::get<PoseGraph3>(solved->ids).poses, isotropic_edges3(file));
}

std::string text_of(const std::optional<Verdict>& v) {
  if (!v) return "";
  if (!v->refused.empty()) return "  global optimum: not asked, " + v->refused + "\n";
  const Certificate& c = v->certificate;
  const std::string figures = fmt::format("cost {:.9g}, no poses cost less than {:.9g}", c.cost, c.lower_bound);
  if (c.certified())
    return "  global optimum: certified, with isotropic noise and chordal distances (SE-Sync's problem): " + figures +
           "\n";
  return fmt::format("  global optimum: not certified (SE-Sync's problem): {}, so at most {:.3g} of it is too much\n",
                     figures, c.gap());
}

Json json_of(const std::optional<Verdict>& v) {
  if (!v || !v->refused.empty()) return nullptr;
  const Certificate& c = v->certificate;
  return {{"certified", c.certified()},
          {"cost", c.cost},
          {"lower_bound", c.lower_bound},
          {"gap", c.gap()},
          {"stationary", c.stationary}};
}

std::string row_of(const Run& run) {
  if (!run.error.empty()) return fmt::format("  {:<8} {}\n", run.engine, run.error);
  const Json& r = run.report;
  const auto number = [&](const char* key) { return r[key].is_number() ? r[key].get<double>() : 0.0; };
  return fmt::format("  {:<8} {:>17.9g} {:>11} {:>12.2f} {:>12.2f} {:>9.1f}  {}\n", run.engine, number("final_cost"),
                     r["iterations"].get<int>(), 1e3 * r["seconds"]["solve"].get<double>(),
                     1e3 * r["seconds"]["total"].get<double>(), number("peak_rss_mb"),
                     r["converged"].get<bool>() ? "converged" : "NOT converged");
}

// Adds what the engines say of one file to the report, and to the table what people read of it. Whether all converged.
Result<bool> compare_engines(const std::string& file, const CompareArguments& a, const Solutions& solutions,
                             Json& engines, std::string& table) {
  bool converged = true;
  for (const std::string& engine : oriel::apps::engines().list()) {
    const Result<Run> run = run_engine(engine, file, a, solutions);
    if (!run) return run.error();
    table += row_of(*run);
    Json entry = {{"engine", engine}};
    if (!run->error.empty()) entry["error"] = run->error;
    if (run->error.empty()) {
      converged = converged && run->report["converged"].get<bool>();
      for (const char* key :
           {"initial_cost", "final_cost", "iterations", "converged", "reason", "seconds", "peak_rss_mb"})
        entry[key] = run->report[key];
    }
    engines.push_back(std::move(entry));
  }
  return converged;
}

Result<int> compare_all(const CompareArguments& a) {
  if (auto ok = check_target(a.json); !ok) return ok.error();
  Json all = Json::array();
  int exit_code = kSolved;
  for (const std::string& file : a.files) {
    Result<BatchProblem> problem = load(file, a);  // first: a bad file is refused before anything runs
    if (!problem) return problem.error();
    Json object = {{"file", file}, {"engines", Json::array()}};
    std::string table = fmt::format("{}\n  {:<8} {:>17} {:>11} {:>12} {:>12} {:>9}\n", file, "engine", "cost",
                                    "iterations", "solve [ms]", "total [ms]", "[MB]");
    const bool poses = std::holds_alternative<PoseGraphFile>(problem->file);
    const Solutions solutions(poses);
    if (poses && solutions.empty()) return Error{ErrorCode::io, "compare: no folder for temporary files"};
    const Result<bool> converged = compare_engines(file, a, solutions, object["engines"], table);
    if (!converged) return converged.error();
    if (!*converged) exit_code = kNotConverged;
    const std::optional<Verdict> verdict = judge(solutions);
    object["global_optimum"] = json_of(verdict);
    table += text_of(verdict);
    if (a.json != "-") std::fputs(table.c_str(), stdout);
    all.push_back(std::move(object));
  }
  if (a.json.empty()) return exit_code;
  const std::string text = all.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
  if (auto ok = write_output(a.json, text); !ok) return ok.error();
  return exit_code;
}

}  // namespace

void add_compare_command(CLI::App& app, int& exit_code) {
  const auto a = std::make_shared<CompareArguments>();
  CLI::App* command = app.add_subcommand(
      "compare", "Every engine on the same problem from the same start, and a bound for pose graphs");
  command->add_option("FILE", a->files, "Problem files, as for solve")->required();
  add_start_option(*command, a->init);
  command->add_option("--iterations", a->iterations, "Most steps, rejected ones counted")
      ->check(whole_number(0, 1'000'000))
      ->capture_default_str();
  command->add_option("--json", a->json, "Report, an array with one object a file; - is standard output");
  command->callback([a, &exit_code] {
    const Result<int> done = compare_all(*a);
    exit_code = done ? *done : refuse(done.error());
  });
}

}  // namespace oriel::apps
