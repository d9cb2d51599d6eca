#include "oriel/run/kept_graph.h"

#include <algorithm>

namespace oriel::run_detail {
namespace {

Result<void> apply(const TypeList& types, std::span<const std::byte> edit, std::span<const std::byte> found,
                   Graph& graph) {
  const auto message = read_message(edit);
  if (!message) return message.error();
  GraphEdit e;
  if (auto ok = read_edit(*message, types, graph, e); !ok) return ok;
  if (auto ok = graph.apply(e); !ok || found.empty()) return ok;
  const auto solved = read_message(found);
  if (!solved) return solved.error();
  Solution solution;
  if (auto ok = read_solution(*solved, types, solution); !ok) return ok;
  solution.version = graph.version();
  return graph.adopt(solution);
}

}  // namespace

void KeptGraph::told(Bytes& message, bool whole, Graph& now) {
  if (!whole && !knows_) return;
  knows_ = true;
  if (whole) {
    whole_.swap(message);
  } else if (bytes_ + message.size() > std::max(whole_.size(), least_)) {
    take_whole(now);
  } else {
    if (count_ == steps_.size()) steps_.emplace_back();
    Step& step = steps_[count_++];
    step.edit.swap(message);
    step.solution.clear();
    bytes_ += step.edit.size();
    return;
  }
  solution_.clear();
  count_ = bytes_ = 0;
}

void KeptGraph::solved(std::span<const std::byte> solution) {
  Bytes& to = count_ == 0 ? solution_ : steps_[count_ - 1].solution;
  to.assign(solution.begin(), solution.end());
  bytes_ += solution.size();
}

void KeptGraph::take_whole(Graph& graph) {
  const Subscription all = graph.subscribe();
  graph.collect(all, edit_);
  graph.unsubscribe(all);
  edit_.mark_whole();
  whole_.clear();
  append_edit(whole_, edit_);
}

Result<void> KeptGraph::make(const TypeList& types, Graph& graph) const {
  if (auto ok = apply(types, whole_, solution_, graph); !ok) return ok;
  for (std::size_t i = 0; i < count_; ++i)
    if (auto ok = apply(types, steps_[i].edit, steps_[i].solution, graph); !ok) return ok;
  return {};
}

Result<void> KeptGraph::tell(const TypeList& types, Bytes& message) {
  if (!knows_) return Error{ErrorCode::not_found, "a graph that was never told whole"};
  if (count_ > 0 || !solution_.empty()) {
    Graph graph;
    if (auto ok = make(types, graph); !ok) return ok;
    take_whole(graph);
    solution_.clear();
    count_ = bytes_ = 0;
  }
  message = whole_;
  return {};
}

}  // namespace oriel::run_detail
