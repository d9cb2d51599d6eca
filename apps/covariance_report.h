// `oriel solve --covariance`: which variables, by the names of the file, and how well each is known.
#pragma once
#include <string>
#include <vector>

#include "apps/batch_problem.h"
#include "oriel/solve/engine.h"

namespace oriel::apps {

struct CovarianceRequest {
  std::vector<std::string> names;  // "17": a pose or camera; "l5": a landmark or point; by the file's ids
  bool joint = false;              // one matrix of all
};

struct CovarianceBlock {
  std::vector<std::string> names;     // of the variables: "pose 17"
  std::vector<std::string> tangents;  // of rows and columns: "pose 17: translation x [m]"
  std::vector<double> matrix;         // column-major, n × n
  std::string error;                  // why there is none; then the matrix is empty
};

// An Error names what is not in the file, before anything is solved.
Result<std::vector<VariableKey>> find_variables(const BatchProblem& problem, const CovarianceRequest& request);

// At the solution, in the tangent spaces. One block a name, or one of all.
std::vector<CovarianceBlock> covariances(const BatchProblem& problem, Engine& engine, const CovarianceRequest& request,
                                         const std::vector<VariableKey>& ids);

// Standard deviations, a line each: "sigma of pose 17: translation x [m]: 0.012".
std::string covariance_text(const std::vector<CovarianceBlock>& blocks);

}  // namespace oriel::apps
