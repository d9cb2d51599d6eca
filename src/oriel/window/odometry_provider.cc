#include "oriel/window/odometry_provider.h"

#include <string>

namespace oriel {
namespace {

// The share s of an even motion.
template <class P>
OdometryMotion<P> share(const OdometryMotion<P>& m, double s) {
  if (s >= 1.0) return m;
  return {P{}.plus(m.motion.minus(P{}) * s), m.covariance * s};
}

// One after the other. True = a Exp(e_a) b Exp(e_b) = a b Exp(Ad(b⁻¹) e_a) Exp(e_b), to first order.
template <class P>
void append(OdometryMotion<P>& a, const OdometryMotion<P>& b) {
  const auto A = adjoint(b.motion.inverse());
  a.motion = a.motion * b.motion;
  a.covariance = A * a.covariance * A.transposed() + b.covariance;
}

}  // namespace

template <class P>
void OdometryProvider<P>::start_measuring(Time time) {
  stamps_.assign(1, {time, {}});
}

template <class P>
Result<void> OdometryProvider<P>::add(Time time, const P& motion, const Covariance& covariance) {
  const auto refused = [&](ErrorCode code, const std::string& why) {
    return Error{code, "odometry at " + std::to_string(time.ns) + " ns: " + why};
  };
  if (stamps_.empty()) return refused(ErrorCode::bad_input, "expected start_measuring() before");
  if (time <= stamps_.back().time)
    return refused(ErrorCode::bad_input, "expected a stamp after " + std::to_string(stamps_.back().time.ns) + " ns");
  if (!all_finite(motion) || !all_finite(covariance)) return refused(ErrorCode::not_finite, "a number is not finite");
  if (!oriel::Covariance(covariance).valid())
    return refused(ErrorCode::indefinite, "expected a covariance that is positive definite");
  stamps_.push_back({time, {motion, covariance}});
  return {};
}

template <class P>
Result<void> OdometryProvider<P>::begin(GraphEdit& edit, State& state) {
  state.count = 1;
  state.variables[0] = edit.add(first_);
  edit.add(Prior{first_}, oriel::Covariance(first_covariance_), pose(state));
  return {};
}

template <class P>
bool OdometryProvider<P>::covers(Time from, Time to) const {
  return !stamps_.empty() && stamps_.front().time <= from && from <= to && to <= stamps_.back().time;
}

template <class P>
Result<void> OdometryProvider<P>::predict(GraphEdit& edit, const State& from, State& state) {
  const P x = edit.value(pose(from));
  state.count = 1;
  state.variables[0] = edit.add(P{}.plus((x * between(from.time, state.time).motion).minus(P{})));
  return {};
}

template <class P>
Result<FactorId> OdometryProvider<P>::link(GraphEdit& edit, const State& from, const State& to) {
  const OdometryMotion<P> m = between(from.time, to.time);
  return edit.add(Between<P>{m.motion}, oriel::Covariance(m.covariance), pose(from), pose(to));
}

template <class P>
OdometryMotion<P> OdometryProvider<P>::between(Time from, Time to) const {
  OdometryMotion<P> sum;
  auto at = std::upper_bound(stamps_.begin(), stamps_.end(), from, [](Time t, const Stamp& s) { return t < s.time; });
  for (; at != stamps_.end() && (at - 1)->time < to; ++at) {
    const Time start = (at - 1)->time, first = std::max(start, from), last = std::min(at->time, to);
    append(sum, share(at->moved, (last - first).seconds() / (at->time - start).seconds()));
  }
  return sum;
}

template <class P>
void OdometryProvider<P>::forget_before(Time time) {
  const Time needed = time - horizon_;
  const auto later =
      std::upper_bound(stamps_.begin(), stamps_.end(), needed, [](Time t, const Stamp& s) { return t < s.time; });
  const auto gone = later - stamps_.begin() - 1;                       // the last stamp at or before `needed` stays
  if (2 * gone < static_cast<std::ptrdiff_t>(stamps_.size())) return;  // moves few, seldom
  stamps_.erase(stamps_.begin(), stamps_.begin() + gone);
}

template class OdometryProvider<Pose2d>;
template class OdometryProvider<Pose3d>;

}  // namespace oriel
