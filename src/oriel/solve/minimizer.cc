// Levenberg–Marquardt, Gauss–Newton and Powell's dogleg. Damping: Marquardt's λ diag(H), updated after K. Madsen, H.
// Nielsen, O. Tingleff, "Methods for Non-Linear Least Squares Problems", 2004, section 3.2 (algorithm 3.16).
#include "oriel/solve/minimizer.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>

#include "oriel/solve/scaling.h"

namespace oriel {
namespace {

constexpr std::size_t kMostNotFinite = 16;  // named in a summary
constexpr double kLeastLambda = 1e-16, kLargestLambda = 1e16, kLeastRadius = 1e-32;
constexpr double kDoglegLambda = 1e-14, kLargestDoglegLambda = 1e-4;  // only so that there is a solution

double largest(const std::vector<double>& v) {
  double m = 0.0;
  for (const double x : v) m = std::isfinite(x) ? std::max(m, std::fabs(x)) : HUGE_VAL;
  return m;
}

}  // namespace

Minimizer::Minimizer(NativeEngine& engine, const SolveOptions& options)
    : e_(engine), options_(options), began_(now()) {}

Summary Minimizer::run() {
  if (start())
    while (!stopped_) {
      linearize();
      if (stopped_) break;
      while (!stopped_ && !iterate()) {
      }
    }
  finish();
  return std::move(summary_);
}

bool Minimizer::start() {
  summary_.method = options_.method;
  pool_ = e_.pool(options_.threads);
  {
    Stage stage(*this, summary_.seconds.structure);
    if (auto ok = e_.sync(options_, NativeEngine::For::solve); !ok) {
      stop(Reason::refused, 0, 0), summary_.refusal = ok.error().text();
      return false;
    }
  }
  const LinearStructure& s = e_.structure_;
  summary_.factors = static_cast<std::int64_t>(s.row_count() + s.prior_count());
  summary_.kept_dim = s.kept_dim();
  summary_.landmark_dim = s.dim() - s.kept_dim();
  summary_.fronts = static_cast<int>(s.factorization().symbolic().sequence().size());
  summary_.factor_flops = s.factorization().symbolic().flops();
  summary_.schur_flops = s.landmark_flops();
  name_linear_solver();
  settled_ = settle(options_, !s.landmarks().empty(), is_regression(*e_.graph_));
  lambda_ = options_.method == Method::dogleg ? kDoglegLambda : settled_.initial_lambda;
  if (options_.method == Method::dogleg) {
    e_.dogleg_.start(settled_.initial_radius);
    e_.product_.prepare(s);
  }
  fallbacks_before_ = e_.linearizer_.kernel_fallbacks();
  e_.solution_.version = e_.graph_->version();  // what the user sets from now on (in a callback) is newer (C5)
  e_.point_.take(*e_.graph_);
  e_.linearizer_.first_estimates = options_.first_estimates;
  if (options_.trace)
    summary_.trace.reserve(static_cast<std::size_t>(std::clamp(settled_.max_iterations, 0, 1000)) + 1);
  evaluate(e_.point_, nullptr, e_.active_);
  evaluated_ = true;
  cost_ = summary_.initial_cost = e_.active_.total;
  report(true);
  if (!std::isfinite(cost_))
    stop(Reason::not_finite, cost_, 0);
  else if (s.dim() == 0 || summary_.factors == 0)
    stop(Reason::nothing_to_do, 0, 0);
  return !stopped_;
}

void Minimizer::name_linear_solver() {
  const LinearStructure& s = e_.structure_;
  const bool dense = summary_.fronts <= 1;  // one front that holds everything
  summary_.linear_solver = s.landmarks().empty() ? dense ? "dense" : "multifrontal"
                           : !s.forms_reduced()  ? "landmark_schur+conjugate_gradient"
                           : s.landmark_panel()
                               ? dense ? "landmark_schur_panel+dense" : "landmark_schur_panel+multifrontal"
                           : dense ? "landmark_schur+dense"
                                   : "landmark_schur+multifrontal";
}

// One trial. True when a new linearization is wanted, or nothing more. A trial that a deadline cut short is no
// iteration: a replay that is told their number does the same work.
bool Minimizer::iterate() {
  if (summary_.iterations >= settled_.max_iterations) {
    stop(Reason::max_iterations, summary_.iterations, settled_.max_iterations);
    return true;
  }
  if (out_of_time()) return true;
  solved_ = find_step();
  if (stopped_) return true;
  double gain = 0.0;
  if (solved_) {
    summary_.predicted_gain = gain = options_.method == Method::dogleg ? e_.dogleg_.gain() : predicted_gain();
    summary_.gain_open = true;
    if (out_of_time()) return true;
    if (!step_is_tiny()) step_to_trial();
    if (!stopped_ && out_of_time()) return true;
  }
  ++summary_.iterations;
  if (stopped_) return true;
  if (solved_) {
    evaluate(e_.trial_, &e_.active_, e_.trial_active_);
    if (accept(e_.trial_active_.total, gain)) return true;
  }
  reject();
  return false;
}

void Minimizer::evaluate(const Point& point, const ActiveSet* frozen, ActiveSet& out) {
  Stage stage(*this, summary_.seconds.evaluate);
  e_.linearizer_.evaluate(*e_.graph_, e_.structure_, point, frozen, out, pool_);
}

void Minimizer::linearize() {
  if (out_of_time()) return;
  Stage stage(*this, summary_.seconds.linearize);
  e_.linearizer_.linearize(*e_.graph_, e_.structure_, e_.point_, &e_.active_, e_.system_, pool_);
  e_.restriction_.apply(*e_.graph_, e_.structure_, e_.point_, e_.system_);
  ++summary_.linearizations;
  begun_ = false;
  // Rows without a finite Jacobian have left the active set at this point, whose cost is another one then.
  cost_ = e_.active_.total;
  if (summary_.accepted == 0) summary_.initial_cost = cost_;
  // Landmarks that drift off lose their steepness for good: a region that remembered it would crawl (BAL, dogleg).
  scale_by_diagonal(e_.system_.diagonal, summary_.linearizations > 1 && e_.structure_.landmarks().empty(), e_.scale_);
  summary_.gradient = largest(e_.system_.gradient);
  if (!summary_.trace.empty()) {
    summary_.trace.back().gradient = summary_.gradient;
    summary_.trace.back().cost = cost_;
  }
  if (!std::isfinite(summary_.gradient))
    stop(Reason::not_finite, summary_.gradient, 0);
  else if (summary_.gradient <= settled_.gradient_tolerance)
    stop(Reason::gradient_tolerance, summary_.gradient, settled_.gradient_tolerance);
}

bool Minimizer::find_step() { return options_.method == Method::dogleg ? find_dogleg_step() : solve_linear(); }

// The linear system is solved once a linearization; a rejected step only shortens the path.
bool Minimizer::find_dogleg_step() {
  const LinearStructure& s = e_.structure_;
  const auto n = static_cast<std::size_t>(s.dim());
  if (!begun_) {
    bool found = solve_linear();
    while (!found && !stopped_ && lambda_ < kLargestDoglegLambda) {
      lambda_ *= 100.0;
      found = solve_linear();
    }
    if (stopped_) return false;
    Stage stage(*this, summary_.seconds.solve);
    for (auto* v : {&e_.step_product_, &e_.descent_product_}) v->resize(n);
    const std::vector<double>& q = e_.dogleg_.descent(e_.system_.gradient, e_.scale_);
    e_.product_.whole(s, e_.system_, q.data(), e_.descent_product_.data());
    if (found) e_.product_.whole(s, e_.system_, e_.step_.data(), e_.step_product_.data());
    e_.dogleg_.begin(e_.system_.gradient, e_.scale_, found ? e_.step_.data() : nullptr, e_.step_product_.data(),
                     e_.descent_product_.data());
    begun_ = true;
  }
  e_.dogleg_.step(e_.step_);
  return std::isfinite(largest(e_.step_));
}

// False without a solution; or, with stopped_, where a deadline passed between two of its stages.
bool Minimizer::solve_linear() {
  const LinearStructure& s = e_.structure_;
  e_.damping_.resize(s.dim());
  e_.rhs_.resize(s.kept_dim());
  e_.step_.resize(s.dim());
  bool empty = false;  // a scalar that no factor touches: damping alone would hide it
  for (int i = 0; i < s.dim(); ++i) {
    e_.damping_[i] = lambda_ * e_.scale_[i];
    empty = empty || e_.system_.diagonal[i] <= 0.0;
  }
  suspicious_ = empty;
  return s.forms_reduced() ? solve_directly() : solve_by_conjugate_gradient();
}

bool Minimizer::solve_by_conjugate_gradient() {
  Stage stage(*this, summary_.seconds.solve);
  const auto report = e_.conjugate_gradient_.solve(e_.structure_, e_.system_, e_.product_, e_.damping_.data(),
                                                   options_.conjugate_gradient, e_.step_.data(), pool_);
  factored_lambda_ = lambda_;
  summary_.linear_iterations += report.iterations;
  return report.finite && std::isfinite(largest(e_.step_));
}

bool Minimizer::solve_directly() {
  const LinearStructure& s = e_.structure_;
  Multifrontal& factorization = e_.structure_.factorization();
  const double* h = e_.system_.h.data();
  {
    Stage stage(*this, summary_.seconds.eliminate);
    if (s.landmarks().empty()) {
      for (int i = 0; i < s.kept_dim(); ++i) e_.rhs_[i] = -e_.system_.gradient[i];
    } else {
      e_.reduced_.reserve(factorization.storage_size());
      e_.schur_.reduce(s, e_.system_, e_.damping_.data(), e_.reduced_.data(), e_.rhs_.data(), pool_);
      h = e_.reduced_.data();
    }
  }
  if (out_of_time()) return false;
  {
    Stage stage(*this, summary_.seconds.factor);
    const FactorReport& report = factorization.factor(h, e_.damping_.data(), pool_);
    factored_lambda_ = lambda_;
    if (report.status == FactorReport::Status::not_finite) return false;
    suspicious_ = suspicious_ || report.status == FactorReport::Status::undetermined ||
                  report.smallest_ratio < 1e-10 + 10 * lambda_ || !e_.schur_.undetermined().empty();
  }
  if (out_of_time()) return false;
  Stage stage(*this, summary_.seconds.solve);
  factorization.solve(e_.rhs_.data(), e_.step_.data(), pool_);
  if (!s.landmarks().empty()) e_.schur_.back_substitute(s, e_.system_, e_.damping_.data(), e_.step_.data(), pool_);
  return std::isfinite(largest(e_.step_));
}

void Minimizer::step_to_trial() {
  Stage stage(*this, summary_.seconds.retract);
  e_.restriction_.to_tangent(e_.step_.data());
  const auto& pools = e_.graph_->pools();
  for (std::size_t p = 0; p < pools.size(); ++p) {
    const VariableOps& ops = pools[p]->ops();
    if (ops.dim > 0)
      ops.plus(pools[p]->extent(), e_.point_.column(p), e_.step_.data(), e_.structure_.offsets(p).data(),
               e_.trial_.column(p));
  }
}

// What the linear model promises: cost(x) - model(x ⊞ s) = ½ sᵀ(λ D s - g), since (H + λD) s = -g.
double Minimizer::predicted_gain() const {
  double sum = 0.0;
  for (int i = 0; i < e_.structure_.dim(); ++i)
    sum += e_.step_[i] * (e_.damping_[i] * e_.step_[i] - e_.system_.gradient[i]);
  return 0.5 * sum;
}

bool Minimizer::accept(double trial_cost, double gain) {
  const double decrease = cost_ - trial_cost;
  if (!(decrease > 0.0)) return converged_by_cost(std::fabs(decrease)) && gain <= settled_.function_tolerance * cost_;
  std::swap(e_.point_, e_.trial_);
  ++summary_.accepted;
  summary_.gain_open = false;
  const bool sides_changed = e_.trial_active_.valid != e_.active_.valid;
  std::swap(e_.active_, e_.trial_active_);
  if (sides_changed) {  // the active set freezes at the accepted point
    Stage stage(*this, summary_.seconds.evaluate);
    e_.linearizer_.refresh(*e_.graph_, e_.structure_, e_.point_, e_.active_, pool_);
  }
  cost_ = e_.active_.total;
  if (options_.method == Method::levenberg_marquardt) {
    const double r = 2.0 * decrease / gain - 1.0;
    lambda_ = std::max(kLeastLambda, lambda_ * std::max(1.0 / 3.0, 1.0 - r * r * r));
  }
  if (options_.method == Method::dogleg) e_.dogleg_.accepted(decrease);
  nu_ = 2.0;
  if (!report(true)) return true;
  const bool small = !sides_changed && decrease <= settled_.function_tolerance * cost_;
  small_in_a_row_ = small ? small_in_a_row_ + 1 : 0;
  if (small && (!is_cut() || small_in_a_row_ >= kSmallInARow))
    stop(Reason::function_tolerance, decrease, settled_.function_tolerance * cost_);
  return true;
}

// A step that changes nothing that could be measured ends the solve as well; but not one that is so short because
// others from here were rejected. False for a cost that is not a number.
bool Minimizer::converged_by_cost(double decrease) {
  const double bound = settled_.function_tolerance * cost_;
  if (!(decrease <= bound) || !(summary_.predicted_gain.value_or(HUGE_VAL) <= bound) || nu_ > 2.0 || is_cut())
    return false;
  stop(Reason::function_tolerance, decrease, settled_.function_tolerance * cost_);
  return true;
}

void Minimizer::reject() {
  ++summary_.rejected;
  if (options_.method == Method::gauss_newton) {
    stop(solved_ ? Reason::diverged : Reason::not_finite, e_.trial_active_.total, cost_);
    return;
  }
  if (options_.method == Method::dogleg) {
    nu_ *= 2.0;
    e_.dogleg_.rejected();
    report(false);
    if (!solved_ || e_.dogleg_.radius() < kLeastRadius)
      stop(solved_ ? Reason::no_descending_step : Reason::not_finite, e_.dogleg_.radius(), kLeastRadius);
    return;
  }
  lambda_ = std::max(lambda_, 1e-10) * nu_;
  nu_ *= 2.0;
  report(false);
  if (lambda_ > kLargestLambda)
    stop(solved_ ? Reason::no_descending_step : Reason::not_finite, lambda_, kLargestLambda);
}

bool Minimizer::step_is_tiny() {
  const double size = largest(e_.step_);
  if (size > settled_.step_tolerance) return false;
  stop(Reason::step_tolerance, size, settled_.step_tolerance);
  return true;
}

bool Minimizer::out_of_time() {
  if (options_.deadline.ns <= 0) return false;
  const double bound = options_.deadline.seconds(), so_far = seconds();
  if (so_far <= bound) return false;
  stop(Reason::deadline, so_far, bound);
  return true;
}

bool Minimizer::report(bool accepted) {
  const IterationReport r{summary_.iterations,
                          seconds(),
                          cost_,
                          summary_.gradient,
                          lambda_,
                          options_.method == Method::dogleg ? e_.dogleg_.radius() : 0.0,
                          accepted};
  if (options_.trace) summary_.trace.push_back(r);
  if (!options_.callback || options_.callback(r)) return true;
  stop(Reason::stopped_by_callback, 0, 0);
  return false;
}

void Minimizer::stop(Reason reason, double value, double bound) {
  if (stopped_) return;
  stopped_ = true;
  summary_.reason = reason;
  summary_.reason_value = value;
  summary_.reason_bound = bound;
}

void Minimizer::finish() {
  if (!evaluated_) {  // nothing is known of this graph
    e_.failed_ = summary_.failed();
    summary_.seconds.total = seconds();
    return;
  }
  summary_.lambda = lambda_;
  summary_.invalid_factors = e_.active_.invalid;
  summary_.not_finite_factors = e_.active_.not_finite;
  if (summary_.not_finite_factors > 0) name_not_finite();
  summary_.kernel_fallbacks = e_.linearizer_.kernel_fallbacks() - fallbacks_before_;
  // A start without gradient was never factored; what is undetermined there must be told all the same.
  if (summary_.reason == Reason::gradient_tolerance && summary_.iterations == 0) solve_linear();
  const bool in_time =
      summary_.reason != Reason::deadline && (options_.deadline.ns <= 0 || seconds() <= options_.deadline.seconds());
  if (in_time && e_.structure_.forms_reduced() &&
      (suspicious_ || may_have_gauge() || (summary_.linearizations > 0 && has_weak_landmark())))
    find_undetermined();
  {
    Stage stage(*this, summary_.seconds.adopt);
    if (!summary_.failed() && summary_.accepted > 0 && !e_.adopt_point()) summary_.reason = Reason::not_finite;
    e_.state_.lambda = lambda_;
    e_.failed_ = summary_.failed();
  }
  summary_.final_cost = summary_.fresh_cost = summary_.failed() ? summary_.initial_cost : cost_;
  // The active set is that of the last accepted point, but for factors that have a residual there and no Jacobian.
  if (in_time && !summary_.failed() && summary_.not_finite_factors > 0) {
    evaluate(e_.point_, nullptr, e_.trial_active_);
    summary_.fresh_cost = e_.trial_active_.total;
  }
  summary_.seconds.total = seconds();
}

void Minimizer::name_not_finite() {
  std::size_t at = 0;
  for (std::size_t t = 0; t < e_.structure_.plan_count(); ++t) {
    const TablePlan& plan = e_.structure_.plans()[t];
    const FactorTable& table = *plan.table;
    for (std::size_t b = 0; b < plan.active.size(); ++b, ++at)
      for (std::uint64_t bad = e_.active_.not_finite_mask[at] | e_.active_.no_jacobian[at];
           bad != 0 && summary_.not_finite.size() < kMostNotFinite; bad &= bad - 1)
        summary_.not_finite.push_back(
            {table.ops().key, table.slots().key(plan.rows[b * Batch::kRows + std::countr_zero(bad)])});
  }
}

double Minimizer::now() const {
  if (options_.clock) return options_.clock();
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace oriel
