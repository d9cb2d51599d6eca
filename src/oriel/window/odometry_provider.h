// A chain of poses by relative-pose odometry: wheels, lidar matching, visual odometry of somebody else. Each increment
// is the motion since the stamp before, in the frame there, and how well it is known.
//
// Inside an increment the motion is even and its covariance grows evenly: of Δ with covariance Σ the share s is
// Exp(s Log Δ) with s Σ. So a motion that a state splits adds up to the whole: exactly where only translations are
// uncertain, else but for what the uncertain turn of one part of an increment moves the rest of it.
#pragma once
#include <algorithm>
#include <array>
#include <vector>

#include "oriel/base/result.h"
#include "oriel/manifold/jacobian.h"
#include "oriel/residual/between.h"
#include "oriel/residual/noise.h"
#include "oriel/residual/prior.h"
#include "oriel/window/state_provider.h"

namespace oriel {

// P: Pose3d or Pose2d. A tangent's covariance is of the moving frame at the end: true = measured Exp(e).
template <class P>
struct OdometryMotion {
  P motion{};
  Mat<double, P::kDim, P::kDim> covariance = Mat<double, P::kDim, P::kDim>::zero();
};

template <class P>
class OdometryProvider final : public StateProvider {
 public:
  static constexpr int kDim = P::kDim;
  using Covariance = Mat<double, kDim, kDim>;

  // `first` and its covariance: the prior of the first state. Measurements are kept for `horizon` longer than the
  // window needs them (late data).
  OdometryProvider(const P& first, const Covariance& covariance, Duration horizon = {})
      : first_(first), first_covariance_(covariance), horizon_(horizon) {}
  // What the next first state is. After the window has begun anew: that it goes on from the last, as well known as
  // this.
  void start_at(const P& first, const Covariance& covariance) {
    first_ = first;
    first_covariance_ = covariance;
  }

  // Where the measurements begin; forgets all that there are.
  void start_measuring(Time time);
  // The motion since the stamp before. Refused: a stamp that is not later, a number that is not finite, a covariance
  // that is not positive definite, or a chain that has not begun.
  Result<void> add(Time time, const P& motion, const Covariance& covariance);
  std::size_t increments() const { return stamps_.empty() ? 0 : stamps_.size() - 1; }

  std::string_view name() const override { return "odometry"; }
  std::span<const VariableOps* const> variables() const override { return kOps; }
  bool can_begin(Time time) const override { return covers(time, time); }
  Result<void> begin(GraphEdit& edit, State& state) override;
  bool covers(Time from, Time to) const override;
  Result<void> predict(GraphEdit& edit, const State& from, State& state) override;
  Result<FactorId> link(GraphEdit& edit, const State& from, const State& to) override;
  void ended(const Graph& graph, const State& last) override { first_ = graph.value(pose(last)); }
  void forget_before(Time time) override;

  // What was measured between two times, which must be covered.
  OdometryMotion<P> between(Time from, Time to) const;
  static VariableId<P> pose(const State& s) { return {s.variables[0].key}; }

 private:
  struct Stamp {
    Time time;
    OdometryMotion<P> moved;  // since the stamp before
  };
  static constexpr std::array<const VariableOps*, 1> kOps = {&kVariableOps<P>};

  P first_;
  Covariance first_covariance_;
  Duration horizon_;
  std::vector<Stamp> stamps_;
};

extern template class OdometryProvider<Pose2d>;
extern template class OdometryProvider<Pose3d>;

}  // namespace oriel
