// What a graph says of some variables and factors: the contents of an engine that keeps no more than their ids and
// reads all else of its graph.
#pragma once
#include <span>

#include "oriel/solve/engine_contents.h"

namespace oriel {

// Of the variables those that may move; those that are not in the graph (any more) are told of with nothing but their
// ids, so that `check` names them. The cost is summed factor by factor, through linearize_factor.
EngineContents contents_of(const Graph& graph, std::span<const VariableKey> variables,
                           std::span<const FactorId> factors);

}  // namespace oriel
