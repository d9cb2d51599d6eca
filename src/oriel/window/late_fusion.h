// LateFusion: groups of factors that name times whose states have left the window go into the prior instead of being
// refused (behaviour W7; late_ledger.h has the mathematics, and says what is exact).
//
//   window.remember(Duration::from_seconds(10));                     // how long providers keep their raw motion
//   window.set(std::make_unique<LateFusion>(LateLedgerOptions{.horizon = Duration::from_seconds(10)}));
//
// A time that never had a state gets one, in the ledger alone, between the states on either side of it: the provider
// links it to both. Refused, with the window and the ledger as they were: a time before all states that are remembered,
// or whose motion the provider does not have any more; a group that brings variables of its own; and what the ledger
// refuses. A group is folded as a whole or not at all. Counted: LateLedger::count, and `refused` by reason.
#pragma once
#include <array>
#include <vector>

#include "oriel/window/late_groups.h"
#include "oriel/window/late_ledger.h"

namespace oriel {

class LateFusion final : public LateGroups {
 public:
  // Why a group was refused before the ledger was asked.
  enum class Reason { new_variables, no_neighbours, no_motion, unknown };
  static constexpr int kReasons = 4;

  explicit LateFusion(const LateLedgerOptions& options = {}) : ledger_(options) {}

  const LateLedger& kept() const { return ledger_; }
  std::int64_t refused(Reason reason) const { return refused_[static_cast<std::size_t>(reason)]; }
  std::int64_t states_made() const { return states_made_; }

  // ---- for the window ----
  LateLedger* ledger() override { return &ledger_; }
  bool fold(WindowCore& core, States& states, const PendingFactors& pending,
            const PendingFactors::Group& group) override;
  void before_slide(const Graph& graph, const States& states, std::span<const LeavingState> leaving,
                    std::span<const VariableKey> variables) override;
  void after_slide(const Graph& graph, const States& states, bool slid) override;
  void reset() override;

 private:
  struct Left {
    ProviderId provider;
    State state;
  };
  bool refuse(Reason reason);
  bool fold_factors(WindowCore& core, States& states, const PendingFactors& pending, const PendingFactors::Group& group,
                    GraphEdit& edit);
  VariableKey find(const Graph& graph, States& states, const PendingRef& ref);
  const State* neighbour(const States& states, ProviderId provider, Time time, bool before) const;
  const State* make_state(const Graph& graph, States& states, ProviderId provider, Time time);
  void take_halves(const GraphEdit& sketch);
  bool copy(const Graph& graph, const State& from, StateProvider& provider, GraphEdit& sketch, State& to);
  VariableKey true_id(VariableKey sketched) const;
  Timeline<State>& left(ProviderId provider);
  void forget_old();

  LateLedger ledger_;
  std::vector<Timeline<State>> left_;  // by provider: states that the ledger holds
  std::vector<Left> leaving_, made_;   // about to leave; made for the group at hand
  std::array<std::int64_t, kReasons> refused_{};
  std::int64_t states_made_ = 0;

  // A graph in which a provider is asked for motions of states that are in no graph.
  Graph sketch_;
  std::vector<std::pair<VariableKey, VariableKey>> true_ids_;  // of the sketch's variables
  std::vector<VariableKey> keys_;
  std::vector<DetachedVariable> new_variables_;
  std::vector<DetachedFactor> halves_;
  std::vector<std::array<VariableKey, 16>> half_ids_;
  std::vector<double> value_;
};

}  // namespace oriel
