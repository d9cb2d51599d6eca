// Files in, values found, reports out: what `oriel solve` and `oriel demo` do alike.
#pragma once
#include <string>

#include "apps/batch_problem.h"
#include "apps/solve_report.h"
#include "oriel/solve/options.h"

namespace oriel::apps {

// Where results go; empty: nowhere.
struct SolveTargets {
  std::string out;  // the problem with the values found
  std::string svg;  // a picture of the values before and after
};

struct SolveSettings {
  SolveOptions options;
  SolveTargets targets;
  bool graduated = false;  // in rounds: solve/graduated.h
  CovarianceRequest covariance;
  std::string engine = "native";  // one that this program has
};

// Targets are written unless the solve failed.
Result<SolvedFile> solve_problem(BatchProblem& problem, const SolveSettings& settings);

}  // namespace oriel::apps
