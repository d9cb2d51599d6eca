// The window as a user of Oriel writes it: one graph that edits follow, one engine, one marginalizer, for ever.
#pragma once
#include <vector>

#include "benchmarks/support/window_race.h"
#include "oriel/residual/reprojection.h"
#include "oriel/solve/native_engine.h"
#include "oriel/window/marginalize.h"

namespace oriel::benchmark {

class OrielWindow {
 public:
  OrielWindow(const WindowData& data, const WindowOptions& options);

  // Before the first keyframe: a window that is fuller than any later one comes and goes, as window/rehearse.h does it
  // for InertialOdometry. What grows has grown then.
  void rehearse();
  // Adds the next keyframe, solves, and where the window is full lets the oldest one go.
  SlideReport slide();
  // Takes in the frame after the newest keyframe, solves, and takes it out again.
  SlideReport pass();
  const Summary& last_summary() const { return summary_; }
  // Newest pose, for a look at the drift.
  const Pose3d& newest_pose() const { return graph_.value(states_.back().pose); }
  const std::string& error() const { return error_; }

 private:
  struct State {
    int keyframe = 0;
    VariableId<Pose3d> pose;
    VariableId<Velocity3d> v;
    VariableId<ImuBiasd> bias;
  };
  void add_first_state();
  void add_state(int k, const PreintegratedImud& motion, const FullNoise<15>& noise);
  void add_view(const View& view);
  const State& state_of(int k) const;
  void apply(GraphEdit& edit);
  void fold_oldest();
  void remove_newest();
  void clear();
  void count(SlideReport& report) const;

  const WindowData& data_;
  WindowOptions options_;
  Graph graph_;
  NativeEngine engine_{graph_};
  Marginalizer marginalizer_;
  GraphEdit edit_{graph_}, fold_edit_{graph_};
  SolveOptions solve_options_;
  MarginalizeOptions fold_options_;
  VariableId<StereoRigd> rig_;
  std::vector<State> states_;  // oldest first
  struct Landmark {
    VariableId<InverseDepthd> id;
    bool exists = false;
  };
  std::vector<Landmark> landmarks_;  // by track
  int next_ = 0;                     // keyframe
  Summary summary_;
  std::string error_;  // of the first edit that was refused
};

}  // namespace oriel::benchmark
