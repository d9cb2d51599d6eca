// PoseRecorder: the poses that a sliding window says, at once and in the end.
#pragma once
#include <algorithm>

#include "oriel/window/trajectory.h"
#include "oriel/window/window_update.h"

namespace oriel {

// Of a provider whose states have a Pose3d.
class PoseRecorder final : public WindowListener {
 public:
  explicit PoseRecorder(ProviderId provider) : provider_(provider) {}

  // The newest state that was solved after each update, as it was known then.
  const Trajectory& causal() const { return causal_; }
  // Each state as it was when it left, or as it is now; in the order of time.
  Trajectory final(const Graph& graph, const States& states) const {
    Trajectory all;
    for (const StampedPose& p : left_) all.add(p.time, p.T_world_body);
    for (const State& s : states.timeline(provider_))
      if (const Pose3d* pose = pose_of(graph, states, s)) all.add(s.time, *pose);
    return all;
  }
  // States that may leave without asking for memory.
  void reserve(std::size_t states) {
    causal_.reserve(states);
    left_.reserve(states);
  }

  void leaving(const Graph& graph, const States& states, ProviderId provider, const State& state) override {
    const Pose3d* pose = pose_of(graph, states, state);
    if (!(provider == provider_) || pose == nullptr) return;
    const auto at = std::lower_bound(left_.begin(), left_.end(), state.time,
                                     [](const StampedPose& p, Time t) { return p.time < t; });
    if (at != left_.end() && at->time == state.time)  // it was said to leave before, and the slide failed
      at->T_world_body = *pose;
    else
      left_.insert(at, {state.time, *pose});
  }
  void updated(const Graph& graph, const States& states, const WindowUpdate& update) override {
    const Timeline<State>& all = states.timeline(provider_);
    const State* newest = nullptr;
    for (std::size_t k = all.size(); k-- > 0 && newest == nullptr;)
      if (all[k].solved) newest = &all[k];
    const bool solved =
        update.status == WindowUpdate::Status::updated || update.status == WindowUpdate::Status::slide_failed;
    if (!solved || newest == nullptr) return;
    if (const Pose3d* pose = pose_of(graph, states, *newest)) causal_.add(newest->time, *pose);
  }

 private:
  const Pose3d* pose_of(const Graph& graph, const States& states, const State& state) const {
    const int place = states.place_of(provider_, kVariableOps<Pose3d>.key);
    return place < 0 ? nullptr : graph.find(VariableId<Pose3d>{state.variables[place].key});
  }

  ProviderId provider_;
  Trajectory causal_;
  std::vector<StampedPose> left_;  // in the order of time
};

}  // namespace oriel
