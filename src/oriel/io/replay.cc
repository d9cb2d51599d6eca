#include "oriel/io/replay.h"

#include "oriel/graph/fingerprint.h"

namespace oriel {
namespace {

class Replayer {
 public:
  Replayer(const TypeList& types, const ReplayOptions& options, Graph& graph, ReplayReport& report)
      : types_(types), options_(options), graph_(graph), report_(report), engine_(graph) {}

  Result<void> take(const Message& message) {
    switch (message.kind) {
      case kEditMessage:
      case kWholeMessage:
        return edit(message);
      case kSolveMessage:
        return solve(message);
      case kSolutionMessage:
        return adopt(message);
      case kOutcomeMessage:
        return compare(message);
      default:
        return Error{ErrorCode::bad_input, "a message of unknown kind " + std::to_string(message.kind)};
    }
  }

 private:
  Result<void> edit(const Message& message) {
    ++report_.edits;
    if (auto ok = read_edit(message, types_, graph_, edit_); !ok) return ok;
    return graph_.apply(edit_);
  }
  Result<void> solve(const Message& message) {
    ++report_.solves;
    found_ = {};
    if (!options_.verify) return {};
    auto request = read_solve(message);
    if (!request) return request.error();
    if (options_.threads > 0) request->options.threads = options_.threads;
    if (options_.drop_caches) engine_.drop_caches();
    request->state.solved_version = engine_.state().solved_version;
    request->state.order = engine_.state().order;
    engine_.restore(request->state);
    const Summary summary = engine_.solve(request->options);
    found_ = outcome_of(summary, engine_.state(), graph_);
    return {};
  }
  // What was found then is taken over in any case, so that each solve is judged for itself.
  Result<void> adopt(const Message& message) {
    ++report_.adoptions;
    if (auto ok = read_solution(message, types_, solution_); !ok) return ok;
    solution_.version = graph_.version();
    return graph_.adopt(solution_);
  }
  Result<void> compare(const Message& message) {
    auto recorded = read_outcome(message);
    if (!recorded) return recorded.error();
    const bool stopped = recorded->reason == Reason::deadline || recorded->reason == Reason::stopped_by_callback;
    bool same = recorded->fingerprint == fingerprint(graph_);
    if (found_)
      same = same && recorded->fingerprint == found_->fingerprint && recorded->accepted == found_->accepted &&
             recorded->final_cost == found_->final_cost && recorded->state.lambda == found_->state.lambda &&
             (stopped || recorded->reason == found_->reason);
    if (same) return {};
    ++report_.differing;
    if (report_.first_differing < 0) report_.first_differing = report_.solves - 1;
    return {};
  }

  const TypeList& types_;
  const ReplayOptions& options_;
  Graph& graph_;
  ReplayReport& report_;
  NativeEngine engine_;
  GraphEdit edit_;
  Solution solution_;
  std::optional<SolveOutcome> found_;
};

}  // namespace

Result<ReplayReport> replay(const std::string& path, const TypeList& types, const ReplayOptions& options,
                            Graph& graph) {
  auto reader = JournalReader::open(path);
  if (!reader) return reader.error();
  ReplayReport report;
  report.build = reader->build();
  Replayer replayer(types, options, graph, report);
  for (;;) {
    auto message = reader->next();
    if (!message) report.damage = message.error();
    if (!message || !*message) break;
    if (auto ok = replayer.take(**message); !ok) {
      Error e = ok.error();
      e.file = path;
      e.message = "message " + std::to_string(reader->count()) + ": " + e.message;
      return e;
    }
  }
  report.messages = reader->count();
  return report;
}

}  // namespace oriel
