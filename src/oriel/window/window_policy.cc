#include "oriel/window/window_policy.h"

#include <algorithm>
#include <string>

namespace oriel {
namespace {

constexpr Time kFirst{std::numeric_limits<std::int64_t>::min()}, kLast{std::numeric_limits<std::int64_t>::max()};

// Where a provider's own lag wants the window to begin.
Time wanted(const Timeline<State>& line, const Lag& lag) {
  Time start = kFirst;
  const std::size_t most = static_cast<std::size_t>(lag.max_states);
  if (line.size() > most) start = line[line.size() - most].time;
  if (lag.duration.ns > 0) start = std::max(start, line.latest()->time - lag.duration);
  return start;
}

// The latest start that a provider bears: its least states stay, and so do those that no solve has seen.
Time bearable(const Timeline<State>& line, const Lag& lag) {
  const std::size_t least = static_cast<std::size_t>(lag.min_states);
  Time start = line[line.size() > least ? line.size() - least : 0].time;
  for (const State& s : line)
    if (!s.solved) return std::min(start, s.time);
  return start;
}

}  // namespace

Result<void> LagPolicy::feasible(const Lag& lag) {
  if (lag.min_states < 1)
    return Error{ErrorCode::bad_input,
                 "a window keeps at least one state, not min_states = " + std::to_string(lag.min_states)};
  if (lag.max_states < lag.min_states)
    return Error{ErrorCode::bad_input, "max_states = " + std::to_string(lag.max_states) +
                                           " is less than min_states = " + std::to_string(lag.min_states)};
  if (lag.duration.ns < 0)
    return Error{ErrorCode::bad_input, "a window's duration of " + std::to_string(lag.duration.ns) + " ns is negative"};
  return {};
}

Result<void> LagPolicy::set(const Lag& all) {
  if (auto ok = feasible(all); !ok) return ok;
  all_ = all;
  return {};
}

Result<void> LagPolicy::set(ProviderId provider, const Lag& lag) {
  if (auto ok = feasible(lag); !ok) return ok;
  std::erase_if(own_, [&](const Own& o) { return o.provider == provider; });
  own_.push_back({provider, lag});
  return {};
}

const Lag& LagPolicy::lag(ProviderId provider) const {
  for (const Own& o : own_)
    if (o.provider == provider) return o.lag;
  return all_;
}

Time LagPolicy::start(const States& states) const {
  Time start = kFirst, bound = kLast, last_solved = kFirst;
  for (int k = 0; k < states.providers(); ++k) {
    const Timeline<State>& line = states.timeline({k});
    if (line.empty()) continue;
    start = std::max(start, wanted(line, lag({k})));
    bound = std::min(bound, bearable(line, lag({k})));
    for (const State& s : line)
      if (s.solved) last_solved = std::max(last_solved, s.time);
  }
  return std::min({start, bound, last_solved});
}

void LagPolicy::choose(const Graph&, const States& states, std::vector<LeavingState>& leaving) {
  const Time before = start(states);
  for (int k = 0; k < states.providers(); ++k)
    for (const State& s : states.timeline({k})) {
      if (s.time >= before) break;
      leaving.push_back({{k}, s.time, LeavingState::How::marginalize});
    }
}

}  // namespace oriel
