#include "oriel/window/states.h"

#include <string>

namespace oriel {

ProviderId States::add(std::unique_ptr<StateProvider> provider) {
  Chain& chain = chains_.emplace_back();
  chain.provider = std::move(provider);
  return {providers() - 1};
}

int States::find_provider(std::string_view name) const {
  for (int k = 0; k < providers(); ++k)
    if (chains_[k].provider->name() == name) return k;
  return -1;
}

int States::place_of(ProviderId id, std::uint64_t type) const {
  const auto variables = chains_[id.index].provider->variables();
  for (std::size_t k = 0; k < variables.size(); ++k)
    if (variables[k]->key == type) return static_cast<int>(k);
  return -1;
}

VariableKey States::find(ProviderId id, Time time, std::uint64_t type) const {
  const State* state = timeline(id).find(time);
  const int place = place_of(id, type);
  return state == nullptr || place < 0 || place >= state->count ? VariableKey{type, {}} : state->variables[place];
}

Reach States::reach(ProviderId id, Time time) const {
  const Chain& chain = chains_[id.index];
  const Timeline<State>& line = chain.timeline;
  if (line.find(time) != nullptr) return Reach::there;
  if (time < chain.horizon) return Reach::too_old;
  if (line.empty()) return chain.provider->can_begin(time) ? Reach::possible : Reach::not_yet;
  const State *before = line.at_or_before(time), *after = line.at_or_after(time);
  if (before == nullptr) return Reach::not_yet;
  if (after != nullptr && after->severed) return Reach::too_old;
  const bool covered =
      chain.provider->covers(before->time, time) && (after == nullptr || chain.provider->covers(time, after->time));
  return covered ? Reach::possible : Reach::not_yet;
}

void States::unlink(GraphEdit& edit, int chain, State& state) {
  staged_.push_back({Staged::Kind::changed, chain, state});
  if (state.has_motion()) edit.remove(state.motion);
  state.motion = {};
  gaps_.push_back({chain, state.time});
}

void States::insert(int chain, const State& state) {
  chains_[chain].timeline.insert(state);
  staged_.push_back({Staged::Kind::made, chain, state});
  gaps_.push_back({chain, state.time});
  new_variables_.insert(new_variables_.end(), state.variables, state.variables + state.count);
  new_states_.push_back({{chain}, state.time});
}

Result<State> States::request(GraphEdit& edit, ProviderId id, Time time) {
  Chain& chain = chains_[id.index];
  if (const State* there = chain.timeline.find(time)) return *there;
  if (reach(id, time) != Reach::possible)
    return Error{ErrorCode::bad_input, "there can be no state of '" + std::string(chain.provider->name()) + "' at " +
                                           std::to_string(time.ns) + " ns: its measurements do not reach there"};
  State state;
  state.time = time;
  const State* before = chain.timeline.at_or_before(time);
  if (auto ok = before == nullptr ? chain.provider->begin(edit, state) : chain.provider->predict(edit, *before, state);
      !ok)
    return ok.error();
  check(state.count >= 1 && state.count <= State::kMostVariables, "a state has between one and six variables");
  if (const State* after = chain.timeline.at_or_after(time))
    unlink(edit, id.index, *chain.timeline.change(after->time));
  insert(id.index, state);
  return state;
}

Result<void> States::withdraw(GraphEdit& edit, ProviderId id, Time time) {
  Chain& chain = chains_[id.index];
  const State* there = chain.timeline.find(time);
  if (there == nullptr)
    return Error{ErrorCode::not_found, "there is no state of '" + std::string(chain.provider->name()) + "' at " +
                                           std::to_string(time.ns) + " ns to be withdrawn"};
  const State state = *there;
  for (const VariableKey id_of : state.all()) edit.remove(id_of);  // the motion factors at it go with them
  chain.timeline.remove(time);
  staged_.push_back({Staged::Kind::withdrawn, id.index, state});
  const State* after = chain.timeline.at_or_after(time);
  if (after == nullptr) return {};
  State& next = *chain.timeline.change(after->time);
  staged_.push_back({Staged::Kind::changed, id.index, next});
  next.motion = {};
  next.severed = next.severed || state.severed;
  gaps_.push_back({id.index, next.time});
  return {};
}

Result<void> States::link(GraphEdit& edit) {
  for (const Gap& gap : gaps_) {
    Chain& chain = chains_[gap.chain];
    State* state = chain.timeline.change(gap.time);
    if (state == nullptr || state->severed || state->has_motion()) continue;  // withdrawn since, or named twice
    const State* before = chain.timeline.at_or_before(gap.time - Duration{1});
    if (before == nullptr) continue;
    const Result<FactorId> motion = chain.provider->link(edit, *before, *state);
    if (!motion) return motion.error();
    state->motion = *motion;
  }
  gaps_.clear();
  return {};
}

void States::commit() {
  staged_.clear();
  gaps_.clear();
  new_variables_.clear();
  new_states_.clear();
}

void States::rollback() {
  for (std::size_t k = staged_.size(); k-- > 0;) {
    const Staged& s = staged_[k];
    Timeline<State>& line = chains_[s.chain].timeline;
    if (s.kind == Staged::Kind::made)
      line.remove(s.before.time);
    else if (s.kind == Staged::Kind::withdrawn)
      line.insert(s.before);
    else
      *line.change(s.before.time) = s.before;
  }
  commit();
}

void States::forget(ProviderId id, Time time) {
  Chain& chain = chains_[id.index];
  if (!chain.timeline.remove(time)) return;
  if (const State* after = chain.timeline.at_or_after(time)) {
    State& next = *chain.timeline.change(after->time);
    next.motion = {};
    next.severed = true;
  }
  if (chain.timeline.at_or_before(time) == nullptr) raise_horizon(id, time);
}

void States::raise_horizon(ProviderId id, Time left) {
  Chain& chain = chains_[id.index];
  const State* oldest = chain.timeline.oldest();
  const Time horizon = oldest != nullptr ? oldest->time : left + Duration{1};
  if (horizon <= chain.horizon) return;
  chain.horizon = horizon;
  chain.provider->forget_before(horizon - memory_);
}

void States::mark_solved() {
  for (Chain& chain : chains_)
    for (std::size_t k = 0; k < chain.timeline.size(); ++k)
      chain.timeline.change(chain.timeline[k].time)->solved = true;
}

void States::follow(const Graph& graph) {
  for (int k = 0; k < providers(); ++k) {
    Timeline<State>& line = chains_[k].timeline;
    for (std::size_t i = line.size(); i-- > 0;) {
      State& state = *line.change(line[i].time);
      bool whole = true;
      for (const VariableKey id : state.all()) whole = whole && graph.find_value(id) != nullptr;
      if (!whole) {
        forget({k}, state.time);
      } else if (state.has_motion() && !graph.contains(state.motion)) {
        state.motion = {};
        state.severed = true;
      }
    }
  }
}

void States::clear(Time horizon) {
  for (Chain& chain : chains_) {
    chain.timeline.clear();
    chain.horizon = horizon;
  }
  commit();
}

}  // namespace oriel
