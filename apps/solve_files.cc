#include "apps/solve_files.h"

#include <chrono>
#include <utility>

#include "apps/command.h"
#include "apps/engine_choice.h"
#include "oriel/io/text.h"
#include "oriel/solve/graduated.h"

namespace oriel::apps {
namespace {

Result<void> write_targets(BatchProblem& problem, const SolveTargets& targets, const Drawing& before) {
  if (!targets.out.empty())
    if (auto ok = write_problem(problem, targets.out); !ok) return ok;
  if (targets.svg.empty()) return {};
  return write_text_file(targets.svg, format_svg(problem.path, before, draw(problem)));
}

Result<void> solve(BatchProblem& problem, Engine& engine, const SolveSettings& settings, SolvedFile& f) {
  if (auto ok = can_solve(engine, *problem.graph, settings.options); !ok) return ok;
  if (!settings.graduated) {
    f.summary = engine.solve(settings.options);
    return {};
  }
  const auto began = std::chrono::steady_clock::now();
  const double before = engine.cost();
  GraduatedOptions rounds;
  rounds.solve = settings.options;
  Result<GraduatedReport> report = solve_graduated(*problem.graph, engine, rounds);
  if (!report) return report.error();
  f.summary = std::move(report->summary);
  f.summary.initial_cost = before;  // of the whole way, not of its last round
  f.summary.iterations = report->iterations;
  f.summary.seconds.total = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  f.graduated =
      SolvedFile::Graduated{report->rounds, report->graduated, static_cast<std::int64_t>(report->outliers.size())};
  return {};
}

}  // namespace

Result<SolvedFile> solve_problem(BatchProblem& problem, const SolveSettings& settings) {
  if (auto ok = check_form(problem, settings.targets.out); !ok) return ok.error();
  const Result<std::vector<VariableKey>> wanted = find_variables(problem, settings.covariance);
  if (!wanted) return wanted.error();
  const Drawing before = settings.targets.svg.empty() ? Drawing() : draw(problem);
  const auto began = std::chrono::steady_clock::now();
  const std::unique_ptr<Engine> engine = make_engine(settings.engine, *problem.graph);
  SolvedFile f;
  if (auto ok = solve(problem, *engine, settings, f); !ok) return ok.error();
  if (!f.summary.failed())
    if (auto ok = write_targets(problem, settings.targets, before); !ok) return ok.error();
  if (!wanted->empty()) f.covariances = covariances(problem, *engine, settings.covariance, *wanted);
  f.path = problem.path;
  f.format = problem.format();
  f.poses = problem.poses(), f.landmarks = problem.landmarks(), f.factors = problem.factors();
  if (const auto* file = std::get_if<PoseGraphFile>(&problem.file))
    f.self_edges_left_out = file->self_edges_left_out, f.information_repaired = file->information_repaired;
  f.start = problem.start;
  f.threads = settings.options.threads;
  f.gauge = gauge_text(problem, f.summary);
  f.undetermined = undetermined_texts(problem, f.summary);
  f.read_seconds = problem.read_seconds, f.setup_seconds = problem.setup_seconds;
  const std::chrono::duration<double> since = std::chrono::steady_clock::now() - began;
  f.total_seconds = f.read_seconds + f.setup_seconds + since.count();
  f.peak_rss_mb = peak_rss_mb();
  return f;
}

}  // namespace oriel::apps
