#include "oriel/window/cheirality_hook.h"

#include <algorithm>

namespace oriel {

InsertionHook::Verdict CheiralityHook::inserted(const Graph& graph, const States&, const InsertedGroup& group,
                                                GraphEdit& edit) {
  if (!sensors_.empty() && std::find(sensors_.begin(), sensors_.end(), group.sensor) == sensors_.end()) return {};
  for (const FactorId id : group.factors)
    if (probe_.look(graph, id, false) && !probe_.valid()) pruner_.drop(edit, id);
  dropped_ += pruner_.dropped();
  pruner_.finish(graph, group.variables, edit);
  return {};
}

}  // namespace oriel
