#include "oriel/sensor/preintegration.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace oriel {
namespace {

constexpr ImuNoise kNoise{1.7e-3, 2e-2, 1.9e-4, 3e-3};
constexpr std::int64_t kStep = 5'000'000;  // [ns], 200 Hz

// A smooth motion, by its angular velocity and specific force in the body's frame at t [s].
Vec3d gyro_at(double t) { return {{std::sin(2 * t), 0.7 * std::cos(3 * t), 0.4 - 0.3 * std::sin(t)}}; }
Vec3d accel_at(double t) { return {{1.5 * std::cos(4 * t), -0.5 + std::sin(t), 9.81 + 2 * std::sin(5 * t)}}; }

std::vector<ImuSample> samples_of_motion(int count) {
  std::vector<ImuSample> samples;
  for (int i = 0; i < count; ++i) {
    const Time t{i * kStep};
    samples.push_back({t, gyro_at(static_cast<double>(t.ns) * 1e-9), accel_at(static_cast<double>(t.ns) * 1e-9)});
  }
  return samples;
}

struct Motion {
  Mat3d R;
  Vec3d v, p;
};
// dR/dt = R hat(ω), dv/dt = R a, dp/dt = v, by Runge-Kutta of fourth order with tiny steps.
Motion direct_integration(double t0, double t1) {
  Motion m{Mat3d::identity(), Vec3d::zero(), Vec3d::zero()};
  const int steps = 20000;
  const double h = (t1 - t0) / steps;
  auto rate = [](double t, const Motion& x) { return Motion{x.R * hat(gyro_at(t)), x.R * accel_at(t), x.v}; };
  auto moved = [](const Motion& x, const Motion& d, double s) {
    return Motion{x.R + d.R * s, x.v + d.v * s, x.p + d.p * s};
  };
  for (int i = 0; i < steps; ++i) {
    const double t = t0 + i * h;
    const Motion k1 = rate(t, m), k2 = rate(t + h / 2, moved(m, k1, h / 2)), k3 = rate(t + h / 2, moved(m, k2, h / 2)),
                 k4 = rate(t + h, moved(m, k3, h));
    m = moved(moved(moved(moved(m, k1, h / 6), k2, h / 3), k3, h / 3), k4, h / 6);
  }
  return m;
}

// W16
TEST(Preintegration, FollowsDirectIntegrationOfTheMotion) {
  const auto samples = samples_of_motion(401);
  for (const auto& [t0, t1] : {std::pair{Time{0}, Time{1'000'000'000}},
                               {Time{2'000'000}, Time{1'503'000'000}},
                               {Time{501'000'000}, Time{502'000'000}},
                               {Time{0}, Time{2'000'000'000}}}) {
    const auto result = preintegrate(samples, t0, t1, {}, kNoise);
    ASSERT_TRUE(result.ok()) << result.error();
    const Motion expected = direct_integration(static_cast<double>(t0.ns) * 1e-9, static_cast<double>(t1.ns) * 1e-9);
    const auto& m = result->motion;
    EXPECT_LT((m.dR.matrix() - expected.R).norm(), 5e-5);
    EXPECT_LT((m.dv - expected.v).norm(), 5e-4);
    EXPECT_LT((m.dp - expected.p).norm(), 5e-4);
    EXPECT_EQ(m.dt, (t1 - t0).seconds());
  }
}

// W16: constant rates in the body's frame are integrated exactly, however long the steps.
TEST(Preintegration, IsExactForConstantRates) {
  std::vector<ImuSample> coarse, fine;
  const Vec3d gyro = {{0.3, -1.0, 2.0}}, accel = {{1.0, 2.0, 9.0}};
  for (int i = 0; i <= 25; ++i) coarse.push_back({{i * 40'000'000}, gyro, accel});
  for (int i = 0; i <= 10000; ++i) fine.push_back({{i * 100'000}, gyro, accel});
  const auto a = preintegrate(coarse, {0}, {1'000'000'000}, {}, kNoise)->motion;
  const auto b = preintegrate(fine, {0}, {1'000'000'000}, {}, kNoise)->motion;
  EXPECT_LT(a.dR.minus(b.dR).norm(), 1e-12);
  EXPECT_LT((a.dv - b.dv).norm(), 1e-11);
  EXPECT_LT((a.dp - b.dp).norm(), 1e-11);
}

// W16
TEST(Preintegration, HasTheBiasJacobiansOfDifferences) {
  const auto samples = samples_of_motion(401);
  const ImuBiasd bias{{{0.01, -0.02, 0.03}}, {{0.1, 0.2, -0.1}}};
  const Time t0{3'000'000}, t1{1'201'000'000};
  const auto m = preintegrate(samples, t0, t1, bias, kNoise)->motion;
  constexpr double h = 1e-4;
  for (int j = 0; j < 6; ++j) {
    const Vec6d d = Vec6d::unit(j) * h;
    const auto ahead = preintegrate(samples, t0, t1, bias.plus(d), kNoise)->motion;
    const auto behind = preintegrate(samples, t0, t1, bias.plus(-d), kNoise)->motion;
    const Vec3d by_R = (ahead.dR.minus(m.dR) - behind.dR.minus(m.dR)) / (2 * h);
    const Vec3d by_v = (ahead.dv - behind.dv) / (2 * h), by_p = (ahead.dp - behind.dp) / (2 * h);
    EXPECT_LT((by_R - (j < 3 ? m.dR_dg.col(j) : Vec3d::zero())).norm(), 1e-7);
    EXPECT_LT((by_v - (j < 3 ? m.dv_dg.col(j) : m.dv_da.col(j - 3))).norm(), 1e-6);
    EXPECT_LT((by_p - (j < 3 ? m.dp_dg.col(j) : m.dp_da.col(j - 3))).norm(), 1e-6);
  }
}

// W16: samples with white noise and walking biases are drawn again and again; their errors against the clean motion
// must have the covariance that is claimed, correlations with the biases' walk included.
TEST(Preintegration, HasTheCovarianceOfAMonteCarloRun) {
  constexpr int kRuns = 4000, kSteps = 60;
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  const double dt = 5e-3, white = 1 / std::sqrt(dt), walk = std::sqrt(dt);
  auto draw = [&](double sigma) {
    return Vec3d{{sigma * normal(random), sigma * normal(random), sigma * normal(random)}};
  };
  auto run = [&](bool noisy, Vec<double, 6>& walked) {
    Preintegrator integrator({}, kNoise);
    Vec3d bg = Vec3d::zero(), ba = Vec3d::zero();
    for (int i = 0; i < kSteps; ++i) {
      const double t = (i + 0.5) * dt;
      const Vec3d gyro = gyro_at(t) + (noisy ? bg + draw(kNoise.gyro * white) : Vec3d::zero());
      const Vec3d accel = accel_at(t) + (noisy ? ba + draw(kNoise.accel * white) : Vec3d::zero());
      integrator.step(dt, gyro, accel);
      if (noisy) bg += draw(kNoise.gyro_walk * walk), ba += draw(kNoise.accel_walk * walk);
    }
    walked.set_segment(0, bg);
    walked.set_segment(3, ba);
    return integrator.result();
  };
  Vec6d walked;
  const Preintegration truth = run(false, walked);
  Mat<double, 15, 15> sampled = Mat<double, 15, 15>::zero();
  for (int i = 0; i < kRuns; ++i) {
    const auto m = run(true, walked).motion;
    Vec<double, 15> e;
    e.set_segment(0, truth.motion.dR.minus(m.dR));
    e.set_segment(3, truth.motion.dv - m.dv);
    e.set_segment(6, truth.motion.dp - m.dp);
    e.set_segment(9, walked);
    sampled += e * e.transposed() * (1.0 / kRuns);
  }
  const auto& P = truth.covariance;
  for (int i = 0; i < 15; ++i)
    for (int j = 0; j <= i; ++j) {
      const double scale = std::sqrt(P(i, i) * P(j, j));
      // The standard deviation of a sampled correlation is at most √(2/runs) = 0.022.
      EXPECT_NEAR(sampled(i, j) / scale, P(i, j) / scale, 0.09) << i << ", " << j;
    }
}

// W16: integrating on from a point in the middle gives the whole.
TEST(Preintegration, OfTwoHalvesMakesTheWhole) {
  const auto samples = samples_of_motion(401);
  const Time t0{2'000'000}, middle{700'000'000}, t1{1'403'000'000};
  const auto a = preintegrate(samples, t0, middle, {}, kNoise)->motion,
             b = preintegrate(samples, middle, t1, {}, kNoise)->motion;
  const auto whole = preintegrate(samples, t0, t1, {}, kNoise)->motion;
  EXPECT_LT((a.dR * b.dR).minus(whole.dR).norm(), 1e-12);
  EXPECT_LT((a.dv + a.dR * b.dv - whole.dv).norm(), 1e-12);
  EXPECT_LT((a.dp + a.dv * b.dt + a.dR * b.dp - whole.dp).norm(), 1e-12);
}

void expect_error(std::vector<ImuSample> samples, Time t0, Time t1, const std::string& text) {
  const auto result = preintegrate(samples, t0, t1, {}, kNoise);
  ASSERT_FALSE(result.ok()) << text;
  EXPECT_NE(result.error().message.find(text), std::string::npos) << result.error();
}

// W16
TEST(Preintegration, NamesTheSampleThatIsWrong) {
  const Time t0{1'000'000}, t1{99'000'000};
  auto samples = samples_of_motion(30);
  samples[7].time = samples[6].time;
  expect_error(samples, t0, t1, "IMU sample 7 (t = 30000000 ns): has the same stamp as sample 6");
  samples = samples_of_motion(30);
  samples[7].time = {28'000'000};
  samples[6].time = {31'000'000};
  expect_error(samples, t0, t1, "IMU sample 7 (t = 28000000 ns): is 0.003000 s earlier than sample 6");
  samples = samples_of_motion(30);
  samples.erase(samples.begin() + 5, samples.begin() + 16);
  expect_error(samples, t0, t1, "IMU sample 5 (t = 80000000 ns): comes 0.060000 s after sample 4");
  samples = samples_of_motion(30);
  samples[9].gyro[1] = std::numeric_limits<double>::quiet_NaN();
  expect_error(samples, t0, t1, "IMU sample 9 (t = 45000000 ns): a reading is not finite");
}

// W16
TEST(Preintegration, RefusesAnIntervalThatIsNotCovered) {
  const auto samples = samples_of_motion(30);  // until 145 ms
  expect_error(samples, {-6'000'000}, {50'000'000}, "IMU sample 0 (t = 0 ns): is the first one, 0.006000 s after");
  expect_error(samples, {0}, {151'000'000}, "IMU sample 29 (t = 145000000 ns): is the last one, 0.006000 s before");
  expect_error(samples, {5}, {5}, "expected an end after the start");
  expect_error({}, {0}, {5}, "there is no IMU sample");
  EXPECT_TRUE(preintegrate(samples, {-200}, {145'000'200}, {}, kNoise).ok());
}

TEST(Preintegration, RefusesNoiseThatIsNotPositive) {
  const auto result = preintegrate(samples_of_motion(30), {0}, {50'000'000}, {}, ImuNoise{1e-4, 0.0, 1e-5, 1e-3});
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().message, "IMU noise: expected four densities > 0");
}

}  // namespace
}  // namespace oriel
