// How states leave a window: the policy says who, builders are told before and after, and nothing leaves that no solve
// has seen.
#include <algorithm>

#include "oriel/window/sliding_window.h"

namespace oriel {

void SlidingWindow::slide() {
  choose_leaving();
  if (leaving_.empty()) return;
  Result<void> ok = prepare_builders();
  if (ok) ok = remove_states();
  if (ok) ok = marginalize_states();
  finish_slide(ok.ok());
  if (ok) return;
  report_.error = ok.error();
  report_.status = WindowUpdate::Status::slide_failed;
}

void SlidingWindow::choose_leaving() {
  leaving_.clear();
  leaving_variables_.clear();
  if (policy_) policy_->choose(graph(), states_, leaving_);
  std::erase_if(leaving_, [this](const LeavingState& l) {
    const State* state = states_.has(l.provider) ? states_.timeline(l.provider).find(l.time) : nullptr;
    return state == nullptr || (!state->solved && l.how == LeavingState::How::marginalize);
  });
  for (const LeavingState& l : leaving_)
    for (const VariableKey id : states_.timeline(l.provider).find(l.time)->all()) leaving_variables_.push_back(id);
}

Result<void> SlidingWindow::prepare_builders() {
  tell_leaving();
  for (auto& builder : builders_) {
    builder->before_slide(graph(), states_, leaving_variables_, core_.edit());
    if (auto ok = core_.commit(); !ok) return ok;
  }
  for (auto& builder : batch_builders_) {
    builder->before_slide(graph(), states_, leaving_variables_, core_.edit());
    if (auto ok = core_.commit(); !ok) return ok;
  }
  return {};
}

void SlidingWindow::tell_leaving() {
  for (WindowListener* listener : listeners_)
    for (const LeavingState& l : leaving_)
      listener->leaving(graph(), states_, l.provider, *states_.timeline(l.provider).find(l.time));
}

// Each by an edit of its own. Landmarks that it alone sees go with it.
Result<void> SlidingWindow::remove_states() {
  for (const LeavingState& l : leaving_) {
    if (l.how != LeavingState::How::remove) continue;
    const State state = *states_.timeline(l.provider).find(l.time);
    const bool oldest = states_.timeline(l.provider).oldest()->time == l.time;
    if (auto ok = scope_.collect(graph(), state.all(), LandmarkPolicy::keep); !ok) return ok;
    GraphEdit& edit = core_.edit();
    for (const MarginalVariable& v : scope_.variables())
      if (v.landmark && v.role == MarginalVariable::Role::leaving) edit.remove(v.id);
    Result<void> ok = states_.withdraw(edit, l.provider, l.time);
    if (ok) ok = states_.link(edit);
    if (ok) ok = core_.commit();
    if (!ok) {
      edit.clear();
      states_.rollback();
      return ok;
    }
    states_.commit();
    if (oldest) states_.raise_horizon(l.provider, l.time);
    ++report_.states_removed;
  }
  return {};
}

// All together, at the graph's values: where the last solve left them.
Result<void> SlidingWindow::marginalize_states() {
  std::erase_if(leaving_, [](const LeavingState& l) { return l.how != LeavingState::How::marginalize; });
  if (leaving_.empty()) return {};
  leaving_variables_.clear();
  for (const LeavingState& l : leaving_)
    for (const VariableKey id : states_.timeline(l.provider).find(l.time)->all()) leaving_variables_.push_back(id);
  MarginalizeOptions how = options_.marginalize;
  // A state that stayed, fixed, would be in nobody's timeline, and never leave: what is to be fixed leaves as known.
  types_.assign(how.types.begin(), how.types.end());
  for (TypePolicy& type : types_)
    if (type.departure == Departure::fix) type.departure = Departure::condition;
  how.types = types_;
  if (late_) {
    late_->before_slide(graph(), states_, leaving_, leaving_variables_);
    if (how.ledger == nullptr) how.ledger = late_->ledger();
  }
  Result<void> ok;
  if (!options_.keep_prior) {
    ok = core_.drop(leaving_variables_, options_.marginalize.landmarks);
  } else if (auto report = core_.slide(leaving_variables_, how); report) {
    report_.slide = std::move(*report);
  } else {
    ok = report.error();
  }
  for (const LeavingState& l : leaving_) {
    if (!ok) break;
    states_.forget(l.provider, l.time);
    ++report_.states_marginalized;
  }
  if (late_) late_->after_slide(graph(), states_, ok.ok());
  return ok;
}

void SlidingWindow::finish_slide(bool slid) {
  if (!slid) return;
  for (auto& builder : builders_) builder->after_slide(graph(), states_);
  for (auto& builder : batch_builders_) builder->after_slide(graph(), states_);
}

}  // namespace oriel
