#include "oriel/window/mahalanobis_gate.h"

#include <algorithm>
#include <cmath>

#include "oriel/base/chi_squared.h"

namespace oriel {
namespace {

// x := A⁻¹ x of a few scalars, A symmetric and positive definite (it becomes its Cholesky factor).
void solve_positive(std::vector<double>& A, std::vector<double>& x) {
  const std::size_t n = x.size();
  for (std::size_t j = 0; j < n; ++j) {
    double* const column = A.data() + j * n;
    for (std::size_t k = 0; k < j; ++k)
      for (std::size_t i = j; i < n; ++i) column[i] -= A[k * n + i] * A[k * n + j];
    const double root = std::sqrt(column[j]);
    for (std::size_t i = j; i < n; ++i) column[i] /= root;
    x[j] /= root;
    for (std::size_t i = j + 1; i < n; ++i) x[i] -= column[i] * x[j];
  }
  for (std::size_t j = n; j-- > 0;) {
    for (std::size_t i = j + 1; i < n; ++i) x[j] -= A[j * n + i] * x[i];
    x[j] /= A[j * n + j];
  }
}

}  // namespace

Result<void> MahalanobisGate::set(int sensor, const GateOptions& options) {
  if (!(options.probability > 0.0 && options.probability < 1.0))
    return Error{ErrorCode::bad_input, "a gate's probability must lie between 0 and 1"};
  const auto at = std::find_if(gates_.begin(), gates_.end(), [&](const Gate& g) { return g.sensor == sensor; });
  if (at != gates_.end())
    at->options = options;
  else
    gates_.push_back({sensor, options});
  return {};
}

const GateOptions* MahalanobisGate::gate_of(int sensor) const {
  const auto gate = std::find_if(gates_.begin(), gates_.end(), [&](const Gate& g) { return g.sensor == sensor; });
  return gate == gates_.end() ? nullptr : &gate->options;
}

InsertionHook::Verdict MahalanobisGate::inserted(const Graph& graph, const States&, const InsertedGroup& group,
                                                 GraphEdit& edit) {
  const GateOptions* gate = gate_of(group.sensor);
  if (gate == nullptr) return {};
  int judged = 0;
  for (const FactorId id : group.factors) {
    if (!probe_.look(graph, id, gate->with_covariance) || !probe_.valid()) continue;
    ++judged;
    take_probe(gate->with_covariance);
    if (!passes(*gate, probe_.weight())) pruner_.drop(edit, id);
  }
  const int failed = pruner_.dropped();
  pruner_.finish(graph, group.variables, edit);
  if (failed > 0 && (failed == judged || gate->rejects_group)) {
    ++rejected_;
    return {.reject = true, .reset = false, .reason = "beyond the gate"};
  }
  dropped_ += failed;
  return {};
}

InsertionHook::Verdict MahalanobisGate::late(const Graph& graph, const States&, const LateArrival& arrival) {
  const GateOptions* gate = gate_of(arrival.sensor);
  if (gate == nullptr) return {};
  bool all = true;
  for (const edit::AddedPrior& prior : arrival.edit.priors().added) {
    take_prior(graph, arrival.edit, prior);
    all = all && passes(*gate, 0.0);
  }
  for_each_added_factor(arrival.edit, [&](const DetachedFactor& factor) {
    if (!probe_.look(graph, factor, gate->with_covariance) || !probe_.valid()) return;
    take_probe(gate->with_covariance);
    all = all && passes(*gate, 0.0);
  });
  if (all) return {};
  ++rejected_;
  return {.reject = true, .reset = false, .reason = "beyond the gate"};
}

void MahalanobisGate::take_probe(bool with_jacobian) {
  const int m = probe_.dim(), n = with_jacobian ? probe_.cols() : 0;
  ids_.assign(probe_.variables().begin(), probe_.variables().end());
  r_.resize(static_cast<std::size_t>(m));
  J_.resize(static_cast<std::size_t>(m) * static_cast<std::size_t>(n));
  for (int i = 0; i < m; ++i) r_[i] = probe_.residual(i);
  for (int c = 0; c < n; ++c)
    for (int i = 0; i < m; ++i) J_[static_cast<std::size_t>(c) * m + i] = probe_.jacobian(i, c);
}

// r = d + R (x ⊟ x̂) at the graph's values, J = R. Layout of its numbers: x̂, d, R.
void MahalanobisGate::take_prior(const Graph& graph, const GraphEdit& edit, const edit::AddedPrior& prior) {
  const std::span<const VariableKey> ids(edit.priors().variables.data() + prior.variables, prior.variable_count);
  ids_.assign(ids.begin(), ids.end());
  std::size_t estimates = 0, columns = 0;
  for (const VariableKey id : ids_) {
    estimates += estimate_doubles(*graph.find_ops(id.type));
    columns += static_cast<std::size_t>(graph.find_ops(id.type)->dim);
  }
  const std::size_t rows = (prior.block_size - estimates) / (columns + 1);
  const double* x = edit.priors().numbers.data() + prior.block;
  const double* const d = x + estimates;
  r_.assign(d, d + rows);
  J_.assign(d + rows, d + rows + rows * columns);
  const double* column = J_.data();
  for (const VariableKey id : ids_) {
    const VariableOps& ops = *graph.find_ops(id.type);
    y_.resize(static_cast<std::size_t>(ops.dim));
    ops.minus(graph.find_value(id), x, y_.data());
    for (int c = 0; c < ops.dim; ++c, column += rows)
      for (std::size_t i = 0; i < rows; ++i) r_[i] += column[i] * y_[c];
    x += estimate_doubles(ops);
  }
}

bool MahalanobisGate::passes(const GateOptions& options, double weight) {
  distance_ = distance(options.with_covariance, weight);
  return distance_ <= threshold(options.probability, static_cast<int>(r_.size()));
}

// M = J P⁺ Jᵀ; false where there is no covariance yet, since something is undetermined.
bool MahalanobisGate::find_spread() {
  const std::size_t m = r_.size(), n = J_.size() / m;
  if (!engine_.joint_covariance(ids_, P_)) return false;
  PJ_.assign(n * m, 0.0);  // P Jᵀ
  for (std::size_t i = 0; i < m; ++i)
    for (std::size_t c = 0; c < n; ++c)
      for (std::size_t k = 0; k < n; ++k) PJ_[i * n + k] += P_[c * n + k] * J_[c * m + i];
  M_.assign(m * m, 0.0);
  for (std::size_t j = 0; j < m; ++j)
    for (std::size_t c = 0; c < n; ++c)
      for (std::size_t i = 0; i < m; ++i) M_[j * m + i] += J_[c * m + i] * PJ_[j * n + c];
  return true;
}

// rᵀ (I - w M) y with (I + (1 - w) M) y = r. Without a covariance the noise alone is asked.
double MahalanobisGate::distance(bool with_covariance, double w) {
  const std::size_t m = r_.size();
  double s = 0.0;
  for (const double r : r_) s += r * r;
  if (!with_covariance || m == 0 || !find_spread()) return s;
  A_ = M_;
  for (std::size_t i = 0; i < m * m; ++i) A_[i] = (1.0 - w) * M_[i] + (i % (m + 1) == 0 ? 1.0 : 0.0);
  y_ = r_;
  solve_positive(A_, y_);
  double d = 0.0;
  for (std::size_t j = 0; j < m; ++j) {
    double along = r_[j];  // ((I - w M) r)_j
    for (std::size_t i = 0; i < m; ++i) along -= w * M_[j * m + i] * r_[i];
    d += along * y_[j];
  }
  return std::max(0.0, d);
}

double MahalanobisGate::threshold(double probability, int dof) {
  for (const Quantile& q : quantiles_)
    if (q.probability == probability && q.dof == dof) return q.value;
  quantiles_.push_back({probability, dof, chi_squared_threshold(probability, dof)});
  return quantiles_.back().value;
}

}  // namespace oriel
