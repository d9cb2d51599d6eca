#include "oriel/run/kept_graph.h"

#include <algorithm>

namespace oriel::run_detail {
namespace {

Result<void> apply(const TypeList& types, std::span<const std::byte> edit, Graph& graph) {
  const auto message = read_message(edit);
  if (!message) return message.error();
  GraphEdit e;
  if (auto ok = read_edit(*message, types, graph, e); !ok) return ok;
  return graph.apply(e);
}

Result<void> adopt(const TypeList& types, std::span<const std::byte> found, Graph& graph) {
  const auto message = read_message(found);
  if (!message) return message.error();
  Solution solution;
  if (auto ok = read_solution(*message, types, solution); !ok) return ok;
  solution.version = graph.version();
  return graph.adopt(solution);
}

}  // namespace

void KeptGraph::told(std::span<const std::byte> message, bool whole, Graph& now) {
  if (!whole && !knows_) return;
  knows_ = true;
  if (!whole && since_.size() + message.size() <= std::max(whole_.size(), least_)) {
    since_.insert(since_.end(), message.begin(), message.end());
    sizes_.push_back({message.size(), 0});
    return;
  }
  if (whole)
    whole_.assign(message.begin(), message.end());
  else
    take_whole(now);
  since_.clear();
  sizes_.assign(1, {});
}

void KeptGraph::solved(std::span<const std::byte> solution) {
  since_.insert(since_.end(), solution.begin(), solution.end());
  sizes_.back().solution = solution.size();
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
  if (auto ok = apply(types, whole_, graph); !ok) return ok;
  std::span<const std::byte> rest = since_;
  const auto next = [&rest](std::size_t size) {
    const auto message = rest.first(size);
    rest = rest.subspan(size);
    return message;
  };
  for (const Sizes& s : sizes_) {
    if (s.edit > 0)
      if (auto ok = apply(types, next(s.edit), graph); !ok) return ok;
    if (s.solution > 0)
      if (auto ok = adopt(types, next(s.solution), graph); !ok) return ok;
  }
  return {};
}

Result<void> KeptGraph::tell(const TypeList& types, Bytes& message) {
  if (!knows_) return Error{ErrorCode::not_found, "a graph that was never told whole"};
  if (!since_.empty()) {
    Graph graph;
    if (auto ok = make(types, graph); !ok) return ok;
    take_whole(graph);
    since_.clear();
    sizes_.assign(1, {});
  }
  message = whole_;
  return {};
}

}  // namespace oriel::run_detail
