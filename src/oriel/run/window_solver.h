// WindowSolver: the back end of a sliding window in a thread or a child process, while the front end goes on.
//
//     window.core().defer_to(WindowSolver::make(window.core().followed(), ExecutorKind::process, options).value());
//     window.update();   // takes in what came, sends it over, and comes back: the front end goes on
//     window.update();   // first merges what was found and slides, then takes in what came meanwhile
//     window.settle();   // waits for what is under way, and merges it
//
// A solve that an update begins is merged by the next one: updates are the points that the data define, so that a run
// has the same bits in place, in a thread and in a process, and through workers that are lost (solve_beside.h).
#pragma once
#include <memory>

#include "oriel/run/solve_beside.h"
#include "oriel/solve/engine.h"
#include "oriel/window/deferred_solver.h"

namespace oriel {

template <class Types>
class WindowSolverWith final : public DeferredSolver {
 public:
  static constexpr const TaskOps& kTask = SolveBesideWith<Types>::kTask;  // for the zygote
  // The graph must outlive it. An error as Executor::start says it. `tries`: of a solve whose worker was lost.
  static Result<std::unique_ptr<DeferredSolver>> make(Graph& graph, ExecutorKind kind, const ExecutorOptions& options,
                                                      int tries = 3) {
    auto beside = SolveBesideWith<Types>::start(graph, kind, options, tries);
    if (!beside) return beside.error();
    return std::unique_ptr<DeferredSolver>(new WindowSolverWith(std::move(*beside)));
  }

  std::string_view name() const override { return "native, deferred"; }
  Result<void> begin(const SolveOptions& options) noexcept override {
    if (options.callback || options.deadline.ns > 0)
      return Error{ErrorCode::bad_input,
                   "a solve beside its caller has no callback and no deadline: they are of this "
                   "process"};
    options_ = options;
    const JobReport report = beside_.submit(options);
    if (report.status == JobStatus::accepted) return {};
    return Error{ErrorCode::io, report.message};
  }
  bool is_running() noexcept override { return beside_.is_running(); }
  Summary finish() noexcept override {
    const JobReport report = beside_.write_back();
    if (report.status == JobStatus::done) return beside_.summary();
    return refused(options_, Error{ErrorCode::io, report.message});
  }

 private:
  explicit WindowSolverWith(SolveBesideWith<Types> beside) : beside_(std::move(beside)) {}

  SolveBesideWith<Types> beside_;
  SolveOptions options_;
};

using WindowSolver = WindowSolverWith<ShippedTypes>;

}  // namespace oriel
