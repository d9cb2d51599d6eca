#include "oriel/window/standstill_hook.h"

#include <algorithm>

#include "oriel/residual/between.h"

namespace oriel {

InsertionHook::Verdict StandstillHook::inserted(const Graph& graph, const States& states, const InsertedGroup& group,
                                                GraphEdit& edit) {
  const State* newest = states.timeline(provider_).find(group.newest);
  const State* before = states.timeline(provider_).at_or_before(group.newest - Duration{1});
  if (newest == nullptr || before == nullptr) return {};
  const VariableKey velocity = ImuProvider::velocity(*newest);
  if (std::find(group.new_variables.begin(), group.new_variables.end(), velocity) == group.new_variables.end())
    return {};  // not new: judged when it came
  if (!(graph.value(ImuProvider::velocity(*newest)).v.norm() <= options_.speed)) return {};
  const Time since = newest->time - options_.span;
  if (!imu_->covers(since, newest->time)) return {};
  const auto samples = imu_->samples().between(since, newest->time);
  if (!are_still(samples, graph.value(ImuProvider::bias(*newest)), options_)) return {};
  if (tracks_) {
    const double moved = tracks_(before->time, newest->time);
    if (!(moved >= 0.0 && moved <= options_.pixels)) return {};
  }
  edit.add(Prior{Velocity3d{}}, Sigma(options_.velocity_sigma), ImuProvider::velocity(*newest));
  const double r = options_.rotation_sigma, t = options_.translation_sigma;
  edit.add(Between{Pose3d{}}, Sigmas(Vec6d{{r, r, r, t, t, t}}), ImuProvider::pose(*before),
           ImuProvider::pose(*newest));
  ++count_;
  return {};
}

bool StandstillHook::are_still(std::span<const ImuSample> samples, const ImuBiasd& bias,
                               const StandstillOptions& options) {
  Vec3d gyro = Vec3d::zero(), accel = Vec3d::zero();
  for (const ImuSample& s : samples) gyro += s.gyro, accel += s.accel;
  gyro *= 1.0 / static_cast<double>(samples.size());
  accel *= 1.0 / static_cast<double>(samples.size());
  if (!((gyro - bias.gyro).norm() <= options.turn)) return false;
  for (const ImuSample& s : samples)
    if (!((s.gyro - gyro).norm() <= options.gyro && (s.accel - accel).norm() <= options.accel)) return false;
  return true;
}

}  // namespace oriel
