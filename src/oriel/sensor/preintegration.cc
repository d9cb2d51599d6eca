#include "oriel/sensor/preintegration.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

namespace oriel {
namespace {

// The effect of one step: with W = hat(φ), φ = ω dt,
//   ΔR ← ΔR Exp(φ),  Δv ← Δv + ΔR Γ₁(φ) a dt,  Δp ← Δp + Δv dt + ΔR Γ₂(φ) a dt²,
// Γ₁ = I + B W + C W² (the left Jacobian of SO(3)), Γ₂ = I/2 + C W + D W², its integral; B = (1 - cos θ)/θ²,
// C = (θ - sin θ)/θ³, D = (1/2 - B)/θ².
struct StepCoefficients {
  double B, C, D;
  explicit StepCoefficients(double t) {
    const ExpCoefficients<double> c(t);
    B = c.B;
    C = c.C;
    D = t < so3_detail::kSeries ? so3_detail::alternating<4>(t) : (0.5 - B) / t;
  }
};

// (c0 I + c1 W + c2 W²) a.
Vec3d series_times(const Vec3d& phi, const Vec3d& a, double c0, double c1, double c2) {
  const Vec3d w = cross(phi, a);
  return a * c0 + w * c1 + cross(phi, w) * c2;
}

Mat3d outer(const Vec3d& a, const Vec3d& b) { return a * b.transposed(); }

Mat3d series(const Vec3d& phi, double c0, double c1, double c2) {
  const Mat3d W = hat(phi);
  return Mat3d::identity() * c0 + W * c1 + (W * W) * c2;
}

// Its derivative by φ, where slope1 and slope2 are those of c1 and c2 along φ, dc = slope φᵀ dφ. The first terms of
// their series do: the angle of one step is far below one.
Mat3d series_derivative(const Vec3d& phi, const Vec3d& a, double c1, double c2, double slope1, double slope2) {
  const Vec3d w = cross(phi, a), ww = cross(phi, w);
  const Mat3d square = outer(phi, a) + Mat3d::identity() * phi.dot(a) - outer(a, phi) * 2.0;
  return hat(a) * -c1 + square * c2 + outer(w * slope1 + ww * slope2, phi);
}

// The step's linearization: errors e = [δφ; δv; δp; δbg; δba] go over into
//   δφ' = E δφ + Gφ δg,  δv' = Vφ δφ + δv + Vg δg + Va δa,  δp' = Pφ δφ + dt δv + δp + Pg δg + Pa δa,
// δg = δbg + white noise of the gyroscope, δa likewise ([F] eq. 59-62, for the exact step).
struct StepJacobian {
  double dt;
  Mat3d E, Gphi, Vphi, Vg, Va, Pphi, Pg, Pa;
};

StepJacobian linearize_step(const Mat3d& R, const Vec3d& phi, const Vec3d& a, const StepCoefficients& c, double dt) {
  StepJacobian s;
  s.dt = dt;
  s.E = Rot3d::exp(-phi).matrix();
  s.Gphi = right_jacobian_so3(phi) * -dt;
  s.Vphi = R * hat(series_times(phi, a, 1.0, c.B, c.C)) * -dt;
  s.Pphi = R * hat(series_times(phi, a, 0.5, c.C, c.D)) * (-dt * dt);
  s.Va = R * series(phi, 1.0, c.B, c.C) * -dt;
  s.Pa = R * series(phi, 0.5, c.C, c.D) * (-dt * dt);
  // dB = -φᵀdφ/12, dC = -φᵀdφ/60, dD = -φᵀdφ/360 to first order; a step's φ falls by dt δg.
  s.Vg = R * series_derivative(phi, a, c.B, c.C, -1.0 / 12, -1.0 / 60) * (-dt * dt);
  s.Pg = R * series_derivative(phi, a, c.C, c.D, -1.0 / 60, -1.0 / 360) * (-dt * dt * dt);
  return s;
}

// Left multiplication by the step's transition matrix, block row by block row; M has the five blocks of e as rows.
template <int C>
Mat<double, 15, C> propagate(const StepJacobian& s, const Mat<double, 15, C>& M) {
  Mat<double, 15, C> out;
  for (int j = 0; j < C; ++j)
    for (int i = 0; i < 3; ++i) {
      double phi = 0.0, v = M(3 + i, j), p = M(6 + i, j) + s.dt * M(3 + i, j);
      for (int k = 0; k < 3; ++k) {
        const double e = M(k, j), g = M(9 + k, j), a = M(12 + k, j);
        phi += s.E(i, k) * e + s.Gphi(i, k) * g;
        v += s.Vphi(i, k) * e + s.Vg(i, k) * g + s.Va(i, k) * a;
        p += s.Pphi(i, k) * e + s.Pg(i, k) * g + s.Pa(i, k) * a;
      }
      out(i, j) = phi;
      out(3 + i, j) = v;
      out(6 + i, j) = p;
      out(9 + i, j) = M(9 + i, j);
      out(12 + i, j) = M(12 + i, j);
    }
  return out;
}

// White noise of density σ has the variance σ²/dt over a step, and enters as a bias would; what the velocity's noise
// does to the position within the step is the rest σ² dt³ (1/3 - 1/4). The biases walk by σ² dt.
Mat<double, 15, 15> step_noise(const StepJacobian& s, const ImuNoise& n) {
  Mat<double, 15, 6> G = Mat<double, 15, 6>::zero();
  const double gyro = n.gyro / std::sqrt(s.dt), accel = n.accel / std::sqrt(s.dt);
  G.set_block(0, 0, s.Gphi * gyro);
  G.set_block(3, 0, s.Vg * gyro);
  G.set_block(6, 0, s.Pg * gyro);
  G.set_block(3, 3, s.Va * accel);
  G.set_block(6, 3, s.Pa * accel);
  Mat<double, 15, 15> Q = G * G.transposed();
  for (int i = 0; i < 3; ++i) {
    Q(6 + i, 6 + i) += n.accel * n.accel * s.dt * s.dt * s.dt / 12.0;
    Q(9 + i, 9 + i) += n.gyro_walk * n.gyro_walk * s.dt;
    Q(12 + i, 12 + i) += n.accel_walk * n.accel_walk * s.dt;
  }
  return Q;
}

void advance_bias_jacobians(const StepJacobian& s, PreintegratedImud& m) {
  m.dp_dg = m.dp_dg + m.dv_dg * s.dt + s.Pphi * m.dR_dg + s.Pg;
  m.dp_da = m.dp_da + m.dv_da * s.dt + s.Pa;
  m.dv_dg = m.dv_dg + s.Vphi * m.dR_dg + s.Vg;
  m.dv_da = m.dv_da + s.Va;
  m.dR_dg = s.E * m.dR_dg + s.Gphi;
}

bool finite(const Vec3d& a) { return std::isfinite(a[0]) && std::isfinite(a[1]) && std::isfinite(a[2]); }
bool positive(double x) { return std::isfinite(x) && x > 0.0; }

std::string seconds(Duration d) { return std::to_string(d.seconds()) + " s"; }

Error sample_error(ErrorCode code, std::span<const ImuSample> samples, std::size_t k, const std::string& what) {
  return Error{
      code, "IMU sample " + std::to_string(k) + " (t = " + std::to_string(samples[k].time.ns) + " ns): " + what, {}, 0};
}

// Samples [first, last] in use: their order, their gaps, their numbers.
Result<void> check_samples(std::span<const ImuSample> samples, std::size_t first, std::size_t last, Duration max_gap) {
  for (std::size_t k = first; k <= last; ++k) {
    if (!finite(samples[k].gyro) || !finite(samples[k].accel))
      return sample_error(ErrorCode::not_finite, samples, k, "a reading is not finite");
    if (k == 0) continue;
    const Duration gap = samples[k].time - samples[k - 1].time;
    const std::string before = "sample " + std::to_string(k - 1);
    if (gap.ns == 0) return sample_error(ErrorCode::bad_input, samples, k, "has the same stamp as " + before);
    if (gap.ns < 0)
      return sample_error(ErrorCode::bad_input, samples, k, "is " + seconds({-gap.ns}) + " earlier than " + before);
    if (k > first && gap > max_gap)
      return sample_error(ErrorCode::bad_input, samples, k,
                          "comes " + seconds(gap) + " after " + before + ", expected at most " + seconds(max_gap));
  }
  return {};
}

Result<void> check_coverage(std::span<const ImuSample> samples, Time t0, Time t1, Duration reach) {
  if (samples.empty())
    return Error{ErrorCode::not_found,
                 "preintegration from " + std::to_string(t0.ns) + " ns to " + std::to_string(t1.ns) +
                     " ns: there is no IMU sample",
                 {},
                 0};
  if (samples.front().time - t0 > reach)
    return sample_error(ErrorCode::not_found, samples, 0,
                        "is the first one, " + seconds(samples.front().time - t0) + " after the start of the interval");
  if (t1 - samples.back().time > reach)
    return sample_error(ErrorCode::not_found, samples, samples.size() - 1,
                        "is the last one, " + seconds(t1 - samples.back().time) + " before the end of the interval");
  return {};
}

// The reading at t, which lies between samples k and k + 1, or outside of all of them.
ImuSample reading_at(std::span<const ImuSample> samples, std::size_t k, Time t) {
  const ImuSample& a = samples[k];
  if (t <= a.time || k + 1 == samples.size()) return {t, a.gyro, a.accel};
  const ImuSample& b = samples[k + 1];
  const double u = (t - a.time).seconds() / (b.time - a.time).seconds();
  return {t, a.gyro + (b.gyro - a.gyro) * u, a.accel + (b.accel - a.accel) * u};
}

// The last sample at or before t, or the first of all.
std::size_t sample_before(std::span<const ImuSample> samples, Time t) {
  const auto later = [](Time s, const ImuSample& sample) { return s < sample.time; };
  const auto it = std::upper_bound(samples.begin(), samples.end(), t, later);
  return it == samples.begin() ? 0 : static_cast<std::size_t>(it - samples.begin() - 1);
}

}  // namespace

Result<void> detail::check_interval(Time t0, Time t1, const ImuNoise& noise) {
  if (!positive(noise.gyro) || !positive(noise.accel) || !positive(noise.gyro_walk) || !positive(noise.accel_walk))
    return Error{ErrorCode::bad_input, "IMU noise: expected four densities > 0", {}, 0};
  if (t1 <= t0)
    return Error{ErrorCode::bad_input,
                 "preintegration from " + std::to_string(t0.ns) + " ns to " + std::to_string(t1.ns) +
                     " ns: expected an end after the start",
                 {},
                 0};
  return {};
}

void Preintegrator::step(double dt, const Vec3d& gyro, const Vec3d& accel, const ImuNoise& noise) {
  PreintegratedImud& m = result_.motion;
  const Vec3d phi = (gyro - m.bias.gyro) * dt, a = accel - m.bias.accel;
  const StepCoefficients c(phi.squared_norm());
  const Mat3d R = m.dR.matrix();
  const StepJacobian s = linearize_step(R, phi, a, c, dt);

  const auto half = propagate(s, result_.covariance);
  result_.covariance = propagate(s, half.transposed()) + step_noise(s, noise);
  advance_bias_jacobians(s, m);
  m.dp = m.dp + m.dv * dt + R * series_times(phi, a, 0.5, c.C, c.D) * (dt * dt);
  m.dv = m.dv + R * series_times(phi, a, 1.0, c.B, c.C) * dt;
  m.dR = (m.dR * Rot3d::exp(phi)).normalized();
  m.dt += dt;
}

Result<Preintegration> preintegrate(std::span<const ImuSample> samples, Time t0, Time t1, const ImuBiasd& bias,
                                    const ImuNoise& noise, const PreintegrationOptions& options) {
  if (auto ok = detail::check_interval(t0, t1, noise); !ok) return ok.error();
  if (auto ok = check_coverage(samples, t0, t1, options.max_extrapolation); !ok) return ok.error();
  const std::size_t first = sample_before(samples, t0);
  std::size_t last = first;  // the first sample at or after t1, or the last of all
  while (last + 1 < samples.size() && samples[last].time < t1) ++last;
  if (auto ok = check_samples(samples, first, last, options.max_gap); !ok) return ok.error();

  Preintegrator integrator(bias, noise);
  ImuSample from = reading_at(samples, first, t0);
  for (std::size_t k = first; from.time < t1; ++k) {
    const bool inside = k + 1 < samples.size() && samples[k + 1].time < t1;
    if (inside && samples[k + 1].time <= from.time) continue;
    const ImuSample to = inside ? samples[k + 1] : reading_at(samples, k, t1);
    integrator.step((to.time - from.time).seconds(), (from.gyro + to.gyro) * 0.5, (from.accel + to.accel) * 0.5);
    from = to;
  }
  Preintegration result = integrator.result();
  result.motion.dt = (t1 - t0).seconds();  // without the sum's rounding
  return result;
}

}  // namespace oriel
