#include "oriel/run/solve_beside.h"

#include <utility>

#include "oriel/graph/fingerprint.h"

namespace oriel {

void TravellingSummary::take(Summary&& of) {
  summary = std::move(of);
  linear_solver = summary.linear_solver;
  summary.linear_solver = "";
}

// Of the names that engines here give; another one is lost.
void TravellingSummary::give(Summary& to) const {
  static constexpr const char* kNames[] = {"dense",
                                           "multifrontal",
                                           "landmark_schur+dense",
                                           "landmark_schur+multifrontal",
                                           "landmark_schur_panel+dense",
                                           "landmark_schur_panel+multifrontal",
                                           "landmark_schur+conjugate_gradient"};
  to = summary;
  for (const char* name : kNames)
    if (linear_solver == name) to.linear_solver = name;
}

namespace run_detail {
namespace {

void send_value(const Graph& graph, SlotKey key, edit::Variables& column) {
  const void* value = graph.find_value({column.ops->key, key});
  bool is_set = value == nullptr;
  for (const auto& [id, kind] : column.set) is_set = is_set || (id == key && kind == edit::SetKind::value);
  if (is_set) return;
  column.set.emplace_back(key, edit::SetKind::value);
  column.set_values.push_back(value);
}

// A variable that was fixed or restricted while a solve was under way keeps its value here and was moved there: its
// value goes along, also where it was let go again since.
void send_values_of_held(const Graph& graph, GraphEdit& edit) {
  for (auto& column : edit.variable_columns()) {
    for (const auto& [key, fixed] : column->fixed) send_value(graph, key, *column);
    for (const auto& [key, freedom] : column->freedoms) send_value(graph, key, *column);
  }
}

}  // namespace

struct SolveContext::State {
  explicit State(TypeList t) : types(std::move(t)), engine(graph) {}
  TypeList types;
  Graph graph;
  NativeEngine engine;
  GraphEdit edit;
  std::uint64_t sequence = 0;     // of the last job
  std::size_t solution_size = 0;  // of the last message [bytes]
};

SolveContext::SolveContext(TypeList types) : state_(new State(std::move(types))) {}
SolveContext::SolveContext(SolveContext&&) noexcept = default;
SolveContext& SolveContext::operator=(SolveContext&&) noexcept = default;
SolveContext::~SolveContext() = default;

Result<SolveOutput> SolveContext::solve(const SolveInput& input) {
  State& s = *state_;
  const auto edit = read_message(input.edit);
  if (!edit) return edit.error();
  const auto request_message = read_message(input.request);
  if (!request_message) return request_message.error();
  auto request = read_solve(*request_message);
  if (!request) return request.error();
  if (auto ok = read_edit(*edit, s.types, s.graph, s.edit); !ok) return ok.error();
  if (!s.edit.whole() && input.sequence != s.sequence + 1)
    return Error{ErrorCode::conflict, "a worker's graph is not the one that these edits are for"};
  s.sequence = 0;  // in vain until the end
  if (auto ok = s.graph.apply(s.edit); !ok) return ok.error();
  request->state.solved_version = s.engine.state().solved_version;
  request->state.order = s.edit.whole() ? input.order : s.engine.state().order;
  s.engine.restore(request->state);
  request->options.trace = input.wants_trace;
  Summary summary = s.engine.solve(request->options);
  s.sequence = input.sequence;

  SolveOutput out;
  out.version = input.version;
  if (!summary.failed() && summary.accepted > 0) {
    out.solution.reserve(s.solution_size + s.solution_size / 8);
    append_solution(out.solution, s.engine.solution());
    s.solution_size = out.solution.size();
  }
  SolveOutcome outcome{summary.reason,
                       summary.iterations,
                       summary.accepted,
                       summary.initial_cost,
                       summary.final_cost,
                       s.engine.state(),
                       0};
  if (input.wants_fingerprint) outcome.fingerprint = fingerprint(s.graph);
  append_outcome(out.outcome, outcome);
  out.order = s.engine.state().order;
  out.summary.take(std::move(summary));
  return out;
}

SolveOwner::SolveOwner(SolveOwner&& other) noexcept
    : graph_(std::exchange(other.graph_, nullptr)),
      types_(std::move(other.types_)),
      can_be_lost_(other.can_be_lost_),
      told_(std::move(other.told_)),
      subscription_(other.subscription_),
      subscribed_(other.subscribed_),
      whole_(other.whole_),
      sequence_(other.sequence_),
      adoptions_(other.adoptions_),
      state_(other.state_),
      outcome_(other.outcome_),
      summary_(std::move(other.summary_)),
      edit_(std::move(other.edit_)),
      input_(std::move(other.input_)),
      solution_(std::move(other.solution_)),
      written_(std::move(other.written_)) {}

SolveOwner::~SolveOwner() {
  if (graph_ != nullptr && subscribed_) graph_->unsubscribe(subscription_);
}

void SolveOwner::begin_anew() {
  if (subscribed_) graph_->unsubscribe(subscription_);
  subscription_ = graph_->subscribe();
  subscribed_ = true;
  whole_ = true;
  sequence_ = 0;
  told_.forget();
  adoptions_ = graph_->adoptions();
}

const SolveInput& SolveOwner::collect(const SolveOptions& options) {
  SolveInput& in = input_;
  in.edit.clear();
  in.request.clear();
  in.order = {};
  if (graph_->adoptions() != adoptions_) begin_anew();
  graph_->collect(subscription_, edit_);
  if (std::exchange(whole_, false))
    edit_.mark_whole(), in.order = state_.order;
  else
    send_values_of_held(*graph_, edit_);
  in.sequence = ++sequence_;
  in.version = graph_->version();
  in.wants_trace = options.trace;
  append_edit(in.edit, edit_);
  SolveRequest request{options, state_};
  append_solve(in.request, request);
  return in;
}

void SolveOwner::submitted() {
  if (can_be_lost_) told_.told(input_.edit, edit_.whole(), *graph_);
}

Result<void> SolveOwner::collect_again() {
  // One that was told everything began with the order that it was told.
  if (!edit_.whole()) input_.order = state_.order;
  return told_.tell(types_, input_.edit);
}

void SolveOwner::write(const SolveOutput& output) { written_ = take(output); }

Result<void> SolveOwner::take(const SolveOutput& output) {
  const auto message = read_message(output.outcome);
  if (!message) return message.error();
  auto outcome = read_outcome(*message);
  if (!outcome) return outcome.error();
  outcome_ = *outcome;
  state_ = outcome_.state;
  output.summary.give(summary_);
  state_.order = output.order;
  if (output.solution.empty()) return {};
  const auto solution = read_message(output.solution);
  if (!solution) return solution.error();
  if (auto ok = read_solution(*solution, types_, solution_); !ok) return ok;
  if (told_.knows()) told_.solved(output.solution);
  solution_.version = output.version;  // what the owner set since then stays
  const bool knows = graph_->adoptions() == adoptions_;
  auto adopted = graph_->adopt(solution_);
  if (knows) adoptions_ = graph_->adoptions();
  return adopted;
}

}  // namespace run_detail
}  // namespace oriel
