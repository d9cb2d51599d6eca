// A gap too long to be bridged ends the window: what was known before says nothing of what comes after. The window
// begins anew with the group that came after the gap, and says why.
#pragma once
#include "oriel/window/insertion_hook.h"

namespace oriel {

class GapResetHook final : public InsertionHook {
 public:
  // Between two states of a provider, one after the other [ns].
  GapResetHook(ProviderId provider, Duration longest) : provider_(provider), longest_(longest) {}

  std::string_view name() const override { return "gap reset"; }
  Verdict inserted(const Graph&, const States& states, const InsertedGroup& group, GraphEdit&) override {
    if (group.new_variables.empty()) return {};
    const State* newest = states.timeline(provider_).find(group.newest);
    const State* before = states.timeline(provider_).at_or_before(group.newest - Duration{1});
    if (newest == nullptr || before == nullptr || newest->time - before->time <= longest_) return {};
    return {.reject = false, .reset = true, .reason = "a gap longer than the window can bridge"};
  }

 private:
  ProviderId provider_;
  Duration longest_;
};

}  // namespace oriel
