// A graph that is solved beside its owner: in place, in a thread or in a child process, with the same bits.
//
//     auto beside = SolveBeside::start(graph, ExecutorKind::process, options).value();
//     beside.submit({});           // what changed since the last time goes over; returns at once
//     graph.apply(edit);           // the owner goes on adding, removing, setting
//     beside.write_back();         // waits; the values found go into the graph (Graph::adopt), but for what is gone,
//                                  // fixed, or was set meanwhile
//
// The worker holds a replica that follows by net edits (change_log.h) and keeps its structure from job to job. For one
// that can be lost the owner's side keeps what it was told (kept_graph.h): the checkpoint, from which another does the
// job again and comes to the same bits, whatever was edited meanwhile. After a job that failed the next one takes the
// whole graph; so it does where something else than what is found here was adopted into the graph, by an engine of the
// owner's, since no edit tells a worker of that. Submit and write_back stand at points that the owner's data define (a
// keyframe, so many updates later); then a run has the same bits wherever it is solved.
#pragma once
#include "oriel/run/executor.h"
#include "oriel/run/kept_graph.h"
#include "oriel/run/message.h"
#include "oriel/run/registry.h"

namespace oriel {

// What the worker is told: net edits since the job before, and how to solve. Messages of graph/wire.h and message.h.
struct SolveInput {
  std::uint64_t sequence = 0;  // of the job; edits that do not follow those of the job before are refused
  std::uint64_t version = 0;   // of the owner's graph
  Bytes edit, request;
  EliminationOrder order;  // of a large graph, with the whole of it: the state that a worker before had reached
  bool wants_fingerprint = false, wants_trace = false;  // of the steps, in the summary
};
// A summary that travels, whole.
struct TravellingSummary {
  Summary summary;
  std::string linear_solver;  // by name: a summary only points to it

  void take(Summary&& of);
  void give(Summary& to) const;
  template <class Visit>
  void transfer(Visit&& visit) {
    // Every field by name: one that is added to the struct and forgotten here does not compile.
    auto& [reason, reason_value, reason_bound, refusal, method, iterations, accepted, rejected, linearizations,
           initial_cost, final_cost, fresh_cost, gradient, predicted_gain, gain_open, lambda, factors, invalid_factors,
           not_finite_factors, not_finite, kept_dim, landmark_dim, fronts, factor_flops, schur_flops, kernel_fallbacks,
           name, linear_iterations, seconds, trace, undetermined, gauge] = summary;
    static_cast<void>(name);
    visit(reason, reason_value, reason_bound, refusal, method, iterations, accepted, rejected, linearizations,
          initial_cost, final_cost, fresh_cost, gradient, predicted_gain, gain_open, lambda, factors, invalid_factors,
          not_finite_factors, not_finite, kept_dim, landmark_dim, fronts, factor_flops, schur_flops, kernel_fallbacks,
          linear_solver, linear_iterations, seconds, trace, undetermined, gauge);
  }
};

struct SolveOutput {
  std::uint64_t version = 0;
  Bytes solution, outcome;
  EliminationOrder order;  // of a large graph
  TravellingSummary summary;
};

namespace run_detail {

// The worker's graph and engine.
class SolveContext {
 public:
  explicit SolveContext(TypeList types);
  SolveContext(SolveContext&&) noexcept;
  SolveContext& operator=(SolveContext&&) noexcept;
  ~SolveContext();
  Result<SolveOutput> solve(const SolveInput& input);

 private:
  struct State;
  Owned<State> state_;
};

// The owner's side, but for the executor.
class SolveOwner {
 public:
  // `can_be_lost`: its worker, and what that was told is kept.
  SolveOwner(Graph& graph, TypeList types, bool can_be_lost)
      : graph_(&graph), types_(std::move(types)), can_be_lost_(can_be_lost) {
    begin_anew();
  }
  SolveOwner(SolveOwner&& other) noexcept;
  SolveOwner& operator=(SolveOwner&&) = delete;
  ~SolveOwner();                                           // the graph keeps nothing for it any more
  const SolveInput& collect(const SolveOptions& options);  // good until the next
  // Once it was submitted, and before the graph changes: keeps what was told.
  void submitted();
  // The same job for a worker that knows nothing; after submitted(), where its worker can be lost.
  Result<void> collect_again();
  const SolveInput& collected() const { return input_; }
  void want_fingerprints() { input_.wants_fingerprint = true; }
  void write(const SolveOutput& output);
  const Result<void>& written() const { return written_; }  // what came of it
  // The worker is not where it should be: it is told everything next time.
  void begin_anew();
  const SolveOutcome& outcome() const { return outcome_; }
  const Summary& summary() const { return summary_; }
  const SolverState& state() const { return state_; }

 private:
  Result<void> take(const SolveOutput& output);

  Graph* graph_;  // null: moved from
  TypeList types_;
  bool can_be_lost_;
  KeptGraph told_;  // as the worker has it, where that can be lost
  Subscription subscription_;
  bool subscribed_ = false, whole_ = true;
  std::uint64_t sequence_ = 0;
  std::uint64_t adoptions_ = 0;  // of the graph, that the worker knows of
  SolverState state_;
  SolveOutcome outcome_;
  Summary summary_;
  GraphEdit edit_;
  SolveInput input_;
  Solution solution_;
  Result<void> written_;
};

}  // namespace run_detail

// The types that come with the library. For others: a struct with the same two members.
struct ShippedTypes {
  static constexpr const char* kName = "solve";
  static TypeList types() { return shipped_types(); }
};

template <class Types>
struct SolveTask {
  static constexpr const char* kName = Types::kName;
  struct Config {};
  using Map = run_detail::SolveOwner;
  static run_detail::SolveContext init_context(const Config&) { return run_detail::SolveContext(Types::types()); }
  SolveInput collect(const SolveInput& input) const { return input; }
  static Result<SolveOutput> optimize(run_detail::SolveContext& context, const SolveInput& input) {
    return context.solve(input);
  }
  static void write(const SolveOutput& output, Map& owner) { owner.write(output); }
};

template <class Types>
class SolveBesideWith {
 public:
  // For the zygote: Zygote::start({&SolveBeside::kTask}).
  static constexpr const TaskOps& kTask = kTaskOps<SolveTask<Types>>;

  // The graph must outlive it. `tries`: how often a job whose worker was lost is begun anew before it is given up;
  // options.retry_late: also one that was late.
  static Result<SolveBesideWith> start(Graph& graph, ExecutorKind kind, ExecutorOptions options = {}, int tries = 3) {
    options.retries = 0;  // a new worker needs another input
    options.coalesce = false;
    auto executor = Executor<SolveTask<Types>>::start(kind, {}, options);
    if (!executor) return executor.error();
    return SolveBesideWith(graph, std::move(*executor), tries, options.retry_late);
  }

  // No callback, no deadline: they are the owner's affair. busy where a job is in flight, or a thread is still at one
  // that was late.
  JobReport submit(const SolveOptions& options) {
    if (in_flight_) return {0, JobStatus::busy, "a solve is in flight: write it back first"};
    executor_.expect();
    JobReport r = executor_.submit(owner_.collect(options));
    owner_.submitted();
    job_ = r.job;
    for (int i = 0; i < tries_ && is_lost(r); ++i) r = again();
    in_flight_ = r.status == JobStatus::accepted;
    if (!in_flight_) owner_.begin_anew();  // what was collected has not arrived
    return r;
  }
  bool is_running() { return executor_.is_running(); }
  // Waits, and adopts the values once. Where the worker was lost another does the same job, with a time limit of its
  // own.
  JobReport write_back() {
    if (!in_flight_) return {};
    JobReport r = executor_.write_back(owner_);
    bool restarted = r.restarted;
    for (int i = 0; i < tries_ && is_lost(r); ++i) {
      r = again();
      if (r.status == JobStatus::accepted) r = executor_.write_back(owner_);
      restarted = true;
    }
    if (r.status == JobStatus::done && !owner_.written())
      r.status = JobStatus::failed, r.message = owner_.written().error().text();
    if (r.status != JobStatus::done) owner_.begin_anew();
    in_flight_ = false;
    r.job = job_;
    r.restarted = restarted;
    return r;
  }
  // Outcomes have a fingerprint of the worker's graph, which takes as long as looking at all of it.
  void want_fingerprints() { owner_.want_fingerprints(); }
  // Of the last solve that was written back.
  const SolveOutcome& outcome() const { return owner_.outcome(); }
  const Summary& summary() const { return owner_.summary(); }
  const SolverState& state() const { return owner_.state(); }
  void terminate() { executor_.terminate(); }

 private:
  SolveBesideWith(Graph& graph, Executor<SolveTask<Types>> executor, int tries, bool retry_late)
      : owner_(graph, Types::types(), executor.kind() == ExecutorKind::process),
        executor_(std::move(executor)),
        tries_(tries),
        retry_late_(retry_late) {}
  // A new worker that was told of edits alone says that it cannot take them: it failed.
  bool is_lost(const JobReport& r) const {
    if (r.status == JobStatus::timed_out) return r.worker_lost && retry_late_;
    return r.worker_lost || (r.status == JobStatus::failed && r.restarted);
  }
  JobReport again() {
    if (auto ok = owner_.collect_again(); !ok) return {job_, JobStatus::failed, ok.error().text()};
    return executor_.submit(owner_.collected());
  }

  run_detail::SolveOwner owner_;
  Executor<SolveTask<Types>> executor_;
  int tries_;
  bool retry_late_, in_flight_ = false;
  JobId job_ = 0;
};

using SolveBeside = SolveBesideWith<ShippedTypes>;

}  // namespace oriel
