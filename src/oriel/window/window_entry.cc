// How groups of factors enter a window: when they are ready, in the order of their times, each by an edit of its own.
#include <algorithm>

#include "oriel/window/sliding_window.h"

namespace oriel {

// In the order of their oldest times, so that a first state is the oldest that is asked for; groups without times come
// first. Groups at one time keep the order in which they came.
void SlidingWindow::enter_ready() {
  const auto key = [this](std::uint32_t place) {
    const PendingFactors::Group& g = pending_.groups()[place];
    return std::pair(g.has_states ? g.oldest : States::kNever, g.number);
  };
  order_.clear();
  for (std::uint32_t place = 0; place < pending_.groups().size(); ++place) order_.push_back(place);
  std::sort(order_.begin(), order_.end(), [&](std::uint32_t a, std::uint32_t b) { return key(a) < key(b); });
  for (const std::uint32_t place : order_) {
    const PendingFactors::Group group = pending_.groups()[place];
    Entry entry = enter(group);
    if (entry == Entry::reset) entry = enter(group);  // as the first of the new window
    if (entry != Entry::waits) pending_.drop(place);
  }
  pending_.compact();
}

SlidingWindow::Entry SlidingWindow::enter(const PendingFactors::Group& group) {
  switch (pending_.readiness(group, graph(), states_)) {
    case Readiness::waits:
      return Entry::waits;
    case Readiness::too_old:
      return take_late(group);
    case Readiness::unknown_id:
      return refuse(group, Refusal::unknown_id);
    case Readiness::unknown_state:
      return refuse(group, Refusal::unknown_state);
    case Readiness::ready:
      break;
  }
  const Entry in = put(group);
  if (in != Entry::entered) return in;
  const Entry passed = pass_hooks(group);
  if (passed != Entry::entered) return passed;
  ++report_.entered;
  report_.states_made += static_cast<int>(made_.size());
  if (group.owner >= 0) builders_[group.owner]->entered(group.number, came_variables_, came_factors_);
  return Entry::entered;
}

// The one place where a group arrives whose states have left. Of the states that it names those that can be in the
// window are made first; while one of them cannot be had yet, the group waits.
SlidingWindow::Entry SlidingWindow::take_late(const PendingFactors::Group& group) {
  if (late_ == nullptr) return refuse(group, Refusal::too_old);
  factors_.clear();
  variables_.clear();
  GraphEdit& edit = core_.edit();
  const Readiness live = make_states(edit, group);
  made_.assign(states_.new_states().begin(), states_.new_states().end());
  Result<void> ok;
  if (live == Readiness::ready) ok = core_.commit();
  if (live != Readiness::ready || !ok) {
    if (!ok) report_.error = ok.error();
    edit.clear();
    states_.rollback();
    return live == Readiness::waits ? Entry::waits : refuse(group, Refusal::no_motion);
  }
  states_.commit();
  late_group_ = &group;
  late_rejected_ = false;
  if (!late_->fold(core_, states_, pending_, group)) {
    if (!made_.empty()) expel();
    return refuse(group, late_rejected_ ? Refusal::rejected : Refusal::too_old);
  }
  ++report_.late;
  report_.states_made += static_cast<int>(made_.size());
  if (group.owner >= 0) builders_[group.owner]->entered(group.number, {}, {});
  return Entry::done;
}

// Of what a late group would change.
bool SlidingWindow::pass_late_hooks(const GraphEdit& edit) {
  const LateArrival arrival{late_group_->sensor, late_group_->oldest, late_group_->newest, edit};
  for (auto& hook : hooks_) {
    const InsertionHook::Verdict verdict = hook->late(graph(), states_, arrival);
    if (!verdict.reject) continue;
    report_.rejection = verdict.reason;
    late_rejected_ = true;
    return false;
  }
  return true;
}

SlidingWindow::Entry SlidingWindow::refuse(const PendingFactors::Group& group, Refusal why) {
  count(group.sensor, why);
  if (group.owner >= 0) builders_[group.owner]->refused(group.number);
  return Entry::done;
}

void SlidingWindow::count(int sensor, Refusal why) {
  const auto at = static_cast<std::size_t>(sensor), reason = static_cast<std::size_t>(why);
  const auto sensors = static_cast<std::size_t>(pending_.sensors());
  for (std::vector<Refusals>* all : {&refusals_, &report_.refusals}) {
    if (all->size() < sensors) all->resize(sensors);
    ++(*all)[at].counts[reason];
  }
  ++report_.refused;
}

// The group, and the states that it needs, in one edit.
SlidingWindow::Entry SlidingWindow::put(const PendingFactors::Group& group) {
  GraphEdit& edit = core_.edit();
  factors_.clear();
  variables_.clear();
  const Readiness made = make_states(edit, group);
  Result<void> ok;
  if (made == Readiness::ready) {
    pending_.insert(group, states_, edit, variables_, factors_);
    came_variables_ = variables_;
    came_factors_ = factors_;
    state_variables_.assign(states_.new_variables().begin(), states_.new_variables().end());
    made_.assign(states_.new_states().begin(), states_.new_states().end());
    ok = core_.commit();
    if (ok) {
      states_.commit();
      return Entry::entered;
    }
    report_.error = ok.error();
  }
  edit.clear();
  states_.rollback();
  if (made == Readiness::waits) return Entry::waits;
  if (made != Readiness::ready) return refuse(group, Refusal::no_motion);
  const ErrorCode code = ok.error().code;
  const bool bad_number = code == ErrorCode::not_finite || code == ErrorCode::indefinite;
  return refuse(group, bad_number ? Refusal::not_finite : Refusal::refused);
}

// In the order of time, so that each is predicted from the one before. A first state may be made here whose provider
// cannot say yet how it moved to the next that the group names: then the group waits as a whole.
Readiness SlidingWindow::make_states(GraphEdit& edit, const PendingFactors::Group& group) {
  named_.clear();
  for (const PendingRef& ref : pending_.refs(group))
    if (ref.of_state) named_.push_back({ref.provider, ref.time});
  std::sort(named_.begin(), named_.end(), [](const States::Made& a, const States::Made& b) {
    return std::pair(a.time, a.provider.index) < std::pair(b.time, b.provider.index);
  });
  for (const States::Made& n : named_) {
    const Reach reach = states_.reach(n.provider, n.time);
    if (reach == Reach::not_yet) return Readiness::waits;
    if (reach == Reach::there || reach == Reach::too_old) continue;  // what is too old is for whoever takes late groups
    if (auto state = states_.request(edit, n.provider, n.time); !state) {
      report_.error = state.error();
      return Readiness::unknown_state;
    }
  }
  if (auto ok = states_.link(edit); !ok) {
    report_.error = ok.error();
    return Readiness::unknown_state;
  }
  return Readiness::ready;
}

SlidingWindow::Entry SlidingWindow::pass_hooks(const PendingFactors::Group& group) {
  for (auto& hook : hooks_) {
    GraphEdit& edit = core_.edit();
    const InsertedGroup in{group.sensor, group.newest, factors_, variables_, state_variables_};
    const InsertionHook::Verdict verdict = hook->inserted(graph(), states_, in, edit);
    const bool reset = verdict.reset && report_.reset[0] == '\0';  // once an update
    if (verdict.reject || reset) {
      edit.clear();
      report_.rejection = verdict.reject ? verdict.reason : report_.rejection;
      expel();
      if (reset) {
        Time horizon = group.has_states ? group.oldest : States::kNever;
        for (int k = 0; k < states_.providers(); ++k)
          if (const State* latest = states_.timeline({k}).latest())
            horizon = std::min(horizon, latest->time + Duration{1});
        begin_anew(verdict.reason, horizon);
      }
      return verdict.reject ? refuse(group, Refusal::rejected) : Entry::reset;
    }
    if (auto ok = follow_hook(); !ok) {
      report_.error = ok.error();
      report_.rejection = "a hook's edit was refused";
      edit.clear();
      expel();
      return refuse(group, Refusal::rejected);
    }
  }
  return Entry::entered;
}

// Applies what a hook wants, and keeps the lists of what the group has in the graph.
Result<void> SlidingWindow::follow_hook() {
  GraphEdit& edit = core_.edited();
  if (edit.empty()) return {};
  if (auto ok = core_.commit(); !ok) return ok;
  for (const auto& column : edit.variable_columns())
    for (const edit::AddedVariable& a : column->added) variables_.push_back({column->ops->key, a.key});
  for (const auto& column : edit.factor_columns())
    for (const edit::AddedFactor& a : column->added) factors_.push_back({column->ops->key, a.key});
  std::erase_if(variables_, [this](VariableKey id) { return graph().find_value(id) == nullptr; });
  std::erase_if(factors_, [this](FactorId id) { return !graph().contains(id); });
  states_.follow(graph());
  return {};
}

// The group leaves, with the states that were made for it. A provider that cannot say how its state's neighbours moved
// keeps that state.
void SlidingWindow::expel() {
  if (!expel(true)) expel(false);
}

bool SlidingWindow::expel(bool with_states) {
  GraphEdit& edit = core_.edit();
  std::erase_if(made_, [this](const States::Made& m) { return states_.timeline(m.provider).find(m.time) == nullptr; });
  for (const FactorId id : factors_) edit.remove(id);
  for (const VariableKey id : variables_) edit.remove(id);
  bool ok = true;
  for (std::size_t k = made_.size(); with_states && k-- > 0;)
    ok = ok && states_.withdraw(edit, made_[k].provider, made_[k].time).ok();
  if (ok)
    if (auto linked = states_.link(edit); !linked) report_.error = linked.error(), ok = false;
  if (ok)
    if (auto done = core_.commit(); !done) report_.error = done.error(), ok = false;
  if (ok)
    states_.commit();
  else
    edit.clear(), states_.rollback();
  return ok;
}

void SlidingWindow::rebuild_batches() {
  for (std::size_t k = 0; k < batch_builders_.size(); ++k) {
    wanted_.clear();
    batch_builders_[k]->wanted(wanted_);
    if (!make_wanted()) count(batch_sensors_[k], Refusal::no_motion);
    GraphEdit& edit = core_.edit();
    const Result<bool> changed = batch_builders_[k]->rebuild(graph(), states_, edit);
    Result<void> ok = changed ? Result<void>{} : changed.error();
    if (ok && !*changed) continue;
    if (ok) ok = core_.commit();
    if (ok) {
      ++report_.entered;
      continue;
    }
    report_.error = ok.error();
    edit.clear();
    batch_builders_[k]->refused();
    count(batch_sensors_[k], Refusal::refused);
  }
}

// The states that a batch builder wants, as far as they can be had. Each by an edit of its own, so that one that fails
// is in nobody's way.
bool SlidingWindow::make_wanted() {
  std::sort(wanted_.begin(), wanted_.end(), [](const auto& a, const auto& b) {
    return std::pair(a.second, a.first.index) < std::pair(b.second, b.first.index);
  });
  bool all = true;
  for (const auto& [provider, time] : wanted_) {
    if (!states_.has(provider) || states_.reach(provider, time) != Reach::possible) continue;
    const Result<void> ok = make_wanted(provider, time);
    if (ok) continue;
    report_.error = ok.error();
    all = false;
  }
  return all;
}

Result<void> SlidingWindow::make_wanted(ProviderId provider, Time time) {
  GraphEdit& edit = core_.edit();
  Result<void> ok;
  if (auto state = states_.request(edit, provider, time); !state) ok = state.error();
  if (ok) ok = states_.link(edit);
  if (ok) ok = core_.commit();
  if (ok) {
    states_.commit();
    ++report_.states_made;
  } else {
    edit.clear();
    states_.rollback();
  }
  return ok;
}

}  // namespace oriel
