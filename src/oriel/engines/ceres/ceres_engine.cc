#include "oriel/engines/ceres/ceres_engine.h"

#include <chrono>
#include <cmath>

#include "oriel/engines/ceres/ceres_problem.h"

namespace oriel {
namespace {

using ceres_detail::CeresProblem;

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

// Ceres's iterations as ours: the trace, the callback, and what the last one looked like.
class Reporter final : public ceres::IterationCallback {
 public:
  Reporter(const SolveOptions& options, double began, Summary& summary)
      : options_(options), began_(began), summary_(summary) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& s) override {
    const IterationReport report{s.iteration,
                                 now() - began_,
                                 s.cost,
                                 s.gradient_max_norm,
                                 1.0 / s.trust_region_radius,
                                 s.trust_region_radius,
                                 s.step_is_successful || s.iteration == 0};
    if (options_.trace) summary_.trace.push_back(report);
    last_ = s;
    if (options_.callback && !options_.callback(report)) {
      stopped_ = true;
      return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
    }
    return ceres::SOLVER_CONTINUE;
  }
  const ceres::IterationSummary& last() const { return last_; }
  bool stopped() const { return stopped_; }

 private:
  const SolveOptions& options_;
  double began_;
  Summary& summary_;
  ceres::IterationSummary last_;
  bool stopped_ = false;
};

// The damping that the native engine begins with where the caller leaves it to the engine (solve/options.h).
double initial_lambda(const SolveOptions& options, bool landmarks) {
  if (options.method == Method::gauss_newton) return 1e-16;
  if (options.initial_lambda > 0.0) return options.initial_lambda;
  return landmarks ? 1e-4 : 1e-8;
}

ceres::Solver::Options ceres_options(const SolveOptions& options, bool landmarks) {
  ceres::Solver::Options o;
  o.linear_solver_type = landmarks ? ceres::SPARSE_SCHUR : ceres::SPARSE_NORMAL_CHOLESKY;
  o.initial_trust_region_radius = 1.0 / initial_lambda(options, landmarks);
  if (options.method == Method::dogleg) {
    o.trust_region_strategy_type = ceres::DOGLEG;
    o.initial_trust_region_radius = options.initial_radius > 0.0 ? options.initial_radius : landmarks ? 1e4 : 1e16;
  }
  o.max_trust_region_radius = 1e20;
  o.max_num_iterations = options.max_iterations;
  o.num_threads = options.threads;
  o.function_tolerance = options.function_tolerance;
  o.gradient_tolerance = options.gradient_tolerance;
  o.parameter_tolerance = 0.0;  // relative in Ceres, which ours is not
  if (options.deadline.ns > 0) o.max_solver_time_in_seconds = options.deadline.seconds();
  o.logging_type = ceres::SILENT;
  return o;
}

void set_reason(Summary& s, Reason reason, double value, double bound) {
  s.reason = reason, s.reason_value = value, s.reason_bound = bound;
}

// Ceres says why it stopped in a sentence alone; the numbers are looked at instead.
void explain(const SolveOptions& options, const ceres::Solver::Summary& c, const Reporter& reporter, Summary& s) {
  const ceres::IterationSummary& last = reporter.last();
  const double cost = c.final_cost;
  if (c.termination_type == ceres::FAILURE || !std::isfinite(cost))
    set_reason(s, Reason::not_finite, c.initial_cost, 0.0);
  else if (reporter.stopped())
    set_reason(s, Reason::stopped_by_callback, 0.0, 0.0);
  else if (c.termination_type == ceres::CONVERGENCE && last.gradient_max_norm <= options.gradient_tolerance)
    set_reason(s, Reason::gradient_tolerance, last.gradient_max_norm, options.gradient_tolerance);
  else if (c.termination_type == ceres::CONVERGENCE && std::fabs(last.cost_change) <= options.function_tolerance * cost)
    set_reason(s, Reason::function_tolerance, std::fabs(last.cost_change), options.function_tolerance * cost);
  else if (c.termination_type == ceres::CONVERGENCE)
    set_reason(s, Reason::no_descending_step, 1.0 / last.trust_region_radius, 1e32);
  else if (s.iterations >= options.max_iterations)
    set_reason(s, Reason::max_iterations, s.iterations, options.max_iterations);
  else
    set_reason(s, Reason::deadline, s.seconds.total, options.deadline.seconds());
}

void copy_figures(const ceres::Solver::Summary& c, Summary& s) {
  s.initial_cost = c.initial_cost;
  s.final_cost = c.final_cost;
  s.accepted = std::max(0, c.num_successful_steps - 1);  // Ceres counts the start
  s.rejected = c.num_unsuccessful_steps;
  s.iterations = s.accepted + s.rejected;
  s.linearizations = c.num_jacobian_evaluations;
  s.linear_solver = c.linear_solver_type_used == ceres::SPARSE_SCHUR ? "ceres_sparse_schur" : "ceres_sparse_cholesky";
  s.seconds.structure = c.preprocessor_time_in_seconds;
  s.seconds.evaluate = c.residual_evaluation_time_in_seconds;
  s.seconds.linearize = c.jacobian_evaluation_time_in_seconds;
  s.seconds.solve = c.linear_solver_time_in_seconds;
}

}  // namespace

Summary CeresEngine::solve(const SolveOptions& options) noexcept {
  const double began = now();
  Summary s;
  s.method = options.method;
  CeresProblem problem(*graph_, options.first_estimates);
  problem.freeze();
  s.factors = problem.factors();
  s.invalid_factors = problem.invalid();
  s.kept_dim = problem.dim();
  if (problem.dim() == 0 || s.factors == 0) {
    s.initial_cost = s.final_cost = s.fresh_cost = problem.cost();
    return s;
  }
  ceres::Solver::Options o = ceres_options(options, problem.has_landmarks());
  Reporter reporter(options, began, s);
  o.callbacks.push_back(&reporter);
  ceres::Solver::Summary c;
  ceres::Solve(o, &problem.problem(), &c);
  copy_figures(c, s);
  s.gradient = reporter.last().gradient_max_norm;
  s.lambda = 1.0 / reporter.last().trust_region_radius;
  s.seconds.total = now() - began;
  explain(options, c, reporter, s);
  if (!s.failed()) (void)graph_->adopt(problem.solution(*graph_));
  s.fresh_cost = cost();
  s.seconds.total = now() - began;
  return s;
}

double CeresEngine::cost() noexcept { return CeresProblem(*graph_, false).cost(); }

Result<EngineContents> CeresEngine::contents() noexcept {
  CeresProblem problem(*graph_, false);
  EngineContents out = problem.contents(*graph_);
  out.cost = problem.cost();
  return out;
}

}  // namespace oriel
