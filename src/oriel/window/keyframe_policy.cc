#include "oriel/window/keyframe_policy.h"

#include <algorithm>
#include <string>

namespace oriel {

bool is_keyframe(const KeyframeRules& rules, const FrameOverlap& overlap, Duration since) {
  if (since >= rules.interval) return true;
  if (overlap.tracks == 0) return false;  // it sees nothing that it could be a key to
  if (overlap.shared < rules.least_shared * overlap.tracks) return true;
  return overlap.shared > 0 && overlap.parallax >= rules.parallax;
}

KeyframePolicy::KeyframePolicy(ProviderId provider, Overlap overlap, const KeyframeRules& rules)
    : provider_(provider), overlap_(std::move(overlap)) {
  check(set(rules).ok(), "KeyframePolicy: rules that cannot be kept (KeyframePolicy::feasible says why)");
}

Result<void> KeyframePolicy::feasible(const KeyframeRules& rules) {
  const auto refuse = [](const std::string& what) { return Error{ErrorCode::bad_input, what}; };
  if (rules.max_keyframes < 1)
    return refuse("a window keeps at least one keyframe, not max_keyframes = " + std::to_string(rules.max_keyframes));
  if (rules.lag < 0) return refuse("lag = " + std::to_string(rules.lag) + " is negative");
  if (rules.interval.ns < 0) return refuse("an interval of " + std::to_string(rules.interval.ns) + " ns is negative");
  if (!(rules.parallax >= 0.0)) return refuse("parallax = " + std::to_string(rules.parallax) + " is not an angle");
  if (!(rules.least_shared >= 0.0 && rules.least_shared <= 1.0))
    return refuse("least_shared = " + std::to_string(rules.least_shared) + " is not a share");
  return {};
}

Result<void> KeyframePolicy::set(const KeyframeRules& rules) {
  if (auto ok = feasible(rules); !ok) return ok;
  rules_ = rules;
  return {};
}

bool KeyframePolicy::is_keyframe(Time time) const {
  return std::binary_search(keyframes_.begin(), keyframes_.end(), time);
}

// Each state once, when a solve has seen it. A state that came late, between two that were judged, is no keyframe.
void KeyframePolicy::judge(const Graph& graph, const States& states) {
  const Timeline<State>& line = states.timeline(provider_);
  std::erase_if(keyframes_, [&](Time t) { return line.find(t) == nullptr; });
  for (const State& s : line) {
    if (s.time <= judged_ || !s.solved) continue;
    judged_ = s.time;
    if (keyframes_.empty()) {
      keyframes_.push_back(s.time);
      continue;
    }
    const FrameOverlap seen = overlap_ ? overlap_(graph, states, keyframes_.back(), s.time) : FrameOverlap{};
    if (oriel::is_keyframe(rules_, seen, s.time - keyframes_.back())) keyframes_.push_back(s.time);
  }
}

void KeyframePolicy::choose(const Graph& graph, const States& states, std::vector<LeavingState>& leaving) {
  judge(graph, states);
  const Timeline<State>& line = states.timeline(provider_);
  choose_others(line, leaving);
  const std::size_t most = static_cast<std::size_t>(rules_.max_keyframes);
  if (keyframes_.size() <= most) return;
  const Time start = keyframes_[keyframes_.size() - most];  // what is older leaves
  for (int k = 0; k < states.providers(); ++k)
    for (const State& s : states.timeline({k})) {
      if (s.time >= start) break;
      const bool chosen = std::any_of(leaving.begin(), leaving.end(), [&](const LeavingState& l) {
        return l.provider == ProviderId{k} && l.time == s.time;
      });
      if (!chosen) leaving.push_back({{k}, s.time, LeavingState::How::marginalize});
    }
}

void KeyframePolicy::choose_others(const Timeline<State>& line, std::vector<LeavingState>& leaving) const {
  if (rules_.others == KeyframeRules::Others::keep) return;
  const std::size_t stay = rules_.others == KeyframeRules::Others::lag ? static_cast<std::size_t>(rules_.lag) + 1 : 1;
  for (std::size_t k = 0; k + stay < line.size(); ++k)
    if (line[k].solved && !is_keyframe(line[k].time))
      leaving.push_back({provider_, line[k].time, LeavingState::How::remove});
}

void KeyframePolicy::reset() {
  keyframes_.clear();
  judged_ = States::kNever;
}

}  // namespace oriel
