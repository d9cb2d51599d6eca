// What a solve has to say. It holds numbers and ids; text is made when it is printed.
#pragma once
#include <array>
#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

#include "oriel/graph/ids.h"
#include "oriel/solve/options.h"

namespace oriel {

class Graph;

// Why a solve ended, each with the inequality that says so.
enum class Reason {
  nothing_to_do,        // no free variable, or no factor
  function_tolerance,   // cost decrease ≤ tolerance · cost
  gradient_tolerance,   // max |gradient| ≤ tolerance
  step_tolerance,       // max |step| ≤ tolerance
  no_descending_step,   // λ > λ_max, or the trust region's radius < the least one, and no step lowers the cost: the
                        // fixed point of first estimates, or rounding
  max_iterations,       // iterations = max_iterations
  deadline,             // seconds > deadline
  stopped_by_callback,  // callback() = false
  diverged,             // Gauss–Newton: cost(x ⊞ step) > cost(x)
  not_finite,           // the cost or the linear system at the start is not finite
  refused,              // the engine cannot do what it was asked for; `refusal` says what
};

// A scalar of a variable that nothing determines (given all others).
struct UndeterminedScalar {
  VariableKey id;
  int tangent = 0;  // which direction of its tangent space
};

// A direction along which the cost does not change.
struct UndeterminedDirection {
  std::vector<UndeterminedScalar> scalars;  // where the direction has its largest parts, largest first
  std::size_t variables = 0;                // how many variables it moves
};

struct StageTimes {
  double structure = 0.0, evaluate = 0.0, linearize = 0.0, eliminate = 0.0, factor = 0.0, solve = 0.0, retract = 0.0;
  double adopt = 0.0, total = 0.0;  // [s]
};

struct [[nodiscard]] Summary {
  Reason reason = Reason::nothing_to_do;
  double reason_value = 0.0, reason_bound = 0.0;  // the two sides of its inequality
  std::string refusal;                            // one line; empty unless refused
  Method method = Method::levenberg_marquardt;
  int iterations = 0, accepted = 0, rejected = 0, linearizations = 0;
  double initial_cost = 0.0;
  double final_cost = 0.0;  // over the factors that were active at the last accepted point
  // Over the factors that are valid at the final values: differs where some have a residual there and no finite
  // Jacobian. As final_cost where the solve failed, or a deadline leaves no time to look.
  double fresh_cost = 0.0;
  double gradient = 0.0;  // largest entry at the last linearization
  // What the newest linear model promised to gain by its step [cost]; none before a step was computed. While the step
  // was not taken (gain_open) this is what is left to gain. Once it was taken, what is left is not known, since nothing
  // was linearized after it; as a rule it is less.
  std::optional<double> predicted_gain;
  bool gain_open = false;
  double lambda = 0.0;
  std::int64_t factors = 0, invalid_factors = 0;  // invalid at the end; they are not in the cost
  std::int64_t not_finite_factors = 0;            // of those, the ones whose r or Jacobian is a NaN or an infinity
  std::vector<FactorId> not_finite;               // which (the first 16)
  int kept_dim = 0, landmark_dim = 0, fronts = 0;
  double factor_flops = 0.0, schur_flops = 0.0;
  std::int64_t kernel_fallbacks = 0;  // products without a fixed-size kernel
  const char* linear_solver = "";
  std::int64_t linear_iterations = 0;  // of conjugate gradients
  StageTimes seconds;
  std::vector<IterationReport> trace;
  // Neither is looked for once a deadline has passed, nor by conjugate gradients.
  std::vector<UndeterminedDirection> undetermined;  // confined to few variables: something is missing
  std::vector<UndeterminedDirection> gauge;         // common to many: where and how the whole is turned

  // False after any numerical failure, and after a limit ended the solve.
  bool converged() const {
    return reason == Reason::function_tolerance || reason == Reason::gradient_tolerance ||
           reason == Reason::step_tolerance || reason == Reason::no_descending_step || reason == Reason::nothing_to_do;
  }
  bool failed() const {
    return reason == Reason::not_finite || reason == Reason::diverged || reason == Reason::refused;
  }
  // "|decrease| 3.1e-12 <= 1e-09 * cost"
  std::string reason_text() const;
  // "left to gain: 0.013, by the linear model"
  std::string left_text() const;
};

std::ostream& operator<<(std::ostream& out, const Summary& summary);
// One line a direction, e.g. "pose3/1 'x7': translation z [m]".
std::string describe(const Graph& graph, const UndeterminedDirection& direction);

}  // namespace oriel
