// versus_ceres: problem files, Oriel against Ceres at the best of several settings. What counts is the time from the
// call of the solver to within 1e-4 of the best cost that anybody found; runs alternate, and ratios are of pairs.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <variant>

#include "benchmarks/support/ceres_files.h"
#include "benchmarks/support/fair_environment.h"
#include "benchmarks/support/peak.h"
#include "benchmarks/support/statistics.h"
#include "oriel/io/problem.h"
#include "oriel/io/problem_format.h"
#include "oriel/solve/native_engine.h"

namespace oriel::benchmark {
namespace {

constexpr double kWithin = 1e-4;

struct Arguments {
  std::vector<std::string> files;
  int runs = 5, threads = 1;
  std::string json;
};

using ProblemFile = std::variant<PoseGraphFile, BalFile>;

Result<ProblemFile> read_problem(const std::string& path) {
  const auto format = detect_format(path);
  if (!format) return format.error();
  if (*format == ProblemFormat::bal) {
    auto file = read_bal(path);
    if (!file) return file.error();
    return ProblemFile(std::move(*file));
  }
  auto file = read_g2o(path);
  if (!file) return file.error();
  if (!file->has_vertices)
    return Error{ErrorCode::bad_input, "expected VERTEX lines: both sides start from the file's values", path, 0};
  return ProblemFile(std::move(*file));
}

Result<void> build(Graph& graph, const ProblemFile& file) {
  const auto outcome = [](const auto& result) { return result ? Result<void>() : Result<void>(result.error()); };
  if (const auto* bal = std::get_if<BalFile>(&file)) return outcome(add_bundle_adjustment(graph, *bal, Loss::none()));
  const auto& poses = std::get<PoseGraphFile>(file);
  if (poses.is_3d) return outcome(add_pose_graph3(graph, poses, {}));
  return outcome(add_pose_graph2(graph, poses, {}));
}

struct OrielRun {
  Trace trace;
  Summary summary;
};
Result<OrielRun> run_oriel(const ProblemFile& file, int threads) {
  Graph graph;
  if (auto ok = build(graph, file); !ok) return ok.error();
  NativeEngine engine(graph);
  SolveOptions options;
  options.threads = threads;
  OrielRun run;
  run.summary = engine.solve(options);
  for (const IterationReport& r : run.summary.trace) run.trace.points.push_back({r.seconds, r.cost});
  run.trace.total = run.summary.seconds.total;
  run.trace.iterations = run.summary.iterations;
  return run;
}

// All runs of one file; setting s of Ceres at run i: ceres[s][i].
struct Contest {
  std::vector<CeresFileSetting> settings;
  std::vector<std::vector<Trace>> ceres;
  std::vector<OrielRun> oriel;
  double best = HUGE_VAL;

  std::vector<double> times_of_ceres(std::size_t s) const {
    std::vector<double> out;
    for (const Trace& t : ceres[s]) out.push_back(time_to(t, target()));
    return out;
  }
  std::vector<double> times_of_oriel() const {
    std::vector<double> out;
    for (const OrielRun& r : oriel) out.push_back(time_to(r.trace, target()));
    return out;
  }
  double target() const { return best * (1.0 + kWithin); }
  std::size_t best_setting() const {
    std::size_t best_s = 0;
    for (std::size_t s = 1; s < settings.size(); ++s)
      if (median(times_of_ceres(s)) < median(times_of_ceres(best_s))) best_s = s;
    return best_s;
  }
};

Result<Contest> contest(const ProblemFile& file, const Arguments& a) {
  Contest c;
  const bool bal = std::holds_alternative<BalFile>(file);
  c.settings = bal ? ceres_settings_for_bundle_adjustment() : ceres_settings_for_pose_graphs();
  c.ceres.resize(c.settings.size());
  CeresFileOptions options;
  options.threads = a.threads;
  for (int i = 0; i < a.runs; ++i) {
    for (std::size_t s = 0; s < c.settings.size(); ++s) {
      c.ceres[s].push_back(
          std::visit([&](const auto& f) { return solve_with_ceres(f, c.settings[s], options); }, file));
      c.best = std::min(c.best, best_cost(c.ceres[s].back()));
    }
    auto run = run_oriel(file, a.threads);
    if (!run) return run.error();
    c.best = std::min(c.best, best_cost(run->trace));
    c.oriel.push_back(std::move(*run));
  }
  return c;
}

// Both have to begin at the same cost, or they do not solve the same problem.
double start_difference(const Contest& c) {
  const double ours = c.oriel.front().trace.points.front().cost, theirs = c.ceres.front().front().points.front().cost;
  return std::fabs(ours - theirs) / theirs;
}

double paired_ratio(const Contest& c) {
  const auto ours = c.times_of_oriel(), theirs = c.times_of_ceres(c.best_setting());
  std::vector<double> ratio;
  for (std::size_t i = 0; i < ours.size(); ++i) ratio.push_back(ours[i] / theirs[i]);
  return median(ratio);
}

// Times and rates of Oriel's stages, from the run whose total is the median.
nlohmann::json stages(const Contest& c) {
  std::vector<double> totals;
  for (const OrielRun& r : c.oriel) totals.push_back(r.trace.total);
  const double middle = median(totals);
  const auto at = std::find_if(c.oriel.begin(), c.oriel.end(), [&](auto& r) { return r.trace.total == middle; });
  const Summary& s = at->summary;
  const auto rate = [&s](double flops, double seconds) {
    return seconds > 0.0 ? 1e-9 * flops * s.iterations / seconds : 0.0;
  };
  const auto ms = [](double t) { return 1e3 * t; };
  return {{"structure_ms", ms(s.seconds.structure)},
          {"evaluate_ms", ms(s.seconds.evaluate)},
          {"linearize_ms", ms(s.seconds.linearize)},
          {"eliminate_ms", ms(s.seconds.eliminate)},
          {"factor_ms", ms(s.seconds.factor)},
          {"solve_ms", ms(s.seconds.solve)},
          {"retract_ms", ms(s.seconds.retract)},
          {"total_ms", ms(s.seconds.total)},
          {"iterations", s.iterations},
          {"linearizations", s.linearizations},
          {"factor_mflop", 1e-6 * s.factor_flops},
          {"factor_gflops", rate(s.factor_flops, s.seconds.factor)},
          {"schur_mflop", 1e-6 * s.schur_flops},
          {"schur_gflops", rate(s.schur_flops, s.seconds.eliminate)},
          {"linear_solver", s.linear_solver}};
}

nlohmann::json report(const std::string& path, const Contest& c) {
  const std::size_t best = c.best_setting();
  const double ours = 1e3 * median(c.times_of_oriel()), theirs = 1e3 * median(c.times_of_ceres(best));
  const std::string name = path.substr(path.rfind('/') + 1);
  std::printf("%-28s best %-14.9g oriel %9.2f ms (%d iterations)  ceres %9.2f ms (%s)  ratio %.2f\n", name.c_str(),
              c.best, ours, c.oriel.front().trace.iterations, theirs, c.settings[best].name.c_str(), paired_ratio(c));
  if (!(start_difference(c) < 1e-9)) std::printf("    THE COSTS AT THE START DIFFER by %.1e\n", start_difference(c));
  nlohmann::json settings;
  for (std::size_t s = 0; s < c.settings.size(); ++s) {
    const double t = 1e3 * median(c.times_of_ceres(s));
    settings[c.settings[s].name] = std::isfinite(t) ? nlohmann::json(t) : nlohmann::json(nullptr);
    std::printf("    ceres %-30s %9.2f ms, %d iterations\n", c.settings[s].name.c_str(), t,
                c.ceres[s].front().iterations);
  }
  const nlohmann::json st = stages(c);
  const auto n = [&st](const char* key) { return st[key].get<double>(); };
  std::printf(
      "    oriel [ms]: structure %.2f evaluate %.2f linearize %.2f eliminate %.2f factor %.2f solve %.2f, total %.2f\n",
      n("structure_ms"), n("evaluate_ms"), n("linearize_ms"), n("eliminate_ms"), n("factor_ms"), n("solve_ms"),
      n("total_ms"));
  std::printf("    factor %.1f Mflop at %.1f GF/s, landmarks %.1f Mflop at %.1f GF/s\n", n("factor_mflop"),
              n("factor_gflops"), n("schur_mflop"), n("schur_gflops"));
  return {{"file", name},
          {"best_cost", c.best},
          {"oriel_ms", ours},
          {"ceres_ms", theirs},
          {"ceres_setting", c.settings[best].name},
          {"ceres_settings_ms", settings},
          {"ratio", paired_ratio(c)},
          {"start_cost_difference", start_difference(c)},
          {"stages", st}};
}

bool parse(int argc, char** argv, Arguments& a) {
  for (int i = 1; i < argc; ++i) {
    const std::string key = argv[i];
    const bool option = key.starts_with("--");
    if (option && i + 1 >= argc) return false;
    if (key == "--runs")
      a.runs = std::atoi(argv[++i]);
    else if (key == "--threads")
      a.threads = std::atoi(argv[++i]);
    else if (key == "--json")
      a.json = argv[++i];
    else if (option)
      return false;
    else
      a.files.push_back(key);
  }
  return !a.files.empty() && a.runs >= 1 && a.threads >= 1;
}

int run(int argc, char** argv) {
  Arguments a;
  if (!parse(argc, argv, a)) {
    std::fprintf(stderr, "versus_ceres FILE... [--runs 5] [--threads 1] [--json FILE]\n");
    return 2;
  }
  const double peak = fused_multiply_add_peak(), product = matrix_product_rate();
  std::printf("one core: FMA %.0f GF/s, matrix product %.0f GF/s; %d runs, %d thread(s)\n", 1e-9 * peak, 1e-9 * product,
              a.runs, a.threads);
  nlohmann::json out = {{"fma_gflops", 1e-9 * peak},
                        {"product_gflops", 1e-9 * product},
                        {"runs", a.runs},
                        {"threads", a.threads},
                        {"problems", nlohmann::json::array()}};
  for (const std::string& path : a.files) {
    const auto file = read_problem(path);
    const auto result = file ? contest(*file, a) : Result<Contest>(file.error());
    if (!result) {
      std::fprintf(stderr, "versus_ceres: %s\n", result.error().text().c_str());
      return 2;
    }
    out["problems"].push_back(report(path, *result));
  }
  if (!a.json.empty()) std::ofstream(a.json) << out.dump(2) << '\n';
  return 0;
}

}  // namespace
}  // namespace oriel::benchmark

int main(int argc, char** argv) {
  oriel::benchmark::require_single_threaded_blas(argv);
  return oriel::benchmark::run(argc, argv);
}
