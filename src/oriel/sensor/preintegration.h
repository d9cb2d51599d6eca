// Preintegration: hundreds of IMU samples between two times become one relative motion that does not depend on the pose
// or the velocity at the start (Forster, Carlone, Dellaert, Scaramuzza, "On-Manifold Preintegration for Real-Time
// Visual-Inertial Odometry", TRO 2017, arXiv:1512.02363; cited as [F] with its equation numbers).
//
// Two things are better than in [F]: a step is integrated exactly for a constant angular velocity and specific force in
// the body's frame (the mean of its two samples), instead of holding the rotation still; and the random walk of the
// biases acts within the interval, so that the covariance is one 15 × 15 block with its correlations.
#pragma once
#include <span>

#include "oriel/base/finite.h"
#include "oriel/base/result.h"
#include "oriel/manifold/so3.h"
#include "oriel/manifold/vector.h"
#include "oriel/sensor/imu.h"

namespace oriel {

// The motion from body i (at t0) to body j (at t1), [F] eq. 33:
//   ΔR = R_iᵀ R_j,  Δv = R_iᵀ (v_j - v_i - g Δt),  Δp = R_iᵀ (p_j - p_i - v_i Δt - g Δt²/2),
// measured with biases `bias`, and its derivatives by them, [F] eq. 44 and Appendix B: for a bias moved by δ,
//   ΔR Exp(dR_dg δg),  Δv + dv_dg δg + dv_da δa,  Δp + dp_dg δg + dp_da δa.
template <class S>
struct PreintegratedImu {
  template <class T>
  using rebind = PreintegratedImu<T>;

  S dt = S(0.0);                     // Δt [s]
  Rot3<S> dR{};                      // ΔR
  Vec<S, 3> dv = Vec<S, 3>::zero();  // Δv [m/s]
  Vec<S, 3> dp = Vec<S, 3>::zero();  // Δp [m]
  ImuBias<S> bias{};                 // linearization point
  Mat<S, 3, 3> dR_dg = Mat<S, 3, 3>::zero();
  Mat<S, 3, 3> dv_dg = Mat<S, 3, 3>::zero(), dv_da = Mat<S, 3, 3>::zero();
  Mat<S, 3, 3> dp_dg = Mat<S, 3, 3>::zero(), dp_da = Mat<S, 3, 3>::zero();

  // More members than all_finite can name by itself.
  bool finite() const {
    return all_finite(dt) && all_finite(dR) && all_finite(dv) && all_finite(dp) && all_finite(bias) &&
           all_finite(dR_dg) && all_finite(dv_dg) && all_finite(dv_da) && all_finite(dp_dg) && all_finite(dp_da);
  }
};
using PreintegratedImud = PreintegratedImu<double>;

struct Preintegration {
  PreintegratedImud motion;
  // Of [δφ; δv; δp; δbg; δba]: ΔR_true = ΔR Exp(δφ), Δv_true = Δv + δv, Δp_true = Δp + δp, and how the biases walked
  // between t0 and t1; in [rad, m/s, m, rad/s, m/s²].
  Mat<double, 15, 15> covariance = Mat<double, 15, 15>::zero();
};

struct PreintegrationOptions {
  Duration max_gap{50'000'000};           // [ns] between two samples that follow each other
  Duration max_extrapolation{5'000'000};  // [ns] from t0 back to the first sample, or from the last one on to t1
};

// Integrates step by step; `preintegrate` is the loop around it.
class Preintegrator {
 public:
  Preintegrator(const ImuBiasd& bias, const ImuNoise& noise) : noise_(noise) { result_.motion.bias = bias; }
  // dt [s] > 0 with constant angular velocity and specific force as measured, biases not yet taken off.
  void step(double dt, const Vec3d& gyro, const Vec3d& accel) { step(dt, gyro, accel, noise_); }
  void step(double dt, const Vec3d& gyro, const Vec3d& accel, const ImuNoise& noise);
  const Preintegration& result() const { return result_; }

 private:
  ImuNoise noise_;
  Preintegration result_;
};

// From t0 to t1 > t0. Samples are interpolated linearly at both ends; where t0 or t1 lies outside of all samples by no
// more than max_extrapolation, the outermost sample is held. The samples may reach further than the interval.
// Errors name the sample by its index in `samples` and its stamp: a gap, a duplicate or a backward stamp, a number that
// is not finite (looked for in the samples that are used, and their neighbours), or an interval that is not covered.
Result<Preintegration> preintegrate(std::span<const ImuSample> samples, Time t0, Time t1, const ImuBiasd& bias,
                                    const ImuNoise& noise, const PreintegrationOptions& options = {});

namespace detail {
// Error: an interval without length, a density that is not positive.
Result<void> check_interval(Time t0, Time t1, const ImuNoise& noise);
}  // namespace detail

// What is assumed where samples are missing: the turn and the specific force change evenly from those before the gap to
// those after it; where there is none on one side, the body keeps its attitude and velocity. That is wrong by a
// constant of about so much all the gap long; as white noise of density σ √T it has σ T at the end, and enters the
// covariance.
struct BridgeOptions {
  PreintegrationOptions covered;      // what is no gap
  double gyro_sigma = 0.5;            // [rad/s]
  double accel_sigma = 2.0;           // [m/s²]
  Duration edge{50'000'000};          // before and after a gap that is averaged, as a sample alone shakes [ns]
  Duration longest_step{50'000'000};  // [ns]
};
struct BridgedPreintegration {
  Preintegration integral;
  Duration missing;  // of the interval: how much of it no samples cover
};
// As `preintegrate`, but across gaps and beyond the samples in hand. `rest`: the specific force of a body at rest with
// the attitude at t0, in its frame (minus gravity) [m/s²]. Samples must be finite and rise strictly, as those of an
// ImuBuffer. Error: an interval without length, a density that is not positive.
Result<BridgedPreintegration> preintegrate_across(std::span<const ImuSample> samples, Time t0, Time t1,
                                                  const ImuBiasd& bias, const ImuNoise& noise, const Vec3d& rest,
                                                  const BridgeOptions& options = {});

}  // namespace oriel
