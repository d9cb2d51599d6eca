// What an engine holds of its graph, so that it can be compared with it (behaviour C7). For tests and for authors of
// engines; it copies everything.
#pragma once
#include <cstddef>
#include <vector>

#include "oriel/base/result.h"
#include "oriel/graph/graph.h"

namespace oriel {

struct EngineContents {
  // A variable that the engine may move: neither fixed nor a constant.
  struct Parameter {
    VariableKey id;
    int dim = 0;                   // of its tangent space, held directions among them, as the engine laid it out
    std::vector<std::byte> value;  // where the next solve begins
    Freedom freedom{};             // as the engine keeps it
  };
  // A factor or a linear prior.
  struct Residual {
    FactorId id;
    int rows = 0;
    std::vector<VariableKey> parameters;  // those of its variables that may move, in its order, each once
    void add(const VariableKey& parameter) {
      for (const VariableKey& known : parameters)
        if (known == parameter) return;
      parameters.push_back(parameter);
    }
  };
  std::vector<Parameter> parameters;  // in any order
  std::vector<Residual> residuals;
  double cost = 0.0;  // ½Σρ(‖r‖²) at the values, over the factors that are valid there
};

// What an engine of this graph should hold. The cost is summed factor by factor, through linearize_factor.
EngineContents expected_contents(const Graph& graph);

// Nothing if both are the same in whatever order, cost up to rounding; else an Error that names the first difference.
Result<void> compare_contents(const Graph& graph, EngineContents expected, EngineContents held);

}  // namespace oriel
