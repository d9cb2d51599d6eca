// A factor that is in no graph, in the form in which a graph takes it: for data that wait, or that come too late. It
// points to what its owner keeps.
#pragma once
#include <array>
#include <span>

#include "oriel/graph/graph_edit.h"

namespace oriel {

struct DetachedFactor {
  const FactorOps* ops = nullptr;
  const void* measurement = nullptr;  // ops->measurement_bytes, aligned as the residual is
  const void* noise = nullptr;        // ops->noise_bytes
  Loss loss;
  std::span<const VariableKey> variables;  // as many as ops->variables, in their order
};

// A variable that is in no graph.
struct DetachedVariable {
  VariableKey id;
  const VariableOps* ops = nullptr;
  const void* value = nullptr;
};

// The owner of one factor: what GraphEdit::add is given.
template <Residual R, class Noise>
struct Detached {
  R residual;
  Noise noise;
  Loss loss;
  std::array<VariableKey, ResidualTraits<R>::kArity> variables;

  DetachedFactor view() const { return {&kFactorOps<R, Noise>, &residual, &noise, loss, variables}; }
};

template <Residual R, class Noise, class... V>
Detached<R, Noise> detach(const R& residual, const Noise& noise, const Loss& loss, VariableId<V>... ids) {
  static_assert(detail::kSameVariables<typename R::Variables, V...>,
                "the ids must be those of the residual's Variables");
  static_assert(detail::kNoiseFits<Noise, ResidualTraits<R>::kDim>,
                "the noise has another dimension than the residual");
  return {residual, noise, loss, {VariableKey(ids)...}};
}
template <Residual R, class Noise, class... V>
Detached<R, Noise> detach(const R& residual, const Noise& noise, VariableId<V>... ids) {
  return detach(residual, noise, Loss::none(), ids...);
}

// The factors that an edit adds, one after the other: f(DetachedFactor). What f is given lives as long as the call.
template <class F>
void for_each_added_factor(const GraphEdit& edit, F&& f) {
  std::array<VariableKey, 16> ids;
  for (const auto& column : edit.factor_columns()) {
    const std::size_t arity = column->ops->variables.size();
    for (std::size_t i = 0; i < column->added.size(); ++i) {
      for (std::size_t k = 0; k < arity; ++k)
        ids[k] = {column->ops->variables[k]->key, column->variables[i * arity + k]};
      f(DetachedFactor{column->ops, column->measurements.at(i), column->noises.at(i), column->added[i].loss,
                       std::span<const VariableKey>(ids.data(), arity)});
    }
  }
}

}  // namespace oriel
