#include "apps/solve_files.h"

#include <chrono>
#include <utility>

#include "apps/command.h"
#include "oriel/solve/native_engine.h"

namespace oriel::apps {

Result<SolvedFile> solve_problem(BatchProblem& problem, const SolveOptions& options, const std::string& target) {
  const auto began = std::chrono::steady_clock::now();
  NativeEngine engine(*problem.graph);
  SolvedFile f;
  f.summary = engine.solve(options);
  if (!target.empty() && !f.summary.failed())
    if (auto ok = write_problem(problem, target); !ok) return ok.error();
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
