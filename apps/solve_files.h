// Files in, values found, reports out: what `oriel solve` and `oriel demo` do alike.
#pragma once
#include <string>

#include "apps/batch_problem.h"
#include "apps/solve_report.h"
#include "oriel/solve/options.h"

namespace oriel::apps {

// Solves with the engine of this library. A target that is not empty gets the new values, unless the solve failed.
Result<SolvedFile> solve_problem(BatchProblem& problem, const SolveOptions& options, const std::string& target);

}  // namespace oriel::apps
