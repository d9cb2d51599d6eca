#include "oriel/window/mahalanobis_gate.h"

#include <algorithm>

#include "oriel/base/chi_squared.h"

namespace oriel {

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

InsertionHook::Verdict MahalanobisGate::inserted(const Graph& graph, const States&, const InsertedGroup& group,
                                                 GraphEdit& edit) {
  const auto gate = std::find_if(gates_.begin(), gates_.end(), [&](const Gate& g) { return g.sensor == group.sensor; });
  if (gate == gates_.end()) return {};
  int judged = 0;
  for (const FactorId id : group.factors) {
    if (!probe_.look(graph, id, gate->options.with_covariance) || !probe_.valid()) continue;
    ++judged;
    if (!passes(gate->options)) pruner_.drop(edit, id);
  }
  const int failed = pruner_.dropped();
  pruner_.finish(graph, group.variables, edit);
  if (failed > 0 && (failed == judged || gate->options.rejects_group)) {
    ++rejected_;
    return {.reject = true, .reset = false, .reason = "beyond the gate"};
  }
  dropped_ += failed;
  return {};
}

bool MahalanobisGate::passes(const GateOptions& options) {
  distance_ = distance(options.with_covariance);
  return distance_ <= threshold(options.probability, probe_.dim());
}

// rᵀ r - bᵀ P⁺ b with b = Jᵀ r. Where there is no covariance yet (something is undetermined), the noise alone is asked.
double MahalanobisGate::distance(bool with_covariance) {
  const double s = probe_.squared_norm();
  if (!with_covariance) return s;
  const Result<std::vector<double>> P = engine_.joint_covariance(probe_.variables());
  if (!P) return s;
  const int n = probe_.cols();
  b_.assign(static_cast<std::size_t>(n), 0.0);
  for (int c = 0; c < n; ++c)
    for (int i = 0; i < probe_.dim(); ++i) b_[c] += probe_.jacobian(i, c) * probe_.residual(i);
  double explained = 0.0;
  for (int c = 0; c < n; ++c)
    for (int i = 0; i < n; ++i)
      explained +=
          b_[i] * (*P)[static_cast<std::size_t>(c) * static_cast<std::size_t>(n) + static_cast<std::size_t>(i)] * b_[c];
  return std::max(0.0, s - explained);
}

double MahalanobisGate::threshold(double probability, int dof) {
  for (const Quantile& q : quantiles_)
    if (q.probability == probability && q.dof == dof) return q.value;
  quantiles_.push_back({probability, dof, chi_squared_threshold(probability, dof)});
  return quantiles_.back().value;
}

}  // namespace oriel
