// Preintegration across gaps.
#include <algorithm>
#include <cmath>

#include "oriel/sensor/preintegration.h"

namespace oriel {
namespace {

Vec3d between(const Vec3d& a, const Vec3d& b, double u) { return a + (b - a) * u; }

class Bridge {
 public:
  Bridge(std::span<const ImuSample> samples, const ImuBiasd& bias, const ImuNoise& noise, const Vec3d& rest,
         const BridgeOptions& options)
      : samples_(samples), bias_(bias), noise_(noise), rest_(rest), options_(options), integrator_(bias, noise) {}

  // Piece by piece: from a sample, or the interval's start, to the next sample or the end.
  BridgedPreintegration operator()(Time t0, Time t1) {
    const auto later = [](Time t, const ImuSample& s) { return t < s.time; };
    auto next =
        static_cast<std::size_t>(std::upper_bound(samples_.begin(), samples_.end(), t0, later) - samples_.begin());
    for (Time at = t0; at < t1; ++next) {
      const Time end = next < samples_.size() ? std::min(samples_[next].time, t1) : t1;
      if (covered(next, at, end))
        step(next, at, end);
      else
        coast(next, at, end);
      at = end;
    }
    BridgedPreintegration out{integrator_.result(), missing_};
    out.integral.motion.dt = (t1 - t0).seconds();  // without the sum's rounding
    return out;
  }

 private:
  bool has_before(std::size_t next) const { return next > 0; }
  bool has_after(std::size_t next) const { return next < samples_.size(); }

  bool covered(std::size_t next, Time at, Time end) const {
    const PreintegrationOptions& o = options_.covered;
    if (has_before(next) && has_after(next)) return samples_[next].time - samples_[next - 1].time <= o.max_gap;
    if (has_before(next)) return end - samples_[next - 1].time <= o.max_extrapolation;
    return has_after(next) && samples_[next].time - at <= o.max_extrapolation;
  }

  ImuSample reading(std::size_t next, Time t) const {
    if (!has_before(next) || !has_after(next)) return has_before(next) ? samples_[next - 1] : samples_[next];
    const ImuSample &a = samples_[next - 1], &b = samples_[next];
    const double u = (t - a.time).seconds() / (b.time - a.time).seconds();
    return {t, between(a.gyro, b.gyro, u), between(a.accel, b.accel, u)};
  }

  void step(std::size_t next, Time at, Time end) {
    const ImuSample a = reading(next, at), b = reading(next, end);
    integrator_.step((end - at).seconds(), (a.gyro + b.gyro) * 0.5, (a.accel + b.accel) * 0.5);
  }

  // The mean of the samples before a gap (step -1 from next - 1 on) or after it (step +1 from next on).
  ImuSample edge(std::size_t from, int step) const {
    ImuSample mean = samples_[from];
    int n = 1;
    for (std::size_t k = from + static_cast<std::size_t>(step); k < samples_.size();
         k += static_cast<std::size_t>(step)) {
      if (std::abs((samples_[k].time - mean.time).ns) > options_.edge.ns) break;
      mean.gyro += samples_[k].gyro;
      mean.accel += samples_[k].accel;
      ++n;
    }
    mean.gyro = mean.gyro / n;
    mean.accel = mean.accel / n;
    return mean;
  }

  void coast(std::size_t next, Time at, Time end) {
    missing_ = missing_ + (end - at);
    const double T = (end - at).seconds(), g = options_.gyro_sigma, a = options_.accel_sigma;
    ImuNoise noise = noise_;
    noise.gyro = std::sqrt(noise.gyro * noise.gyro + g * g * T);
    noise.accel = std::sqrt(noise.accel * noise.accel + a * a * T);
    const bool both = has_before(next) && has_after(next);
    ImuSample before{}, after{};
    if (both) {
      before = edge(next - 1, -1);
      after = edge(next, 1);
    }
    const std::int64_t steps = (end - at).ns / options_.longest_step.ns + 1;
    for (std::int64_t k = 0; k < steps; ++k) {
      Vec3d gyro = bias_.gyro, accel = integrator_.result().motion.dR.inverse() * rest_ + bias_.accel;
      if (both) {
        const double t = (at - before.time).seconds() + T * (static_cast<double>(k) + 0.5) / static_cast<double>(steps);
        const double u = t / (after.time - before.time).seconds();
        gyro = between(before.gyro, after.gyro, u);
        accel = between(before.accel, after.accel, u);
      }
      integrator_.step(T / static_cast<double>(steps), gyro, accel, noise);
    }
  }

  std::span<const ImuSample> samples_;
  ImuBiasd bias_;
  ImuNoise noise_;
  Vec3d rest_;
  BridgeOptions options_;
  Preintegrator integrator_;
  Duration missing_{0};
};

}  // namespace

Result<BridgedPreintegration> preintegrate_across(std::span<const ImuSample> samples, Time t0, Time t1,
                                                  const ImuBiasd& bias, const ImuNoise& noise, const Vec3d& rest,
                                                  const BridgeOptions& options) {
  if (auto ok = detail::check_interval(t0, t1, noise); !ok) return ok.error();
  return Bridge(samples, bias, noise, rest, options)(t0, t1);
}

}  // namespace oriel
