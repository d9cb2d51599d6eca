// The engine of this library: landmarks by Schur complement, the rest by the multifrontal factorization.
#pragma once
#include <span>
#include <vector>

#include "oriel/base/owned.h"
#include "oriel/linear/landmark_schur.h"
#include "oriel/linear/linearize.h"
#include "oriel/linear/restriction.h"
#include "oriel/linear/schur_conjugate_gradient.h"
#include "oriel/solve/dogleg.h"
#include "oriel/solve/engine.h"
#include "oriel/solve/thread_pool.h"

namespace oriel {

// What influences the bits of the next solve and is not in the graph: it travels to replicas and is journaled.
// Everything else that an engine holds is a cache, and dropping it changes no bit.
struct SolverState {
  double lambda = 0.0;               // where the last solve ended; each begins with the option's
  std::uint64_t solved_version = 0;  // version of the graph that the last solve's values went into
  EliminationOrder order;            // of a large graph; empty for others. No message has it: who follows makes its own
};

class NativeEngine final : public Engine {
 public:
  explicit NativeEngine(Graph& graph);
  NativeEngine(NativeEngine&&) noexcept;
  NativeEngine& operator=(NativeEngine&&) noexcept;
  ~NativeEngine() override;  // in the library, as are the three above: every user's program would compile them anew

  std::string_view name() const override { return "native"; }
  EngineCapabilities capabilities() const noexcept override;
  // For a solve as the last one; another linear solver or ordering makes the structure anew.
  Result<void> sync() noexcept override;
  using Engine::solve;
  Summary solve(const SolveOptions& options) noexcept override;
  double cost() noexcept override;
  Result<EngineContents> contents() noexcept override;
  using Engine::joint_covariance;
  Result<void> joint_covariance(std::span<const VariableKey> ids, std::vector<double>& out) noexcept override;

  const SolverState& state() const { return state_; }
  void restore(const SolverState& state);
  // Forgets everything but the state; the next solve makes it anew, with the same bits.
  void drop_caches();

  // The linear problem at the graph's values, for covariances and tests; held directions as in restriction.h. A Result
  // only because a structure may be refused.
  Result<void> linearize(bool first_estimates);
  const LinearStructure& structure() const { return structure_; }
  const LinearSystem& system() const { return system_; }
  const ActiveSet& active() const { return active_; }
  const Point& point() const { return point_; }
  const Restriction& restriction() const { return restriction_; }
  // What the last solve that found anything gave the graph; for journals.
  const Solution& solution() const { return solution_; }

 private:
  friend class Minimizer;

  // A question between solves leaves the state as it is: who solves the same without asking has the same bits. A sync
  // that somebody calls is no question.
  enum class For { solve, question };
  Result<void> sync(const SolveOptions& options, For what);
  SolveOptions for_question() const;
  bool is_solved_by(LinearSolver solver) const;
  Result<void> factor_undamped(VariableKey id) noexcept;
  TaskPool* pool(int threads);
  bool adopt_point();  // false: the graph refused values that are not finite

  Graph* graph_;
  SolverState state_;
  bool failed_ = false;  // the last solve
  // ---- caches and workspaces ----
  LinearStructure structure_;
  std::uint64_t structure_version_ = ~std::uint64_t{0};
  EliminationOrder asked_;  // the order that a question's structure has, where that is not the state's
  bool has_asked_ = false;
  OrderingMethod structure_ordering_ = OrderingMethod::automatic;
  LinearSolver structure_solver_ = LinearSolver::automatic;
  Linearizer linearizer_;
  Restriction restriction_;
  LinearSystem system_;
  LandmarkSchur schur_;
  HessianProduct product_;
  SchurConjugateGradient conjugate_gradient_;
  Dogleg dogleg_;
  ActiveSet active_, trial_active_;
  Point point_, trial_;
  AlignedBuffer reduced_;  // S
  std::vector<double> damping_, rhs_, step_;
  std::vector<int> covariance_scalars_;
  std::vector<double> scale_, step_product_, descent_product_;  // D², and of a dogleg H p, H q
  Solution solution_;
  Owned<ThreadPool> threads_;
};

}  // namespace oriel
