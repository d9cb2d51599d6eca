// A robot walks around a square, adds up its steps, and hears its distance to one beacon. The residual of that distance
// is the user's own plain struct; dual numbers give its Jacobian.
#include <cmath>
#include <iostream>
#include <utility>
#include <vector>

#include "oriel/graph/graph.h"
#include "oriel/manifold/se3.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/solve/native_engine.h"

using namespace oriel;

struct BeaconRange {  // what was measured; trivially copyable, no ids
  static constexpr std::string_view kName = "example.beacon_range/1";
  using Variables = Types<Pose3d>;
  Vec3d p_world_beacon;  // [m]
  double range;          // [m]
  template <class S>
  S operator()(const Pose3<S>& T_world_body) const {
    return (T_world_body.translation() - p_world_beacon).norm() - range;
  }
};

struct Stride {
  Pose3d T_prev_body;    // measured, with an error
  double range;          // [m] to the beacon, with another
  Pose3d T_world_truth;  // only to tell how good the estimate is
};

const Vec3d kBeacon = {{4, 0, 1}};

// Forty strides of 0.4 m, a quarter turn after each ten. Every stride is believed 3 % longer and 0.01 rad straighter.
std::vector<Stride> walk() {
  std::vector<Stride> strides;
  Pose3d T_world_body;
  for (int i = 1; i <= 40; ++i) {
    const double turn = i % 10 == 0 ? M_PI / 2 : 0.0;  // [rad] about z
    T_world_body = T_world_body.plus({{0, 0, turn, 0.4, 0, 0}});
    const double range = (T_world_body.translation() - kBeacon).norm() + 0.02 * std::sin(7.0 * i);
    strides.push_back({Pose3d::exp({{0, 0, turn - 0.01, 0.412, 0, 0}}), range, T_world_body});
  }
  return strides;
}

int main() {
  Graph graph;
  GraphEdit edit = graph.edit();  // lends ids; the graph is unchanged until apply
  VariableId<Pose3d> x = edit.add(Pose3d{}, Label("start"));
  edit.add(Prior{Pose3d{}}, Sigma(0.01), x);
  const std::vector<Stride> strides = walk();
  for (const auto& [T_prev_body, range, T_world_truth] : strides) {
    const auto x_prev = std::exchange(x, edit.add(edit.value(x) * T_prev_body));
    edit.add(Between{T_prev_body}, Sigma(0.05), x_prev, x);
    edit.add(BeaconRange{kBeacon, range}, Sigma(0.1), Huber(1.345), x);
  }
  if (auto ok = graph.apply(edit); !ok) {
    std::cerr << ok.error() << '\n';
    return 1;
  }

  const auto error = [&] { return (graph.value(x).translation() - strides.back().T_world_truth.translation()).norm(); };
  const double error_before = error();
  NativeEngine engine(graph);
  const Summary summary = engine.solve({.max_iterations = 20});
  std::cout << summary << "error of the last pose [m]: " << error_before << " -> " << error() << '\n'
            << "its covariance:\n"
            << engine.covariance(x) << '\n';
  return summary.converged() && error() < error_before ? 0 : 1;
}
