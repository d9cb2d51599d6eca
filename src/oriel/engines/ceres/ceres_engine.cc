#include "oriel/engines/ceres/ceres_engine.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <string_view>

#include "oriel/engines/ceres/ceres_problem.h"
#include "oriel/solve/defaults.h"

namespace oriel {
namespace {

using ceres_detail::CeresProblem;

constexpr double kLeastRadius = 1e-32, kLeastLambda = 1e-16;

double now(const SolveOptions& options) {
  if (options.clock) return options.clock();
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Ceres's iterations as ours: the trace, the callback, what ends a solve that Ceres would go on with, and what the last
// one looked like.
class Reporter final : public ceres::IterationCallback {
 public:
  enum class End { none, callback, deadline, diverged };

  Reporter(const SolveOptions& options, double began, Summary& summary)
      : options_(options), began_(began), summary_(summary) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& s) override {
    seconds_ = now(options_) - began_;
    last_ = s;
    const bool accepted = s.step_is_successful || s.iteration == 0;
    const IterationReport report{
        s.iteration,           seconds_, s.cost, s.gradient_max_norm, 1.0 / s.trust_region_radius,
        s.trust_region_radius, accepted};
    if (options_.trace) summary_.trace.push_back(report);
    if (options_.callback && !options_.callback(report))
      end_ = End::callback;
    else if (options_.method == Method::gauss_newton && !accepted)
      end_ = End::diverged;
    else if (options_.deadline.ns > 0 && seconds_ > options_.deadline.seconds())
      end_ = End::deadline;
    return end_ == End::none ? ceres::SOLVER_CONTINUE : ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  }
  const ceres::IterationSummary& last() const { return last_; }
  End end() const { return end_; }
  double seconds() const { return seconds_; }

 private:
  const SolveOptions& options_;
  double began_;
  Summary& summary_;
  ceres::IterationSummary last_;
  End end_ = End::none;
  double seconds_ = 0.0;  // of the last one
};

ceres::Solver::Options ceres_options(const SolveOptions& options, const Settled& settled, bool landmarks) {
  ceres::Solver::Options o;
  o.linear_solver_type = landmarks ? ceres::SPARSE_SCHUR : ceres::SPARSE_NORMAL_CHOLESKY;
  o.initial_trust_region_radius = 1.0 / std::max(settled.initial_lambda, kLeastLambda);
  if (options.method == Method::dogleg) {
    o.trust_region_strategy_type = ceres::DOGLEG;
    o.initial_trust_region_radius = std::min(settled.initial_radius, 1.0 / kLeastLambda);
  }
  o.max_trust_region_radius = 1e20;
  o.min_trust_region_radius = kLeastRadius;
  o.max_num_iterations = settled.max_iterations;
  o.num_threads = options.threads;
  o.function_tolerance = settled.function_tolerance;
  o.gradient_tolerance = settled.gradient_tolerance;
  o.parameter_tolerance = 0.0;         // relative in Ceres, which ours is not
  o.max_solver_time_in_seconds = 1e9;  // the reporter looks at the clock that was asked for
  o.logging_type = ceres::SILENT;
  return o;
}

void set_reason(Summary& s, Reason reason, double value, double bound) {
  s.reason = reason, s.reason_value = value, s.reason_bound = bound;
}

// Of the step that gained too little to be taken Ceres says it in a sentence alone: "... |cost_change|/cost: 1e-10 <=
// ".
double told_decrease(const ceres::Solver::Summary& c) {
  constexpr std::string_view kBefore = "|cost_change|/cost: ";
  const std::size_t at = c.message.find(kBefore);
  return at == std::string::npos ? 0.0 : std::strtod(c.message.c_str() + at + kBefore.size(), nullptr) * c.final_cost;
}

void explain(const SolveOptions& options, const Settled& settled, const ceres::Solver::Summary& c,
             const Reporter& reporter, Summary& s) {
  using End = Reporter::End;
  const ceres::IterationSummary& last = reporter.last();
  const double cost = c.final_cost;
  const bool converged = c.termination_type == ceres::CONVERGENCE;
  if (c.termination_type == ceres::FAILURE || !std::isfinite(cost))
    set_reason(s, Reason::not_finite, c.initial_cost, 0.0);
  else if (reporter.end() == End::callback)
    set_reason(s, Reason::stopped_by_callback, 0.0, 0.0);
  else if (reporter.end() == End::deadline)
    set_reason(s, Reason::deadline, reporter.seconds(), options.deadline.seconds());
  else if (reporter.end() == End::diverged)
    set_reason(s, Reason::diverged, cost - last.cost_change, cost);
  else if (converged && last.gradient_max_norm <= settled.gradient_tolerance)
    set_reason(s, Reason::gradient_tolerance, last.gradient_max_norm, settled.gradient_tolerance);
  else if (converged && last.trust_region_radius <= kLeastRadius)
    set_reason(s, Reason::no_descending_step, 1.0 / last.trust_region_radius, 1.0 / kLeastRadius);
  else if (converged)
    set_reason(s, Reason::function_tolerance, told_decrease(c), settled.function_tolerance * cost);
  else
    set_reason(s, Reason::max_iterations, s.iterations, settled.max_iterations);
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

CeresEngine::CeresEngine(Graph& graph)
    : graph_(&graph), subscription_(graph.subscribe()), problem_(std::make_unique<CeresProblem>()) {}

CeresEngine::~CeresEngine() { graph_->unsubscribe(subscription_); }

EngineCapabilities CeresEngine::capabilities() const noexcept {
  EngineCapabilities can;
  can.levenberg_marquardt = can.gauss_newton = can.dogleg = can.deadline = can.callback = can.threads = true;
  can.losses = can.linear_priors = can.first_estimates = can.freedoms = can.covariance = can.incremental = true;
  return can;
}

Result<void> CeresEngine::sync() noexcept {
  if (seen_version_ == graph_->version()) return {};
  graph_->collect(subscription_, net_);
  if (net_.whole()) problem_ = std::make_unique<CeresProblem>();  // it had fallen too far behind
  problem_->apply(net_);
  problem_->take_values(*graph_);
  seen_version_ = graph_->version();
  return {};
}

Summary CeresEngine::solve(const SolveOptions& options) noexcept {
  const double began = now(options);
  if (auto ok = can_solve(*this, *graph_, options); !ok) {
    failed_ = true;
    return refused(options, ok.error());
  }
  (void)sync();                                     // it never fails
  const std::uint64_t version = graph_->version();  // what the user sets from now on (in a callback) is newer (C5)
  Summary s;
  s.method = options.method;
  const CeresProblem::Size size = problem_->size();
  s.factors = size.factors, s.kept_dim = size.dim;
  s.invalid_factors = problem_->freeze(options.first_estimates);
  failed_ = false;
  if (size.dim == 0 || size.factors == 0) {
    problem_->thaw();
    s.initial_cost = s.final_cost = s.fresh_cost = problem_->cost();
    return s;
  }
  // Never as a regression: a step that can gain nothing any more, which comes before the last digit, is a failure to
  // Ceres.
  const Settled settled = settle(options, size.has_landmarks, false);
  ceres::Solver::Options o = ceres_options(options, settled, size.has_landmarks);
  Reporter reporter(options, began, s);
  o.callbacks.push_back(&reporter);
  ceres::Solver::Summary c;
  ceres::Solve(o, &problem_->problem(), &c);
  problem_->thaw();
  copy_figures(c, s);
  s.gradient = reporter.last().gradient_max_norm;
  s.lambda = 1.0 / reporter.last().trust_region_radius;
  explain(options, settled, c, reporter, s);
  if (!s.failed() && !graph_->adopt(problem_->solution(version))) set_reason(s, Reason::not_finite, s.final_cost, 0.0);
  failed_ = s.failed();
  if (failed_) s.final_cost = s.initial_cost;
  seen_version_ = ~std::uint64_t{0};  // the problem has values of its own now
  s.fresh_cost = cost();
  s.seconds.total = now(options) - began;
  return s;
}

double CeresEngine::cost() noexcept {
  (void)sync();
  return problem_->cost();
}

Result<EngineContents> CeresEngine::contents() noexcept {
  (void)sync();
  EngineContents out = problem_->contents();
  out.cost = problem_->cost();
  return out;
}

Result<void> CeresEngine::joint_covariance(std::span<const VariableKey> ids, std::vector<double>& out) noexcept {
  const auto size = covariance_size(*graph_, ids);
  if (!size) return size.error();
  if (failed_) return Error{ErrorCode::conflict, "covariance: the last solve failed, so there is none"};
  (void)sync();
  if (problem_->covariance(ids, *size, out)) return {};
  return Error{ErrorCode::singular, "covariance of " + graph_->describe(ids[0]) +
                                        ": some direction of the graph is determined by nothing (so Ceres's QR finds)"};
}

}  // namespace oriel
