// WindowCore: a graph, the engine that solves it and the marginalizer that keeps it small. It knows no sensors, no
// times and no threads: what goes in and what leaves is an edit or a list of variables, and every step is seen by an
// observer, so that a run can be recorded and replayed.
#pragma once
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "oriel/graph/graph.h"
#include "oriel/linear/aligned_buffer.h"
#include "oriel/solve/native_engine.h"
#include "oriel/window/deferred_solver.h"
#include "oriel/window/marginalize.h"

namespace oriel {

// What a journal hangs on.
class WindowObserver {
 public:
  virtual ~WindowObserver() = default;
  virtual void edited() = 0;  // an edit was applied to the graph
  virtual void solved(const SolveOptions& options, const SolverState& before, const Summary& summary,
                      const NativeEngine& engine) = 0;
};

// Solves that could not be done where they should be: a worker that is lost, an engine that cannot.
struct RefusedSolves {
  std::int64_t count = 0;
  std::string first;  // what the first one came to
};

class WindowCore {
 public:
  WindowCore() : engine_(graph_), edit_(graph_) {}
  WindowCore(const WindowCore&) = delete;
  WindowCore& operator=(const WindowCore&) = delete;

  const Graph& graph() const { return graph_; }
  const NativeEngine& engine() const { return engine_; }
  // For covariance, which factors the system anew.
  NativeEngine& engine() { return engine_; }
  // Not beside another engine: the outcome of its solves is nothing that a journal could replay.
  void observe(WindowObserver* observer);
  // Solves go to this engine from now on, made on this graph (followed()); null: to the native one again. What else
  // looks at linear problems stays native: marginalization, covariances, gates. An Error where an observer is.
  Result<void> use(std::unique_ptr<Engine> solver);
  // Solves are begun and finished apart from now on, by this one, made on this graph; null: no more. An Error where an
  // observer is, or one that was begun is not finished.
  Result<void> defer_to(std::unique_ptr<DeferredSolver> solver);
  bool defers() const { return deferred_ != nullptr; }
  bool has_begun() const { return begun_; }  // a solve that is not finished
  Result<void> begin_solve(const SolveOptions& options);
  Summary finish_solve();
  // Of all solves so far, also where whoever asked for them went on without.
  const RefusedSolves& refused_solves() const { return refused_; }
  // For those who subscribe to its changes (Graph::subscribe).
  Graph& followed() { return graph_; }

  // An empty edit, to be filled and committed.
  GraphEdit& edit() {
    edit_.clear();
    return edit_;
  }
  GraphEdit& edited() { return edit_; }  // as it was filled, or applied
  Result<void> commit();
  // On failure the values are those from before.
  Summary solve(const SolveOptions& options);
  // Of several variables together, as NativeEngine says it.
  Result<std::vector<double>> joint_covariance(std::span<const VariableKey> ids) {
    return engine_.joint_covariance(ids);
  }
  // Variables leave at the values of the last solve; what they knew becomes a prior on their neighbours.
  Result<MarginalizeReport> slide(std::span<const VariableKey> leaving, const MarginalizeOptions& options);
  // Variables leave, landmarks as the policy says, and what they knew is lost: no prior.
  Result<void> drop(std::span<const VariableKey> leaving, LandmarkPolicy landmarks);
  // After a solve that found nothing: takes out the factors whose squares a sum cannot take at the values that are
  // left, and appends their ids.
  Result<void> remove_overflowing(std::vector<FactorId>& removed);
  // The engine is told that nothing was solved yet; it keeps its memory.
  void begin_anew() { engine_.restore({}); }
  // Everything leaves.
  Result<void> clear();

 private:
  void note_refusal(const std::string& why);
  void find_overflowing(const FactorTable& table, std::vector<FactorId>& found);

  Graph graph_;
  NativeEngine engine_;
  GraphEdit edit_;
  Marginalizer marginalizer_;
  MarginalScope scope_;
  WindowObserver* observer_ = nullptr;
  std::unique_ptr<Engine> solver_;  // null: the native one
  std::unique_ptr<DeferredSolver> deferred_;
  bool begun_ = false;
  RefusedSolves refused_;
};

}  // namespace oriel
