#include "oriel/solve/engine.h"

#include <algorithm>

namespace oriel {
namespace {

bool has(const EngineCapabilities& can, Method method) {
  return method == Method::levenberg_marquardt ? can.levenberg_marquardt
         : method == Method::gauss_newton      ? can.gauss_newton
                                               : can.dogleg;
}

// What is asked for and not there; null: nothing.
const char* lacks(const EngineCapabilities& can, const SolveOptions& options) {
  if (!has(can, options.method))
    return options.method == Method::levenberg_marquardt ? "Levenberg-Marquardt"
           : options.method == Method::gauss_newton      ? "Gauss-Newton"
                                                         : "dogleg steps";
  if (options.linear_solver == LinearSolver::conjugate_gradient && !can.conjugate_gradient)
    return "conjugate gradients";
  if (options.ordering != OrderingMethod::automatic && !can.orderings) return "choice of orderings";
  if (options.deadline.ns > 0 && !can.deadline) return "deadlines";
  if (options.callback && !can.callback) return "callbacks";
  return nullptr;
}

bool has_robust_loss(const FactorTable& table) {
  if (!table.robust()) return false;
  for (std::uint32_t row = 0; row < table.extent(); ++row)
    if (table.slots().is_live(row) && table.loss(row).kind != LossKind::none) return true;
  return false;
}

const char* lacks(const EngineCapabilities& can, const SolveOptions& options, const Graph& graph) {
  if (!can.linear_priors && graph.priors().slots().size() > 0) return "linear priors, and the graph holds one";
  if (!can.losses)
    for (const auto& table : graph.tables())
      if (has_robust_loss(*table)) return "robust losses, and the graph holds one";
  if (!can.freedoms)
    for (const auto& pool : graph.pools())
      if (pool->restricted_count() > 0) return "held directions, and the graph holds some";
  if (!can.first_estimates && options.first_estimates)
    for (const auto& pool : graph.pools())
      if (pool->first_estimate_count() > 0) return "first estimates, and the graph holds some";
  return nullptr;
}

}  // namespace

Result<void> can_solve(const Engine& engine, const Graph& graph, const SolveOptions& options) {
  const EngineCapabilities can = engine.capabilities();
  const char* lacking = lacks(can, options);
  if (lacking == nullptr) lacking = lacks(can, options, graph);
  if (lacking == nullptr) return {};
  return Error{ErrorCode::bad_input, "the engine " + std::string(engine.name()) + " has no " + lacking};
}

Summary refused(const SolveOptions& options, const Error& why) {
  Summary summary;
  summary.method = options.method;
  summary.reason = Reason::refused;
  summary.refusal = why.text();
  return summary;
}

Result<std::vector<double>> Engine::joint_covariance(std::span<const VariableKey> ids) noexcept {
  std::vector<double> out;
  if (auto ok = joint_covariance(ids, out); !ok) return ok.error();
  return out;
}

Result<void> Engine::joint_covariance(std::span<const VariableKey>, std::vector<double>&) noexcept {
  return Error{ErrorCode::bad_input, "the engine " + std::string(name()) + " has no covariances"};
}

Result<std::size_t> covariance_size(const Graph& graph, std::span<const VariableKey> ids) {
  std::size_t n = 0;
  for (const VariableKey& id : ids) {
    if (std::count(ids.begin(), ids.end(), id) > 1)
      return Error{ErrorCode::duplicate, "covariance: " + graph.describe(id) + " is named twice"};
    if (graph.find_value(id) == nullptr)
      return Error{ErrorCode::stale_id, "covariance: " + graph.describe(id) + " is not in the graph"};
    n += static_cast<std::size_t>(graph.find_ops(id.type)->dim);
  }
  return n;
}

}  // namespace oriel
