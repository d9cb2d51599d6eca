#include "oriel/window/constant_velocity_provider.h"

#include "oriel/residual/constant_velocity.h"

namespace oriel {
namespace {

void keep(State& state, VariableId<Pose3d> pose, VariableId<Velocity3d> velocity) {
  state.count = 2;
  state.variables[0] = pose;
  state.variables[1] = velocity;
}

}  // namespace

Result<void> ConstantVelocityProvider::begin(GraphEdit& edit, State& state) {
  keep(state, edit.add(start_.T_world_body), edit.add(start_.velocity));
  edit.add(Prior<Pose3d>{start_.T_world_body}, start_.pose_noise, pose(state));
  edit.add(Prior<Velocity3d>{start_.velocity}, start_.velocity_noise, velocity(state));
  return {};
}

Result<void> ConstantVelocityProvider::predict(GraphEdit& edit, const State& from, State& state) {
  const double dt = (state.time - from.time).seconds();
  const Velocity3d v = edit.value(velocity(from));
  Pose3d x = edit.value(pose(from));
  x.t += v.v * dt;
  keep(state, edit.add(x), edit.add(v));
  return {};
}

Result<FactorId> ConstantVelocityProvider::link(GraphEdit& edit, const State& from, const State& to) {
  const double dt = (to.time - from.time).seconds();
  return edit.add(ConstantVelocityd{dt}, constant_velocity_noise(dt, options_.acceleration, options_.rotation),
                  pose(from), velocity(from), pose(to), velocity(to));
}

}  // namespace oriel
