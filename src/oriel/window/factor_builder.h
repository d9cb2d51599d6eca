// Factor builders turn measurements into factors. A FactorBuilder hands over each measurement once, as pending factors
// that wait for their states. A BatchFactorBuilder keeps all measurements that states of the window made, and replaces
// its factors as a whole in every update, as structureless tracks need it.
#pragma once
#include <span>
#include <string_view>

#include "oriel/graph/graph.h"
#include "oriel/window/pending_factors.h"
#include "oriel/window/states.h"

namespace oriel {

class FactorBuilder {
 public:
  virtual ~FactorBuilder() = default;
  virtual std::string_view name() const = 0;
  // Hands over what was measured since the last call. pending.begin() gives each group a number.
  virtual void drain(const Graph& graph, const States& states, PendingFactors& pending) = 0;
  // What became of a group: it is in the graph, hooks have let it pass (its variables and factors in the order in which
  // they were added; what hooks took out is not in the graph), or it never will be. A group that came late and is in
  // the prior has none of either.
  virtual void entered(std::uint64_t group, std::span<const VariableKey> variables, std::span<const FactorId> factors) {
    (void)group, (void)variables, (void)factors;
  }
  virtual void refused(std::uint64_t group) { (void)group; }
  // States are about to be marginalized: put into `edit` what has to change before (it is applied first).
  virtual void before_slide(const Graph& graph, const States& states, std::span<const VariableKey> leaving,
                            GraphEdit& edit) {
    (void)graph, (void)states, (void)leaving, (void)edit;
  }
  // They are gone, and nothing of theirs may be kept.
  virtual void after_slide(const Graph& graph, const States& states) { (void)graph, (void)states; }
  // The window begins anew: forget what names ids.
  virtual void reset() {}
};

class BatchFactorBuilder {
 public:
  virtual ~BatchFactorBuilder() = default;
  virtual std::string_view name() const = 0;
  // Times that its measurements need a state at, of which provider: the window makes them where that is possible. They
  // stay whatever becomes of the rebuild, tied by their motion: a frame in which everything is new is a state too.
  virtual void wanted(std::vector<std::pair<ProviderId, Time>>& times) const = 0;
  // Removes its factors of the last time and adds those of all measurements in hand, in one edit. The same measurements
  // give the same set. False: nothing was new, and the edit is empty.
  virtual Result<bool> rebuild(const Graph& graph, const States& states, GraphEdit& edit) = 0;
  // The edit of rebuild was refused: its factors are those of before.
  virtual void refused() = 0;
  virtual void before_slide(const Graph& graph, const States& states, std::span<const VariableKey> leaving,
                            GraphEdit& edit) = 0;
  virtual void after_slide(const Graph& graph, const States& states) = 0;
  virtual void reset() = 0;
};

}  // namespace oriel
