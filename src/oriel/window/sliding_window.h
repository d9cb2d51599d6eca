// SlidingWindow: measurements of any kind in, in any order; the states of the last while at their most likely values.
//
//   SlidingWindow window;
//   const ProviderId imu = window.add(std::make_unique<ImuStates>(...));
//   window.add(std::make_unique<GnssBuilder>(...));
//   for (;;) { ...hand measurements to providers and builders...; const WindowUpdate& update = window.update(); }
//
// An update (behaviour W14) drains the builders; enters the groups of factors whose states are there or can be made,
// each by an edit of its own and past the hooks; has batch builders rebuild their factors; solves; lets the policy
// choose who leaves, and marginalizes them at the solution; and tells the listeners. It knows no threads.
#pragma once
#include <memory>
#include <vector>

#include "oriel/window/factor_builder.h"
#include "oriel/window/insertion_hook.h"
#include "oriel/window/late_groups.h"
#include "oriel/window/pending_factors.h"
#include "oriel/window/states.h"
#include "oriel/window/window_core.h"
#include "oriel/window/window_policy.h"
#include "oriel/window/window_update.h"

namespace oriel {

struct WindowOptions {
  WindowOptions() { solve.trace = false; }
  SolveOptions solve;
  MarginalizeOptions marginalize;  // Departure::fix says the same as Departure::condition here
  bool slide_before_solve = false;
  bool keep_prior = true;  // false: what leaves is forgotten
  // Solves that fail one after the other until the window begins anew: nothing can leave while they do. 0: never.
  int failures_before_reset = 3;
};

class SlidingWindow {
 public:
  explicit SlidingWindow(const WindowOptions& options = {});

  // ---- what it is made of ----
  ProviderId add(std::unique_ptr<StateProvider> provider) { return states_.add(std::move(provider)); }
  // The number of its sensor: the builder's name, under which its groups are counted.
  int add(std::unique_ptr<FactorBuilder> builder);
  int add(std::unique_ptr<BatchFactorBuilder> builder);
  // Hooks look at each group in the order in which they were added.
  void add(std::unique_ptr<InsertionHook> hook) { hooks_.push_back(std::move(hook)); }
  void set(std::unique_ptr<WindowPolicy> policy) { policy_ = std::move(policy); }
  void set(std::unique_ptr<LateGroups> late);
  // How long before the oldest state providers keep their raw motion, for states that come late (late_fusion.h).
  void remember(Duration memory) { states_.remember(memory); }
  void listen(WindowListener* listener) { listeners_.push_back(listener); }
  WindowOptions& options() { return options_; }

  // ---- what goes in ----
  // The first state of a provider, before anything asks for one.
  Result<State> begin(ProviderId provider, Time time);
  // For groups without a builder; between updates.
  PendingFactors& pending() { return pending_; }
  // What it says holds until the next call.
  const WindowUpdate& update();
  // Waits for the solve that the last update began, and merges it as the next one would; nothing that waits comes in.
  // For windows that solve beside their caller (WindowCore::defer_to).
  const WindowUpdate& settle();
  // States and landmarks leave; other static variables stay, with what was known of them alone. Times before `horizon`
  // are too old for the new window.
  void begin_anew(const char* reason, Time horizon);

  // ---- what it knows ----
  const Graph& graph() const { return core_.graph(); }
  const States& states() const { return states_; }
  StateProvider& provider(ProviderId id) { return states_.provider(id); }
  // For the user's own edits (static variables, factors between what is there), observers and followers. States leave
  // by the policy, never by a user's edit.
  WindowCore& core() { return core_; }
  // Since the beginning.
  const std::vector<Refusals>& refusals() const { return refusals_; }
  const WindowUpdate& last_update() const { return report_; }

 private:
  enum class Entry { entered, waits, reset, done };
  void begin_report();
  void drain();
  void enter_ready();
  Entry enter(const PendingFactors::Group& group);
  Entry put(const PendingFactors::Group& group);
  Readiness make_states(GraphEdit& edit, const PendingFactors::Group& group);
  Entry pass_hooks(const PendingFactors::Group& group);
  Result<void> follow_hook();
  void expel();
  bool expel(bool with_states);
  Entry take_late(const PendingFactors::Group& group);
  bool pass_late_hooks(const GraphEdit& edit);
  Entry refuse(const PendingFactors::Group& group, Refusal why);
  void count(int sensor, Refusal why);

  void rebuild_batches();
  bool make_wanted();
  Result<void> make_wanted(ProviderId provider, Time time);

  void solve_and_slide();
  bool solve();
  bool conclude_solve();
  void begin_solve();
  void merge();
  void tell_updated();
  void recover();
  void slide();
  void choose_leaving();
  Result<void> prepare_builders();
  Result<void> remove_states();
  Result<void> marginalize_states();
  void finish_slide(bool slid);
  void tell_leaving();

  WindowOptions options_;
  WindowCore core_;
  States states_;
  PendingFactors pending_;
  std::vector<std::unique_ptr<FactorBuilder>> builders_;
  std::vector<std::unique_ptr<BatchFactorBuilder>> batch_builders_;
  std::vector<int> builder_sensors_, batch_sensors_;
  std::vector<std::unique_ptr<InsertionHook>> hooks_;
  std::unique_ptr<WindowPolicy> policy_;
  std::unique_ptr<LateGroups> late_;
  std::vector<WindowListener*> listeners_;

  WindowUpdate report_;
  std::vector<Refusals> refusals_;
  std::uint64_t seen_version_ = 0;  // of the graph, at the end of the last update
  int failures_ = 0;                // solves that failed one after the other

  // ---- workspaces ----
  std::vector<std::uint32_t> order_;  // of pending groups
  std::vector<States::Made> named_;   // by a group, or by batch builders
  std::vector<std::pair<ProviderId, Time>> wanted_;
  // Of the group that is entering: its factors, its variables, and those of states that were made for it.
  std::vector<FactorId> factors_, came_factors_;  // what is there now; what it came with, whatever hooks took out
  std::vector<VariableKey> variables_, came_variables_, state_variables_;
  std::vector<States::Made> made_;
  const PendingFactors::Group* late_group_ = nullptr;  // that is being folded
  bool late_rejected_ = false;
  std::vector<LeavingState> leaving_;
  std::vector<VariableKey> leaving_variables_;
  std::vector<TypePolicy> types_;
  MarginalScope scope_;
};

}  // namespace oriel
