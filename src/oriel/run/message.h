// What a replica is told and a journal holds beside edits and solutions (graph/wire.h): how a solve was asked for, and
// what came of it.
#pragma once
#include <string>

#include "oriel/graph/wire.h"
#include "oriel/solve/native_engine.h"

namespace oriel {

inline constexpr MessageKind kSolveMessage = 3, kOutcomeMessage = 4, kErrorMessage = 5;
// Without a payload: forget every cache; say how things stand (answered with an outcome).
inline constexpr MessageKind kDropCachesMessage = 6, kLookMessage = 7;

// A solve, so that it can be made again with the same bits: options and the state that it began with. `version` of the
// state is not part of it, since a replica counts its own.
struct SolveRequest {
  SolveOptions options;  // no callback, no deadline
  SolverState state;
};

// The solve as it went. What ended it from outside (a deadline, a callback) is written as the number of steps that it
// had time for, so that following the record needs no clock.
SolveRequest request_of(const SolveOptions& options, const SolverState& before, const Summary& summary);

// What came of it, and the fingerprint of the graph afterwards.
struct SolveOutcome {
  Reason reason = Reason::nothing_to_do;
  int iterations = 0, accepted = 0;
  double initial_cost = 0.0, final_cost = 0.0;
  SolverState state;
  std::uint64_t fingerprint = 0;
};

SolveOutcome outcome_of(const Summary& summary, const SolverState& after, const Graph& graph);

void append_solve(Bytes& out, const SolveRequest& request);
Result<SolveRequest> read_solve(const Message& message);
void append_outcome(Bytes& out, const SolveOutcome& outcome);
Result<SolveOutcome> read_outcome(const Message& message);
void append_error(Bytes& out, const Error& error);
// What it says; that it is damaged, if it is.
Error read_error(const Message& message);

}  // namespace oriel
