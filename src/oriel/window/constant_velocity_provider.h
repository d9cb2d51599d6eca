// States of pose and velocity that nothing measures from one to the next: the body is expected to keep its velocity
// (residual/constant_velocity.h). For cameras, lidars or beacons alone.
#pragma once
#include <array>

#include "oriel/residual/noise.h"
#include "oriel/residual/prior.h"
#include "oriel/window/state_provider.h"

namespace oriel {

struct ConstantVelocityOptions {
  double acceleration = 1.0;                       // density of the white noise on the acceleration [m/s²/√Hz]
  double rotation = 0.5;                           // density of the white noise on the angular velocity [rad/s/√Hz]
  Duration longest{std::int64_t{10'000'000'000}};  // between two states; what is further off cannot be had [ns]
};

// What the first state is said to be: a prior each.
struct ConstantVelocityStart {
  Pose3d T_world_body{};
  Velocity3d velocity{};
  FullNoise<6> pose_noise = Covariance(Mat6d::identity() * 1e-6);
  IsotropicNoise velocity_noise = Sigma(1.0);  // [m/s]
};

class ConstantVelocityProvider final : public StateProvider {
 public:
  explicit ConstantVelocityProvider(const ConstantVelocityOptions& options, const ConstantVelocityStart& start = {})
      : options_(options), start_(start) {}
  // What the next first state is. After the window has begun anew: that it goes on from the last, as well known as
  // this.
  void start_at(const ConstantVelocityStart& start) { start_ = start; }

  std::string_view name() const override { return "constant velocity"; }
  std::span<const VariableOps* const> variables() const override { return kOps; }
  Result<void> begin(GraphEdit& edit, State& state) override;
  bool covers(Time from, Time to) const override { return from <= to && to - from <= options_.longest; }
  Result<void> predict(GraphEdit& edit, const State& from, State& state) override;
  Result<FactorId> link(GraphEdit& edit, const State& from, const State& to) override;
  void ended(const Graph& graph, const State& last) override {
    start_.T_world_body = graph.value(pose(last));
    start_.velocity = graph.value(velocity(last));
  }

  static VariableId<Pose3d> pose(const State& s) { return {s.variables[0].key}; }
  static VariableId<Velocity3d> velocity(const State& s) { return {s.variables[1].key}; }

 private:
  static constexpr std::array<const VariableOps*, 2> kOps = {&kVariableOps<Pose3d>, &kVariableOps<Velocity3d>};
  ConstantVelocityOptions options_;
  ConstantVelocityStart start_;
};

}  // namespace oriel
