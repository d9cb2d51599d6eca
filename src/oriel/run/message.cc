#include "oriel/run/message.h"

#include "oriel/graph/fingerprint.h"

namespace oriel {
namespace {

Error damaged(const char* what) { return {ErrorCode::size_mismatch, std::string("message: ") + what}; }

// Every field by name: one that is added to the struct and forgotten here does not compile.
template <class State, class F>
void for_each_field(State& state, F&& f) {
  auto& [lambda, solved_version, order] = state;
  f(lambda);
  f(solved_version);
  static_cast<void>(order);  // of a large graph: who follows from the start has made the same
}
template <class Options, class F>
void for_each_number(Options& options, F&& f) {
  auto& [method, max_iterations, threads, function_tolerance, gradient_tolerance, step_tolerance, initial_lambda,
         initial_radius, linear_solver, conjugate_gradient, deadline, first_estimates, trace, ordering, callback,
         clock] = options;
  auto& [forcing, most_products] = conjugate_gradient;
  f(max_iterations);
  f(threads);
  f(function_tolerance);
  f(gradient_tolerance);
  f(step_tolerance);
  f(initial_lambda);
  f(initial_radius);
  f(forcing);
  f(most_products);
  f(first_estimates);
  static_cast<void>(method), static_cast<void>(ordering),
      static_cast<void>(linear_solver);  // enums: checked by the reader
  // These do not travel.
  static_cast<void>(deadline), static_cast<void>(callback), static_cast<void>(clock), static_cast<void>(trace);
}

template <class T>
void get(ByteReader& r, T& x) {
  x = r.get<T>();
}
void get(ByteReader& r, bool& x) { x = r.get<std::uint8_t>() != 0; }

}  // namespace

SolveRequest request_of(const SolveOptions& options, const SolverState& before, const Summary& summary) {
  SolveRequest q{options, before};
  const bool cut = summary.reason == Reason::deadline || summary.reason == Reason::stopped_by_callback;
  if (cut) q.options.max_iterations = summary.accepted + summary.rejected;
  q.options.deadline = {};
  q.options.callback = nullptr;
  q.options.clock = nullptr;
  return q;
}

SolveOutcome outcome_of(const Summary& summary, const SolverState& after, const Graph& graph) {
  return {summary.reason, summary.iterations, summary.accepted, summary.initial_cost, summary.final_cost,
          after,          fingerprint(graph)};
}

void append_solve(Bytes& out, const SolveRequest& request) {
  append_message(out, kSolveMessage, [&](ByteWriter& w) {
    w.put(static_cast<std::uint8_t>(request.options.method));
    w.put(static_cast<std::uint8_t>(request.options.ordering));
    w.put(static_cast<std::uint8_t>(request.options.linear_solver));
    for_each_number(request.options, [&](const auto& x) { w.put(x); });
    for_each_field(request.state, [&](const auto& x) { w.put(x); });
  });
}

Result<SolveRequest> read_solve(const Message& message) {
  if (message.kind != kSolveMessage) return damaged("it asks for no solve");
  ByteReader r(message.payload);
  SolveRequest q;
  const auto method = r.get<std::uint8_t>(), ordering = r.get<std::uint8_t>(), solver = r.get<std::uint8_t>();
  for_each_number(q.options, [&](auto& x) { get(r, x); });
  for_each_field(q.state, [&](auto& x) { get(r, x); });
  if (!r.at_end() || method > static_cast<std::uint8_t>(Method::dogleg) ||
      solver > static_cast<std::uint8_t>(LinearSolver::automatic) ||
      ordering > static_cast<std::uint8_t>(OrderingMethod::automatic) || q.options.threads < 1 ||
      q.options.threads > 1024)
    return damaged("the options of a solve are not valid");
  q.options.linear_solver = static_cast<LinearSolver>(solver);
  q.options.method = static_cast<Method>(method);
  q.options.ordering = static_cast<OrderingMethod>(ordering);
  return q;
}

void append_outcome(Bytes& out, const SolveOutcome& outcome) {
  append_message(out, kOutcomeMessage, [&](ByteWriter& w) {
    w.put(static_cast<std::uint8_t>(outcome.reason));
    w.put(outcome.iterations);
    w.put(outcome.accepted);
    w.put(outcome.initial_cost);
    w.put(outcome.final_cost);
    for_each_field(outcome.state, [&](const auto& x) { w.put(x); });
    w.put(outcome.fingerprint);
  });
}

Result<SolveOutcome> read_outcome(const Message& message) {
  if (message.kind != kOutcomeMessage) return damaged("it is no outcome of a solve");
  ByteReader r(message.payload);
  SolveOutcome o;
  const auto reason = r.get<std::uint8_t>();
  get(r, o.iterations);
  get(r, o.accepted);
  get(r, o.initial_cost);
  get(r, o.final_cost);
  for_each_field(o.state, [&](auto& x) { get(r, x); });
  get(r, o.fingerprint);
  if (!r.at_end() || reason > static_cast<std::uint8_t>(Reason::refused))
    return damaged("the outcome of a solve is not valid");
  o.reason = static_cast<Reason>(reason);
  return o;
}

void append_error(Bytes& out, const Error& error) {
  append_message(out, kErrorMessage, [&](ByteWriter& w) {
    w.put(static_cast<std::uint8_t>(error.code));
    w.put_text(error.message);
  });
}

Error read_error(const Message& message) {
  if (message.kind != kErrorMessage) return damaged("it is no error");
  ByteReader r(message.payload);
  const auto code = r.get<std::uint8_t>();
  std::string text(r.get_text());
  if (!r.at_end() || code > static_cast<std::uint8_t>(ErrorCode::io)) return damaged("an error is not valid");
  return {static_cast<ErrorCode>(code), std::move(text)};
}

}  // namespace oriel
