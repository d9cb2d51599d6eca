// Ten keyframes of a stereo-inertial stream, which enter one by one and leave into a prior.
#pragma once
#include <gtest/gtest.h>

#include <vector>

#include "oriel/graph/graph.h"
#include "oriel/residual/imu_residual.h"
#include "oriel/residual/prior.h"
#include "oriel/residual/reprojection.h"
#include "oriel/testing/simulated_window.h"
#include "oriel/window/marginalize.h"

namespace oriel {

inline void expect_applied(Graph& graph, GraphEdit& edit) {
  const auto ok = graph.apply(edit);
  ASSERT_TRUE(ok) << ok.error();
}

// A stereo-inertial window of some keyframes whose oldest ones were marginalized.
class WindowOfTen {
 public:
  WindowOfTen() : stream_(simulate_window(options())) {}

  static SimulatedWindowOptions options() {
    SimulatedWindowOptions o;
    o.keyframes = 10, o.window = 6, o.landmarks = 60;
    return o;
  }
  void slide(int k) {
    GraphEdit edit = graph.edit();
    if (k == 0) rig_ = edit.add(stream_.rig);
    add_state(edit, k);
    for (const SimulatedObservation& o : stream_.keyframes[k].observations) add_observation(edit, o, k);
    expect_applied(graph, edit);
  }
  void marginalize_oldest() {
    const State s = states_[oldest_++];
    const VariableKey leaving[] = {s.pose, s.v, s.bias};
    GraphEdit edit = graph.edit();
    const auto report = marginalizer_.marginalize(graph, leaving, {}, edit);
    ASSERT_TRUE(report) << report.error();
    expect_applied(graph, edit);
  }
  VariableKey pose(int k) const { return states_[static_cast<std::size_t>(k)].pose; }
  VariableKey velocity(int k) const { return states_[static_cast<std::size_t>(k)].v; }
  VariableKey bias(int k) const { return states_[static_cast<std::size_t>(k)].bias; }
  Graph graph;

 private:
  struct State {
    VariableId<Pose3d> pose;
    VariableId<Velocity3d> v;
    VariableId<ImuBiasd> bias;
  };
  void add_state(GraphEdit& edit, int k) {
    const SimulatedKeyframe& frame = stream_.keyframes[k];
    const Vec6d off = {{0.01, -0.01, 0.02, 0.05, 0.02, -0.03}};
    const State s{edit.add(frame.T_world_body.plus(k == 0 ? Vec6d::zero() : off)), edit.add(frame.v),
                  edit.add(frame.bias)};
    states_.push_back(s);
    if (k == 0) {
      edit.add(Prior<Pose3d>{frame.T_world_body}, Sigma(1e-3), s.pose);
      edit.add(Prior<Velocity3d>{frame.v}, Sigma(1e-2), s.v);
      edit.add(Prior<ImuBiasd>{frame.bias}, Sigma(1e-2), s.bias);
    } else {
      const State& last = states_[k - 1];
      edit.add(ImuResiduald{frame.motion.motion}, imu_noise(frame.motion), last.pose, last.v, last.bias, s.pose, s.v,
               s.bias);
    }
  }
  void add_observation(GraphEdit& edit, const SimulatedObservation& o, int k) {
    const SimulatedTrack& track = stream_.tracks[o.track];
    if (track.anchor == k) {
      if (std::ssize(depths_) <= o.track) depths_.resize(o.track + 1);
      depths_[o.track] = edit.add(InverseDepthd{track.first_guess});
      edit.add(AnchorReprojectiond{track.bearing, o.pixel1}, Sigma(1.0), Huber(2.0), depths_[o.track], rig_);
    } else {
      edit.add(StereoReprojectiond{track.bearing, o.pixel0, o.pixel1}, Sigma(1.0), Cauchy(3.0),
               states_[track.anchor].pose, states_[k].pose, depths_[o.track], rig_);
    }
  }

  SimulatedWindow stream_;
  VariableId<StereoRigd> rig_;
  std::vector<State> states_;
  std::vector<VariableId<InverseDepthd>> depths_;
  std::size_t oldest_ = 0;
  Marginalizer marginalizer_;
};

}  // namespace oriel
