// What a caller of solve may choose. Every default is what the command and the benchmarks use.
#pragma once
#include "oriel/base/function.h"
#include "oriel/base/time.h"
#include "oriel/linear/conjugate_gradient_options.h"
#include "oriel/linear/ordering.h"

namespace oriel {

enum class Method { levenberg_marquardt, gauss_newton, dogleg };

// One line of the trace, and what a callback sees after each iteration.
struct IterationReport {
  int iteration = 0;      // 0: the start
  double seconds = 0.0;   // since solve began, ordering and symbolic work included
  double cost = 0.0;      // of the best values so far
  double gradient = 0.0;  // largest entry of the gradient
  double lambda = 0.0;    // damping
  double radius = 0.0;    // of the trust region, where there is one
  bool accepted = true;
};

// For options that the engine chooses by the problem (solve/defaults.h). A regression, where nothing is free but one
// VectorN, is given what its digits need; everything else what a fair start needs.
inline constexpr int kAutomatic = -1;

struct SolveOptions {
  Method method = Method::levenberg_marquardt;
  int max_iterations = kAutomatic;  // accepted or rejected steps; 100, of a regression 10 000
  int threads = 1;                  // of this solve; the result has the same bits for any number
  // Converged where: cost falls by ≤ function_tolerance · cost; or the largest gradient entry ≤ gradient_tolerance;
  // or |step| ≤ step_tolerance (in tangent units, per scalar).
  // Chosen by the engine: 1e-9, 1e-10 and 1e-12; of a regression 1e-16, 0 and 0.
  double function_tolerance = kAutomatic, gradient_tolerance = kAutomatic, step_tolerance = kAutomatic;
  // Damping to begin with, relative to the diagonal of H. 0: 1e-4 where landmarks are eliminated (their depths are far
  // from linear), 1e4 for a regression (it starts from anywhere), 1e-8 elsewhere (a pose graph from a fair start is
  // best left to Gauss–Newton).
  double initial_lambda = 0.0;
  // Of a dogleg's trust region to begin with, in units of √diag(H). 0: 1e4 where landmarks are eliminated, 0.2 for a
  // regression, none elsewhere: the first Gauss–Newton step is tried as it is.
  double initial_radius = 0.0;
  // automatic: direct, but for bundle adjustments too large to factor; by sizes alone.
  LinearSolver linear_solver = LinearSolver::automatic;
  ConjugateGradientOptions conjugate_gradient = {};
  // Comes back at most one stage after it (linearize, eliminate, factor, solve, retract, evaluate) with the best values
  // so far; layout, ordering and the first cost are one stage, the start. 0: none.
  Duration deadline{0};
  bool first_estimates = true;  // Jacobians at first estimates where a prior has fixed them
  bool trace = true;            // keep an IterationReport for each iteration
  OrderingMethod ordering = OrderingMethod::automatic;
  // Called after each iteration; false stops the solve with the best values so far.
  Function<bool(const IterationReport&)> callback = {};
  // What the deadline and all times are measured by, seconds since whenever; empty: the steady clock of the machine.
  Function<double()> clock = {};
};

}  // namespace oriel
