// Timeline: states by their times (behaviours W1, W2).
#pragma once
#include <algorithm>
#include <cstddef>
#include <vector>

#include "oriel/base/time.h"

namespace oriel {

// `State` has a member `Time time`. At most one state a time: two sensors at one stamp share it. Pointers hold until
// the next insertion or removal.
template <class State>
class Timeline {
 public:
  using Iterator = typename std::vector<State>::const_iterator;

  void reserve(std::size_t states) { states_.reserve(states); }
  // False, and nothing done, where there is a state at that time already.
  bool insert(const State& state) {
    const auto at = first_not_before(state.time);
    if (at != states_.end() && at->time == state.time) return false;
    states_.insert(at, state);
    return true;
  }
  bool remove(Time time) {
    const auto at = first_not_before(time);
    if (at == states_.end() || at->time != time) return false;
    states_.erase(at);
    return true;
  }
  void clear() { states_.clear(); }
  // To change what a state says of itself, but for its time. Null where there is none.
  State* change(Time time) { return const_cast<State*>(find(time)); }

  std::size_t size() const { return states_.size(); }
  bool empty() const { return states_.empty(); }
  const State& operator[](std::size_t k) const { return states_[k]; }
  Iterator begin() const { return states_.begin(); }
  Iterator end() const { return states_.end(); }

  // Null where there is none.
  const State* oldest() const { return states_.empty() ? nullptr : &states_.front(); }
  const State* latest() const { return states_.empty() ? nullptr : &states_.back(); }
  const State* find(Time time) const {
    const State* s = at_or_after(time);
    return s != nullptr && s->time == time ? s : nullptr;
  }
  const State* at_or_before(Time time) const {
    const auto after =
        std::upper_bound(states_.begin(), states_.end(), time, [](Time t, const State& s) { return t < s.time; });
    return after == states_.begin() ? nullptr : &*(after - 1);
  }
  const State* at_or_after(Time time) const {
    const auto at =
        std::lower_bound(states_.begin(), states_.end(), time, [](const State& s, Time t) { return s.time < t; });
    return at == states_.end() ? nullptr : &*at;
  }
  // Of two that are equally far, the earlier.
  const State* closest(Time time) const {
    const State *before = at_or_before(time), *after = at_or_after(time);
    if (before == nullptr || after == nullptr) return before != nullptr ? before : after;
    return time - before->time <= after->time - time ? before : after;
  }
  // How many states, from the oldest on, are older than `time`; a state at that time is not.
  std::size_t count_before(Time time) const {
    const auto at =
        std::lower_bound(states_.begin(), states_.end(), time, [](const State& s, Time t) { return s.time < t; });
    return static_cast<std::size_t>(at - states_.begin());
  }

 private:
  auto first_not_before(Time time) {
    return std::lower_bound(states_.begin(), states_.end(), time, [](const State& s, Time t) { return s.time < t; });
  }

  std::vector<State> states_;
};

}  // namespace oriel
