#include "oriel/residual/imu_residual.h"

#include <gtest/gtest.h>

#include <vector>

#include "oriel/residual/check_jacobian.h"
#include "random_values.h"

namespace oriel {
namespace {

using testing_values::Random;

constexpr ImuNoise kNoise{1.7e-4, 2e-3, 1.9e-5, 3e-3};

Preintegration random_motion(Random& random, const ImuBiasd& bias) {
  std::vector<ImuSample> samples;
  for (int i = 0; i <= 100; ++i)
    samples.push_back({{i * 5'000'000}, random.normal<3>(0.8), random.normal<3>(2.0) + Vec3d{{0, 0, 9.81}}});
  return *preintegrate(samples, {0}, {500'000'000}, bias, kNoise);
}

// V10
TEST(ImuResidual, HasTheSameJacobianByThreeWaysNearAndFarFromItsMeasurement) {
  Random random(1);
  for (const double error : {0.0, 1e-160, 1e-8, 1e-3, 0.1, 0.7}) {
    const ImuBiasd bias = random.value<ImuBiasd>(0.05);
    const ImuResidual<double> residual{random_motion(random, bias).motion};
    const Pose3d x_i = random.value<Pose3d>(1.0);
    const Pose3d x_j{x_i.R * residual.motion.dR * Rot3d::exp(random.normal<3>(error)), random.normal<3>(2.0)};
    const Velocity3d v_i = random.value<Velocity3d>(1.0), v_j = random.value<Velocity3d>(1.0);
    const ImuBiasd b_i = bias.plus(random.normal<6>(error)), b_j = random.value<ImuBiasd>(0.05);
    const JacobianCheck check = check_jacobian(residual, x_i, v_i, b_i, x_j, v_j, b_j);
    EXPECT_LT(check.analytic_and_dual, 1e-12) << check;
    EXPECT_LT(check.worst(), 1e-8) << check;
  }
}

TEST(ImuResidual, IsZeroForTheMotionThatWasMeasured) {
  Random random(2);
  const ImuBiasd bias = random.value<ImuBiasd>(0.05);
  const PreintegratedImud motion = random_motion(random, bias).motion;
  const Pose3d x_i = random.value<Pose3d>(1.0);
  const Velocity3d v_i = random.value<Velocity3d>(1.0);
  const Vec3d g = kStandardGravity;
  const Velocity3d v_j{v_i.v + g * motion.dt + x_i.R * motion.dv};
  const Pose3d x_j{x_i.R * motion.dR,
                   x_i.t + v_i.v * motion.dt + g * (0.5 * motion.dt * motion.dt) + x_i.R * motion.dp};
  Vec<double, 15> r;
  ASSERT_TRUE((ImuResidual<double>{motion}.evaluate(x_i, v_i, bias, x_j, v_j, bias, r, nullptr, nullptr, nullptr,
                                                    nullptr, nullptr, nullptr)));
  EXPECT_LT(r.norm(), 1e-13);
}

TEST(ImuResidual, StaysAtZeroToSecondOrderWhenTheBiasIsCorrected) {
  Random random(3);
  std::vector<ImuSample> samples;
  for (int i = 0; i <= 100; ++i)
    samples.push_back({{i * 5'000'000}, random.normal<3>(0.8), random.normal<3>(2.0) + Vec3d{{0, 0, 9.81}}});
  const ImuBiasd bias = random.value<ImuBiasd>(0.05);
  const auto motion = preintegrate(samples, {0}, {500'000'000}, bias, kNoise)->motion;
  const Vec6d direction = random.normal<6>(1.0);
  double previous = 0.0;
  for (const double size : {1e-2, 1e-3}) {
    const ImuBiasd moved = bias.plus(direction * size);
    const auto exact = preintegrate(samples, {0}, {500'000'000}, moved, kNoise)->motion;
    Vec<double, 15> r;
    const Velocity3d v_j{kStandardGravity * exact.dt + exact.dv};
    const Pose3d x_j{exact.dR, kStandardGravity * (0.5 * exact.dt * exact.dt) + exact.dp};
    ASSERT_TRUE((ImuResidual<double>{motion}.evaluate(Pose3d{}, Velocity3d{}, moved, x_j, v_j, moved, r, nullptr,
                                                      nullptr, nullptr, nullptr, nullptr, nullptr)));
    if (previous > 0.0) {
      EXPECT_NEAR(previous / r.norm(), 100.0, 10.0);
    }
    previous = r.norm();
  }
}

TEST(ImuResidual, IsWhitenedByTheInverseOfItsCovariance) {
  Random random(4);
  const Preintegration p = random_motion(random, {});
  const FullNoise<15> noise = imu_noise(p);
  ASSERT_TRUE(noise.valid());
  Mat<double, 15, 15> W = Mat<double, 15, 15>::identity();
  FullNoise<15>::whiten(noise.w, W);
  const Mat<double, 15, 15> white = W * p.covariance * W.transposed() - Mat<double, 15, 15>::identity();
  EXPECT_LT(white.norm(), 1e-8);
}

TEST(ImuResidual, HasAProperNoiseForASingleSampleInterval) {
  const std::vector<ImuSample> samples = {{{0}, {{0, 0, 0}}, {{0, 0, 9.81}}},
                                          {{5'000'000}, {{0, 0, 0}}, {{0, 0, 9.81}}}};
  const auto p = preintegrate(samples, {0}, {5'000'000}, {}, kNoise);
  ASSERT_TRUE(p.ok());
  EXPECT_TRUE(imu_noise(*p).valid());
}

}  // namespace
}  // namespace oriel
