// KeyframePolicy: the window holds keyframes, chosen by parallax, by how few tracks are still shared, and by time;
// other states stay, stay for a while, or give way to the next one.
#pragma once
#include <vector>

#include "oriel/base/function.h"
#include "oriel/window/track_geometry.h"
#include "oriel/window/window_policy.h"

namespace oriel {

struct KeyframeRules {
  double parallax = 0.05;            // median angle by which shared tracks moved since the last keyframe [rad]
  double least_shared = 0.6;         // share of the state's tracks that the last keyframe saw [-]
  Duration interval{1'000'000'000};  // since the last keyframe [ns]
  int max_keyframes = 12;            // the oldest is marginalized when there are more
  enum class Others {
    drop,  // removed when the next state comes: one motion factor takes the place of two
    lag,   // removed when there are more than `lag` newer states
    keep,  // marginalized with the keyframe before them
  };
  Others others = Others::drop;
  int lag = 3;
};

// Is a state a keyframe that is `since` later than the last one?
bool is_keyframe(const KeyframeRules& rules, const FrameOverlap& overlap, Duration since);

class KeyframePolicy final : public WindowPolicy {
 public:
  // How two states see the same tracks: TrackBuilder::overlap.
  using Overlap = Function<FrameOverlap(const Graph&, const States&, Time earlier, Time later)>;

  // Of one provider's states; those of others leave when they are older than the oldest keyframe.
  // Rules that cannot be kept are a bug of the caller's; `feasible` tells those that come from elsewhere.
  KeyframePolicy(ProviderId provider, Overlap overlap, const KeyframeRules& rules = {});
  // Refused: no keyframe at all, a negative or missing number, a share beyond 1.
  static Result<void> feasible(const KeyframeRules& rules);
  Result<void> set(const KeyframeRules& rules);  // refused: nothing is changed

  void choose(const Graph& graph, const States& states, std::vector<LeavingState>& leaving) override;
  void reset() override;
  bool is_keyframe(Time time) const;
  const std::vector<Time>& keyframes() const { return keyframes_; }  // in the window, by time

 private:
  void judge(const Graph& graph, const States& states);
  void choose_others(const Timeline<State>& line, std::vector<LeavingState>& leaving) const;

  ProviderId provider_;
  Overlap overlap_;
  KeyframeRules rules_;
  std::vector<Time> keyframes_;
  Time judged_ = States::kNever;  // states up to here have been judged
};

}  // namespace oriel
