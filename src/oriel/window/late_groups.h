// LateGroups: who takes a group of factors whose state has left the window (behaviour W7). Without one it is refused.
#pragma once
#include <span>
#include <utility>

#include "oriel/base/function.h"
#include "oriel/window/pending_factors.h"
#include "oriel/window/window_core.h"
#include "oriel/window/window_policy.h"

namespace oriel {

class LateGroups {
 public:
  virtual ~LateGroups() = default;
  // Where marginalization is to keep what it knows of the states that leave; null: nowhere.
  virtual LateLedger* ledger() { return nullptr; }
  // Folds the group into the prior, by an edit of the core. False: it cannot (any more), and nothing has changed. Of
  // `states` it may ask the providers.
  virtual bool fold(WindowCore& core, States& states, const PendingFactors& pending,
                    const PendingFactors::Group& group) = 0;
  // These states, and with them `variables`, are about to be marginalized, at the graph's values.
  virtual void before_slide(const Graph& graph, const States& states, std::span<const LeavingState> leaving,
                            std::span<const VariableKey> variables) {
    (void)graph, (void)states, (void)leaving, (void)variables;
  }
  // They have left; or the slide failed, and they are there as before.
  virtual void after_slide(const Graph& graph, const States& states, bool slid) {
    (void)graph, (void)states, (void)slid;
  }
  virtual void reset() {}
  // Whom fold() asks, by passes(), before it applies its edit.
  void ask(Function<bool(const GraphEdit&)> judge) { judge_ = std::move(judge); }

 protected:
  // False: a hook rejects the group, and fold() says false with nothing changed.
  bool passes(const GraphEdit& edit) { return !judge_ || judge_(edit); }

 private:
  Function<bool(const GraphEdit&)> judge_;
};

}  // namespace oriel
