// An engine whose solves run in a thread or a child process (solve_beside.h): for whoever has an Engine, a window for
// example, and wants it not to die with the solver. It waits for each solve, so what it wins is safety, not time.
#pragma once
#include <cstdint>
#include <memory>

#include "oriel/run/solve_beside.h"
#include "oriel/solve/engine.h"

namespace oriel {

template <class Types>
class BesideEngineWith final : public Engine {
 public:
  // The graph must outlive it. An error as Executor::start says it.
  static Result<std::unique_ptr<Engine>> make(Graph& graph, ExecutorKind kind, const ExecutorOptions& options,
                                              int tries = 3) {
    auto beside = SolveBesideWith<Types>::start(graph, kind, options, tries);
    if (!beside) return beside.error();
    return std::unique_ptr<Engine>(new BesideEngineWith(graph, std::move(*beside)));
  }

  std::string_view name() const override { return "native, beside"; }
  EngineCapabilities capabilities() const noexcept override {
    EngineCapabilities can;
    can.levenberg_marquardt = can.gauss_newton = can.dogleg = true;
    can.conjugate_gradient = can.orderings = can.threads = true;
    can.losses = can.linear_priors = can.first_estimates = can.freedoms = can.deterministic = true;
    return can;  // no callback and no deadline: they are of this process
  }
  // Everything travels with the next solve.
  Result<void> sync() noexcept override { return {}; }
  // A worker that cannot be brought to answer is Reason::refused, with its end in the refusal.
  Summary solve(const SolveOptions& options) noexcept override {
    if (auto ok = can_solve(*this, *graph_, options); !ok) return refused(options, ok.error());
    JobReport report = beside_.submit(options);
    if (report.status == JobStatus::accepted) report = beside_.write_back();
    restarts_ += report.restarted ? 1 : 0;
    if (report.status != JobStatus::done) return refused(options, Error{ErrorCode::io, report.message});
    return beside_.summary();
  }
  double cost() noexcept override { return expected_contents(*graph_).cost; }
  Result<EngineContents> contents() noexcept override {
    return Error{ErrorCode::not_found, "an engine beside its caller does not show what it holds"};
  }
  std::int64_t restarts() const { return restarts_; }  // solves for which a worker was started anew

 private:
  BesideEngineWith(Graph& graph, SolveBesideWith<Types> beside) : graph_(&graph), beside_(std::move(beside)) {}

  Graph* graph_;
  SolveBesideWith<Types> beside_;
  std::int64_t restarts_ = 0;
};

using BesideEngine = BesideEngineWith<ShippedTypes>;

}  // namespace oriel
