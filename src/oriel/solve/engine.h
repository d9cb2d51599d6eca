// An engine follows one graph and finds its most likely values.
#pragma once
#include <cstring>
#include <span>
#include <string_view>
#include <vector>

#include "oriel/base/result.h"
#include "oriel/graph/graph.h"
#include "oriel/solve/engine_contents.h"
#include "oriel/solve/options.h"
#include "oriel/solve/summary.h"

namespace oriel {

// What an engine can do. Whatever else it is asked for it refuses, in words (can_solve); it never does another thing
// instead.
struct EngineCapabilities {
  // ---- of SolveOptions ----
  bool levenberg_marquardt = false, gauss_newton = false, dogleg = false;
  bool conjugate_gradient = false;  // as linear solver
  bool orderings = false;           // others than automatic
  bool deadline = false;
  bool callback = false;
  bool threads = false;  // uses more than one; otherwise their number changes nothing but the time
  // ---- of a graph ----
  bool losses = false;           // robust ones
  bool linear_priors = false;    // what marginalization leaves
  bool first_estimates = false;  // Jacobians there (decision 9)
  bool freedoms = false;         // directions that are held (graph/freedom.h)
  // ---- of the engine itself ----
  bool covariance = false;
  bool deterministic = false;  // the same bits for any number of threads, and however the graph became what it is
  bool incremental = false;    // after an edit it changes what the edit named, and makes nothing else anew
};

// Its graph must stand as long as it does.
class Engine {
 public:
  virtual ~Engine() = default;
  virtual std::string_view name() const = 0;
  virtual EngineCapabilities capabilities() const noexcept = 0;
  // Looks at what changed since it last did. solve, cost, contents and joint_covariance do so themselves: this is for
  // whoever wants it done at another time, or measured. Like a solve it is a step: what an engine keeps from solve to
  // solve may go on here (the elimination order of a large graph), which questions leave as it is.
  virtual Result<void> sync() noexcept = 0;
  // Looks at what changed, solves, and gives the graph the values (Graph::adopt) unless the solve failed; then the
  // graph is as it was. What it is asked for and cannot do it refuses (Reason::refused).
  virtual Summary solve(const SolveOptions& options) noexcept = 0;
  Summary solve() noexcept { return solve(SolveOptions{}); }
  // Cost of the graph's values: ½Σρ(‖r‖²), priors included, over the factors that are valid there. Jacobians
  // are not asked for: a factor whose Jacobian alone is not finite counts here, and not in a solve.
  virtual double cost() noexcept = 0;
  // Looks at what changed, as solve does, and says what it holds now; for `check`.
  virtual Result<EngineContents> contents() noexcept = 0;

  // Covariance of a variable in its tangent space at the graph's values (after a solve: at the solution), given all
  // that the graph knows. Of a fixed variable zero, and so in the held directions of any (P Σ P, graph/freedom.h). An
  // Error where something is undetermined, and after a solve that failed: never a stale or made-up matrix.
  template <Manifold V>
  Result<Mat<double, V::kDim, V::kDim>> covariance(VariableId<V> id) noexcept {
    Mat<double, V::kDim, V::kDim> out;
    const VariableKey ids[] = {id};
    if (auto ok = joint_covariance(ids, covariance_); !ok) return ok.error();
    std::memcpy(out.data(), covariance_.data(), sizeof(double) * covariance_.size());
    return out;
  }
  // The same of several variables together, each once: n × n for n the sum of their dimensions, column-major, in the
  // order of the ids.
  Result<std::vector<double>> joint_covariance(std::span<const VariableKey> ids) noexcept;
  // Into memory of the caller's, which is resized: asked for again and again it needs no more. An engine that has none
  // leaves this as it is: an Error that says so.
  virtual Result<void> joint_covariance(std::span<const VariableKey> ids, std::vector<double>& out) noexcept;

 private:
  std::vector<double> covariance_;  // of one variable
};

// Can the engine do what it is asked for? Else an Error that says in one line what it cannot: an option, or something
// that the graph holds.
Result<void> can_solve(const Engine& engine, const Graph& graph, const SolveOptions& options);

// What an engine returns that was asked for what it cannot do.
Summary refused(const SolveOptions& options, const Error& why);

// n for joint_covariance: the sum of their dimensions. An Error for an id that is not in the graph, or is named twice.
Result<std::size_t> covariance_size(const Graph& graph, std::span<const VariableKey> ids);

// Does the engine hold what the graph holds (C7)? As many residuals and parameters, of the same dimensions, connected
// alike, at the same values, priors included, with the same cost; else an Error that names the first difference.
Result<void> check(Engine& engine, const Graph& graph);

}  // namespace oriel
