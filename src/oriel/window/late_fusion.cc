#include "oriel/window/late_fusion.h"

#include <algorithm>

namespace oriel {

bool LateFusion::refuse(Reason reason) {
  ++refused_[static_cast<std::size_t>(reason)];
  return false;
}

Timeline<State>& LateFusion::left(ProviderId provider) {
  const auto at = static_cast<std::size_t>(provider.index);
  if (left_.size() <= at) left_.resize(at + 1);
  return left_[at];
}

// ---- what leaves ----

void LateFusion::before_slide(const Graph&, const States& states, std::span<const LeavingState> leaving,
                              std::span<const VariableKey>) {
  leaving_.clear();
  for (const LeavingState& l : leaving) leaving_.push_back({l.provider, *states.timeline(l.provider).find(l.time)});
}

void LateFusion::after_slide(const Graph&, const States&, bool slid) {
  if (!slid) {
    ledger_.discard();
    return;
  }
  Time newest = States::kNever;
  for (const Left& l : leaving_) {
    Timeline<State>& line = left(l.provider);
    line.remove(l.state.time);  // one that left there before, at the newest end, and was made anew
    line.insert(l.state);
    newest = std::max(newest, l.state.time);
  }
  ledger_.commit(newest);
  forget_old();
}

void LateFusion::forget_old() {
  for (Timeline<State>& line : left_)
    while (const State* oldest = line.oldest()) {
      const auto ids = oldest->all();
      if (std::any_of(ids.begin(), ids.end(), [this](VariableKey id) { return ledger_.holds(id); })) break;
      line.remove(oldest->time);
    }
}

void LateFusion::reset() {
  ledger_.clear();
  for (Timeline<State>& line : left_) line.clear();
  leaving_.clear();
}

// ---- what comes late ----

bool LateFusion::fold(WindowCore& core, States& states, const PendingFactors& pending,
                      const PendingFactors::Group& group) {
  if (group.variables > 0) return refuse(Reason::new_variables);
  made_.clear();
  GraphEdit& edit = core.edit();
  bool folded = fold_factors(core, states, pending, group, edit);
  if (folded) folded = passes(edit) && core.commit().ok();
  if (!folded) {
    edit.clear();
    ledger_.discard();
    return false;
  }
  for (const Left& l : made_) left(l.provider).insert(l.state);
  states_made_ += static_cast<std::int64_t>(made_.size());
  ledger_.commit(made_.empty() ? group.oldest : made_.front().state.time);
  forget_old();
  return true;
}

bool LateFusion::fold_factors(WindowCore& core, States& states, const PendingFactors& pending,
                              const PendingFactors::Group& group, GraphEdit& edit) {
  for (const PendingFactors::Factor& f : pending.factors(group)) {
    keys_.clear();
    for (const PendingRef& ref : pending.refs(f)) {
      const VariableKey id = find(core.graph(), states, ref);
      if (id.type == 0) return false;
      keys_.push_back(id);
    }
    const DetachedFactor late{f.ops, pending.measurement(f), pending.noise(f), f.loss, keys_};
    const LateOutcome outcome = ledger_.fold(core.graph(), late, edit);
    if (outcome == LateOutcome::live) {
      std::array<SlotKey, 16> slots;
      for (std::size_t k = 0; k < keys_.size(); ++k) slots[k] = keys_[k].key;
      f.add(edit, late.measurement, late.noise, f.loss, slots.data());
    } else if (outcome != LateOutcome::folded) {
      return false;
    }
  }
  return true;
}

// A key of type 0 where there is none, and it is counted why.
VariableKey LateFusion::find(const Graph& graph, States& states, const PendingRef& ref) {
  if (!ref.of_state) return ref.id;
  const int place = states.has(ref.provider) ? states.place_of(ref.provider, ref.id.type) : -1;
  if (place < 0) return refuse(Reason::unknown), VariableKey{};
  const State* state = states.timeline(ref.provider).find(ref.time);
  if (state == nullptr) state = left(ref.provider).find(ref.time);
  if (state == nullptr)
    for (const Left& l : made_)
      if (l.provider == ref.provider && l.state.time == ref.time) state = &l.state;
  if (state == nullptr) state = make_state(graph, states, ref.provider, ref.time);
  return state != nullptr ? state->variables[place] : VariableKey{};
}

// The nearest state on one side, be it in the window, left, or made for this group.
const State* LateFusion::neighbour(const States& states, ProviderId provider, Time time, bool before) const {
  const State* best = nullptr;
  const auto offer = [&](const State* s) {
    if (s != nullptr && (best == nullptr || (before ? s->time > best->time : s->time < best->time))) best = s;
  };
  const auto at = static_cast<std::size_t>(provider.index);
  for (const Timeline<State>* line :
       {&states.timeline(provider), at < left_.size() ? &left_[at] : &states.timeline(provider)})
    offer(before ? line->at_or_before(time) : line->at_or_after(time));
  for (const Left& l : made_)
    if (l.provider == provider && (l.state.time < time) == before) offer(&l.state);
  return best;
}

// A state at a time that never had one, in the ledger: p(s | a, b) of its neighbours, from the halves of the motion.
const State* LateFusion::make_state(const Graph& graph, States& states, ProviderId provider, Time time) {
  const State *a = neighbour(states, provider, time, true), *b = neighbour(states, provider, time, false);
  if (a == nullptr || b == nullptr) return refuse(Reason::no_neighbours), nullptr;
  StateProvider& motion = states.provider(provider);
  if (!motion.covers(a->time, time) || !motion.covers(time, b->time)) return refuse(Reason::no_motion), nullptr;
  true_ids_.clear();
  GraphEdit sketch = sketch_.edit();
  State from, to, made;
  if (!copy(graph, *a, motion, sketch, from) || !copy(graph, *b, motion, sketch, to)) return nullptr;
  made.time = time;
  if (!motion.predict(sketch, from, made) || !motion.link(sketch, from, made) || !motion.link(sketch, made, to))
    return refuse(Reason::no_motion), nullptr;
  new_variables_.clear();
  State lent = made;
  for (int k = 0; k < made.count; ++k) {
    const VariableOps* ops = motion.variables()[static_cast<std::size_t>(k)];
    lent.variables[k] = {ops->key, ledger_.lend<Pose3d>().key};
    true_ids_.emplace_back(made.variables[k], lent.variables[k]);
    const edit::Variables* column = sketch.find_variables(ops->key);
    new_variables_.push_back({lent.variables[k], ops, column->values.at(column->find_added(made.variables[k].key))});
  }
  take_halves(sketch);
  if (ledger_.add_state(graph, new_variables_, halves_) != LateOutcome::folded) return nullptr;
  lent.motion = {};
  made_.push_back({provider, lent});
  return &made_.back().state;
}

// The factors that the provider put into the sketch, on the variables that they are about.
void LateFusion::take_halves(const GraphEdit& sketch) {
  halves_.clear();
  half_ids_.clear();
  for_each_added_factor(sketch, [this](const DetachedFactor& f) {
    auto& ids = half_ids_.emplace_back();
    for (std::size_t k = 0; k < f.variables.size(); ++k) ids[k] = true_id(f.variables[k]);
    halves_.push_back({f.ops, f.measurement, f.noise, f.loss, {}});
  });
  for (std::size_t i = 0; i < halves_.size(); ++i)
    halves_[i].variables = {half_ids_[i].data(), halves_[i].ops->variables.size()};
}

// A state with the values where the window, or the ledger, puts it now.
bool LateFusion::copy(const Graph& graph, const State& from, StateProvider& provider, GraphEdit& sketch, State& to) {
  to.time = from.time;
  to.count = from.count;
  for (int k = 0; k < from.count; ++k) {
    const VariableOps* ops = provider.variables()[static_cast<std::size_t>(k)];
    value_.assign(estimate_doubles(*ops), 0.0);
    const void* live = graph.find_value(from.variables[k]);
    if (live == nullptr && !ledger_.smoothed(graph, from.variables[k], value_.data()))
      return refuse(Reason::no_neighbours);
    const SlotKey key = sketch_.lend(ops);
    edit::Variables& column = sketch.variables(ops);
    const void* value = live != nullptr ? live : value_.data();
    column.add({key, 0, sketch.next_order()}, value, value);
    to.variables[k] = {ops->key, key};
    true_ids_.emplace_back(to.variables[k], from.variables[k]);
  }
  return true;
}

VariableKey LateFusion::true_id(VariableKey sketched) const {
  for (const auto& [in_sketch, id] : true_ids_)
    if (in_sketch == sketched) return id;
  return sketched;
}

}  // namespace oriel
