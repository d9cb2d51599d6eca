#include "oriel/window/pending_factors.h"

#include <algorithm>

namespace oriel {
namespace {

constexpr std::size_t kAlignment = 16;

template <class T>
void move_down(std::vector<T>& v, std::size_t from, std::size_t to, std::size_t n) {
  if (from != to) std::copy(v.begin() + from, v.begin() + from + n, v.begin() + to);
}

}  // namespace

int PendingFactors::sensor(std::string_view name) {
  const auto at = std::find(sensors_.begin(), sensors_.end(), name);
  if (at != sensors_.end()) return static_cast<int>(at - sensors_.begin());
  sensors_.emplace_back(name);
  return sensors() - 1;
}

std::uint64_t PendingFactors::begin(int sensor) {
  check(!open_, "PendingFactors::begin: the group before has no end()");
  check(sensor >= 0 && sensor < sensors(), "PendingFactors::begin: no such sensor; sensor(name) gives its number");
  open_ = true;
  Group g;
  g.sensor = sensor;
  g.owner = owner_;
  g.number = ++number_;
  g.first_factor = static_cast<std::uint32_t>(factors_.size());
  g.first_variable = static_cast<std::uint32_t>(variables_.size());
  g.first_ref = static_cast<std::uint32_t>(refs_.size());
  g.first_byte = bytes_.size();
  groups_.push_back(g);
  return g.number;
}

std::size_t PendingFactors::store(const void* data, std::size_t bytes) {
  const std::size_t at = bytes_.size();
  bytes_.resize(at + (bytes + kAlignment - 1) / kAlignment * kAlignment);
  std::memcpy(bytes_.data() + at, data, bytes);
  return at;
}

VariableKey PendingFactors::add_variable(VariableKey (*adder)(GraphEdit&, const void*), std::uint64_t type,
                                         const void* value, std::size_t bytes) {
  check(open_, "PendingFactors::add: outside of begin() and end()");
  variables_.push_back({adder, store(value, bytes)});
  return {type, placeholder_key(groups_.back().variables++)};
}

void PendingFactors::add_factor(const Factor& factor, const void* measurement, const void* noise,
                                std::span<const PendingRef> refs) {
  Factor& f = factors_.emplace_back(factor);
  f.measurement = store(measurement, f.ops->measurement_bytes);
  f.noise = store(noise, f.ops->noise_bytes);
  f.first_ref = static_cast<std::uint32_t>(refs_.size());
  for (const PendingRef& ref : refs) add_ref(ref);
  ++groups_.back().factors;
}

void PendingFactors::add_ref(const PendingRef& ref) {
  check(open_, "PendingFactors::add: outside of begin() and end()");
  refs_.push_back(ref);
  if (!ref.of_state) return;
  Group& g = groups_.back();
  g.oldest = g.has_states ? std::min(g.oldest, ref.time) : ref.time;
  g.newest = g.has_states ? std::max(g.newest, ref.time) : ref.time;
  g.has_states = true;
}

void PendingFactors::end() {
  check(open_, "PendingFactors::end: there was no begin()");
  open_ = false;
  Group& g = groups_.back();
  g.refs = static_cast<std::uint32_t>(refs_.size()) - g.first_ref;
  g.bytes = bytes_.size() - g.first_byte;
}

Readiness PendingFactors::readiness(const Group& group, const PendingRef& ref, const Graph& graph,
                                    const States& states) const {
  if (!ref.of_state) {
    const bool known = is_placeholder(ref.id.key) ? placeholder_number(ref.id.key) < group.variables
                                                  : graph.find_value(ref.id) != nullptr;
    return known ? Readiness::ready : Readiness::unknown_id;
  }
  if (!states.has(ref.provider) || states.place_of(ref.provider, ref.id.type) < 0) return Readiness::unknown_state;
  switch (states.reach(ref.provider, ref.time)) {
    case Reach::too_old:
      return Readiness::too_old;
    case Reach::not_yet:
      return Readiness::waits;
    default:
      return Readiness::ready;
  }
}

// What refuses the group comes before what makes it wait.
Readiness PendingFactors::readiness(const Group& group, const Graph& graph, const States& states) const {
  Readiness all = Readiness::ready;
  for (std::uint32_t k = 0; k < group.refs; ++k)
    all = std::max(all, readiness(group, refs_[group.first_ref + k], graph, states));
  return all;
}

void PendingFactors::insert(const Group& group, const States& states, GraphEdit& edit,
                            std::vector<VariableKey>& variables, std::vector<FactorId>& factors) {
  entered_.clear();
  for (std::uint32_t k = 0; k < group.variables; ++k) {
    const NewVariable& v = variables_[group.first_variable + k];
    entered_.push_back(v.add(edit, bytes_.data() + v.value));
    variables.push_back(entered_.back());
  }
  for (const Factor& f : this->factors(group)) {
    SlotKey keys[16];
    for (std::size_t k = 0; k < f.ops->variables.size(); ++k) {
      const PendingRef& ref = refs_[f.first_ref + k];
      keys[k] = ref.of_state                 ? states.find(ref.provider, ref.time, ref.id.type).key
                : is_placeholder(ref.id.key) ? entered_[placeholder_number(ref.id.key)].key
                                             : ref.id.key;
    }
    factors.push_back(f.add(edit, measurement(f), noise(f), f.loss, keys));
  }
}

void PendingFactors::compact() {
  check(!open_, "PendingFactors::compact: a group has no end()");
  Group to;  // where the next live group goes
  std::size_t place = 0;
  for (const Group& from : groups_) {
    if (!from.live) continue;
    Group g = from;
    g.first_factor = to.first_factor, g.first_variable = to.first_variable, g.first_ref = to.first_ref;
    g.first_byte = to.first_byte;
    move_down(factors_, from.first_factor, g.first_factor, g.factors);
    move_down(variables_, from.first_variable, g.first_variable, g.variables);
    move_down(refs_, from.first_ref, g.first_ref, g.refs);
    move_down(bytes_, from.first_byte, g.first_byte, g.bytes);
    for (std::uint32_t k = 0; k < g.factors; ++k) {
      Factor& f = factors_[g.first_factor + k];
      f.first_ref -= from.first_ref - g.first_ref;
      f.measurement -= from.first_byte - g.first_byte;
      f.noise -= from.first_byte - g.first_byte;
    }
    for (std::uint32_t k = 0; k < g.variables; ++k)
      variables_[g.first_variable + k].value -= from.first_byte - g.first_byte;
    to.first_factor += g.factors, to.first_variable += g.variables, to.first_ref += g.refs;
    to.first_byte += g.bytes;
    groups_[place++] = g;
  }
  groups_.resize(place);
  factors_.resize(to.first_factor);
  variables_.resize(to.first_variable);
  refs_.erase(refs_.begin() + to.first_ref, refs_.end());
  bytes_.resize(to.first_byte);
}

void PendingFactors::clear() {
  for (Group& g : groups_) g.live = false;
  compact();
}

std::size_t PendingFactors::size() const {
  return static_cast<std::size_t>(std::count_if(groups_.begin(), groups_.end(), [](const Group& g) { return g.live; }));
}

}  // namespace oriel
