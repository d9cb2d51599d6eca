#include "apps/solve_files.h"

#include <chrono>
#include <utility>

#include "apps/command.h"
#include "oriel/io/text.h"
#include "oriel/solve/native_engine.h"

namespace oriel::apps {
namespace {

Result<void> write_targets(BatchProblem& problem, const SolveTargets& targets, const Drawing& before) {
  if (!targets.out.empty())
    if (auto ok = write_problem(problem, targets.out); !ok) return ok;
  if (targets.svg.empty()) return {};
  return write_text_file(targets.svg, format_svg(problem.path, before, draw(problem)));
}

}  // namespace

Result<SolvedFile> solve_problem(BatchProblem& problem, const SolveOptions& options, const SolveTargets& targets) {
  if (auto ok = check_form(problem, targets.out); !ok) return ok.error();
  const Drawing before = targets.svg.empty() ? Drawing() : draw(problem);
  const auto began = std::chrono::steady_clock::now();
  NativeEngine engine(*problem.graph);
  SolvedFile f;
  f.summary = engine.solve(options);
  if (!f.summary.failed())
    if (auto ok = write_targets(problem, targets, before); !ok) return ok.error();
  f.path = problem.path;
  f.format = problem.format();
  f.poses = problem.poses(), f.landmarks = problem.landmarks(), f.factors = problem.factors();
  if (const auto* file = std::get_if<PoseGraphFile>(&problem.file))
    f.self_edges_left_out = file->self_edges_left_out, f.information_repaired = file->information_repaired;
  f.start = problem.start;
  f.threads = options.threads;
  f.gauge = gauge_text(problem, f.summary);
  f.undetermined = undetermined_texts(problem, f.summary);
  f.read_seconds = problem.read_seconds, f.setup_seconds = problem.setup_seconds;
  const std::chrono::duration<double> since = std::chrono::steady_clock::now() - began;
  f.total_seconds = f.read_seconds + f.setup_seconds + since.count();
  f.peak_rss_mb = peak_rss_mb();
  return f;
}

}  // namespace oriel::apps
