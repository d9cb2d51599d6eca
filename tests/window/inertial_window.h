// A small stereo-inertial window over the simulated stream, without any absolute prior: turning it about the vertical
// and shifting it changes no residual.
#pragma once
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <vector>

#include "oriel/residual/imu_residual.h"
#include "oriel/residual/prior.h"
#include "oriel/residual/reprojection.h"
#include "oriel/solve/native_engine.h"
#include "oriel/testing/simulated_window.h"
#include "oriel/window/marginalize.h"

namespace oriel::inertial_window {

using Eigen::MatrixXd;

struct State {
  int keyframe = 0;
  VariableId<Pose3d> pose;
  VariableId<Velocity3d> v;
  VariableId<ImuBiasd> bias;
};

class InertialWindow {
 public:
  explicit InertialWindow(int keyframes, int landmarks = 60) : stream_(simulate_window(options(keyframes, landmarks))) {
    GraphEdit edit = graph.edit();
    rig_ = edit.add(stream_.rig);
    const SimulatedKeyframe& frame = stream_.keyframes[0];
    states.push_back({0, edit.add(frame.T_world_body), edit.add(frame.v), edit.add(frame.bias)});
    edit.add(Prior{frame.bias}, Sigma(0.01), states[0].bias);
    EXPECT_TRUE(graph.apply(edit).ok());
    landmarks_.resize(stream_.tracks.size());
    add_observations(0);
  }

  // Adds the next keyframe where the IMU expects it.
  void grow() {
    const State last = states.back();
    const int k = last.keyframe + 1;
    const SimulatedKeyframe& frame = stream_.keyframes[k];
    const ImuBiasd bias = graph.value(last.bias);
    const PredictedState next = predict_state(frame.motion.motion, graph.value(last.pose), graph.value(last.v), bias);
    GraphEdit edit = graph.edit();
    const State s{k, edit.add(next.T_world_body), edit.add(next.v), edit.add(bias)};
    edit.add(ImuResiduald{frame.motion.motion}, Covariance(frame.motion.covariance), last.pose, last.v, last.bias,
             s.pose, s.v, s.bias);
    states.push_back(s);
    EXPECT_TRUE(graph.apply(edit).ok());
    add_observations(k);
  }

  std::vector<VariableKey> oldest() const { return {states[0].pose, states[0].v, states[0].bias}; }

  // What the oldest state says goes into the prior.
  MarginalizeReport slide(const MarginalizeOptions& options, Marginalizer& marginalizer) {
    GraphEdit edit = graph.edit();
    const auto report = marginalizer.marginalize(graph, oldest(), options, edit);
    EXPECT_TRUE(report.ok());
    EXPECT_TRUE(graph.apply(edit).ok());
    states.erase(states.begin());
    return *report;
  }

  // Directions in which nothing is observed, at the linearization points of a prior: three of position, and yaw. With
  // T ⊞ [φ; ρ] = T Exp, a shift s of the world is ρ = Rᵀ s, and a turn about its vertical z is φ = Rᵀ z,
  // ρ = Rᵀ (z × t), and z × v of a velocity.
  MatrixXd gauge(std::uint32_t prior) const {
    MatrixXd N = MatrixXd::Zero(graph.priors().shape(prior).cols, 4);
    const double* estimate = graph.priors().estimates(prior);
    int at = 0;
    for (const VariableRef& ref : graph.priors().variables(prior)) {
      const VariableOps& ops = graph.pools()[ref.pool]->ops();
      const Vec3d z = {{0, 0, 1}};
      if (ops.key == kVariableOps<Pose3d>.key) {
        const Pose3d& x = *reinterpret_cast<const Pose3d*>(estimate);
        const Rot3d turned = x.R.inverse();
        put(N, at, 3, turned * z);
        put(N, at + 3, 3, turned * cross(z, x.t));
        for (int i = 0; i < 3; ++i) put(N, at + 3, i, turned * Vec3d::unit(i));
      } else if (ops.key == kVariableOps<Velocity3d>.key) {
        put(N, at, 3, cross(z, reinterpret_cast<const Velocity3d*>(estimate)->v));
      }
      at += ops.dim;
      estimate += estimate_doubles(ops);
    }
    return N;
  }

  // ‖R N‖ / (‖R‖ ‖N‖) of the only prior, column by column the worst.
  double gauge_leak() const {
    for (std::uint32_t row = 0; row < graph.priors().extent(); ++row) {
      if (!graph.priors().slots().is_live(row)) continue;
      const LinearPriorView p = graph.priors().numbers(row);
      const MatrixXd R = MatrixXd::Map(p.R, p.rows, p.cols), N = gauge(row);
      return (R * N).norm() / (R.norm() * N.norm());
    }
    return -1.0;
  }

  Graph graph;
  std::vector<State> states;  // oldest first

 private:
  static SimulatedWindowOptions options(int keyframes, int landmarks) {
    SimulatedWindowOptions o;
    o.keyframes = keyframes;
    o.window = 5;
    o.landmarks = landmarks;
    return o;
  }
  static void put(MatrixXd& N, int row, int column, const Vec3d& d) {
    for (int i = 0; i < 3; ++i) N(row + i, column) = d[i];
  }

  void add_observations(int k) {
    GraphEdit edit = graph.edit();
    for (const SimulatedObservation& o : stream_.keyframes[k].observations) {
      const SimulatedTrack& track = stream_.tracks[o.track];
      if (track.anchor < states[0].keyframe) continue;
      VariableId<InverseDepthd>& depth = landmarks_[o.track];
      if (track.anchor == k) {
        depth = edit.add(InverseDepthd{track.first_guess});
        edit.add(AnchorReprojectiond{track.bearing, o.pixel1}, Sigma(1.0), Huber(2.0), depth, rig_);
      } else {
        edit.add(StereoReprojectiond{track.bearing, o.pixel0, o.pixel1}, Sigma(1.0), Huber(2.0),
                 states[track.anchor - states[0].keyframe].pose, states.back().pose, depth, rig_);
      }
    }
    EXPECT_TRUE(graph.apply(edit).ok());
  }

  SimulatedWindow stream_;
  VariableId<StereoRigd> rig_;
  std::vector<VariableId<InverseDepthd>> landmarks_;
};

}  // namespace oriel::inertial_window
