// Points from pairs of pixels, and what is not known of them.
#include "oriel/window/stereo_point.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "simulated_flight.h"

namespace oriel {
namespace {

StereoRigd rectified() {
  StereoRigd rig;
  rig.cameras[0].camera = rig.cameras[1].camera = {500.0, 500.0, 320.0, 240.0};
  rig.cameras[1].t_body_camera = {{0.2, 0.0, 0.0}};
  return rig;
}
StereoSighting sighting(const StereoRigd& rig, const Vec3d& p_body, double sigma) {
  StereoSighting s{{}, {}, Mat2d::identity() * (sigma * sigma), Mat2d::identity() * (sigma * sigma)};
  Vec2d* pixels[2] = {&s.pixel0, &s.pixel1};
  for (int c = 0; c < 2; ++c) {
    const Vec3d h = rig.cameras[c].T_body_camera().inverse() * p_body;
    EXPECT_TRUE(rig.cameras[c].camera.project(h, *pixels[c], nullptr));
  }
  return s;
}

TEST(StereoPoint, IsWhereBothCamerasSeeItAlsoThroughDistortion) {
  const StereoRigd rig = SimulatedFlight({.duration_s = 0.0}).rig;
  const Vec3d p = {{0.7, -0.4, 4.0}};
  const auto point = stereo_point(rig, sighting(rig, p, 1.0));
  ASSERT_TRUE(point.has_value());
  EXPECT_LT((in_body(rig, point->p_camera) - p).norm(), 1e-9);
}

// Of a rectified pair with both rows of one noise σ, by hand: with X from the axis midway between the cameras, whose
// mean pixel is f X / z, and d = f b / z independent of that mean: σ_z = z²/(f b) · √2 σ, σ_y = z/f · σ/√2, and x moves
// with the depth along the middle's ray, cov(x, z) = σ_z² X/z, σ_x² = (z/f)² σ²/2 + σ_z² (X/z)².
TEST(StereoPoint, HasTheCovarianceOfTheClosedFormForARectifiedPair) {
  const double z = 8.0, sigma = 0.7, f = 500.0, b = 0.2, X = 0.8;
  const auto point = stereo_point(rectified(), sighting(rectified(), {{b / 2.0 + X, 0.0, z}}, sigma));
  ASSERT_TRUE(point.has_value());
  const double sigma_z = z * z / (f * b) * std::sqrt(2.0) * sigma, across = z / f * sigma / std::sqrt(2.0);
  EXPECT_NEAR(std::sqrt(point->covariance(2, 2)), sigma_z, 1e-9);
  EXPECT_NEAR(std::sqrt(point->covariance(1, 1)), across, 1e-9);
  EXPECT_NEAR(point->covariance(0, 2), sigma_z * sigma_z * X / z, 1e-9);
  EXPECT_NEAR(point->covariance(0, 0), across * across + std::pow(sigma_z * X / z, 2), 1e-9);
  EXPECT_NEAR(point->covariance(0, 1), 0.0, 1e-12);
}

// Draws of the pixels: the points that come of them spread as the covariance says.
TEST(StereoPoint, HasTheCovarianceOfManyDraws) {
  const StereoRigd rig = SimulatedFlight({.duration_s = 0.0}).rig;
  const Vec3d p = {{1.0, 0.5, 3.0}};
  const StereoSighting exact = sighting(rig, p, 0.2);
  const auto at = stereo_point(rig, exact);
  ASSERT_TRUE(at.has_value());
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal(0.0, 0.2);
  constexpr int kDraws = 20000;
  Mat3d sum = Mat3d::zero();
  for (int k = 0; k < kDraws; ++k) {
    StereoSighting s = exact;
    for (int i = 0; i < 2; ++i) s.pixel0[i] += normal(random), s.pixel1[i] += normal(random);
    const auto drawn = stereo_point(rig, s, {.greatest_depth_share = 1.0, .greatest_error = 1e9});
    ASSERT_TRUE(drawn.has_value());
    const Vec3d e = drawn->p_camera - at->p_camera;
    sum += e * e.transposed();
  }
  const Mat3d spread = sum / static_cast<double>(kDraws);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const double scale = std::sqrt(at->covariance(i, i) * at->covariance(j, j));
      EXPECT_NEAR(spread(i, j), at->covariance(i, j), 0.05 * scale) << i << ' ' << j;  // √(2/20000) = 0.01
    }
}

TEST(StereoPoint, IsNotMadeWhereItsDepthIsNotKnownOrRaysMissEachOther) {
  const StereoRigd rig = rectified();
  const auto far = sighting(rig, {{0.0, 0.0, 60.0}}, 1.0);  // disparity 1.7 px, of √2 σ
  EXPECT_FALSE(stereo_point(rig, far).has_value());
  EXPECT_TRUE(stereo_point(rig, far, {.greatest_depth_share = 1.0}).has_value());
  auto crossed = sighting(rig, {{0.0, 0.0, 4.0}}, 1.0);
  crossed.pixel1[1] += 10.0;  // off the epipolar line by 7 of its sigmas
  EXPECT_FALSE(stereo_point(rig, crossed).has_value());
  auto behind = sighting(rig, {{0.0, 0.0, 4.0}}, 1.0);
  std::swap(behind.pixel0, behind.pixel1);
  EXPECT_FALSE(stereo_point(rig, behind).has_value());
}

// What fusing one by one must come to: the weighted mean of a linear problem.
TEST(FuseSighting, ComesToTheLeastSquaresEstimateOfAllLinearMeasurements) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  const auto draw = [&] { return normal(random); };
  Vec3d p = {{1.0, 2.0, 3.0}};
  Mat3d covariance = Mat3d::identity() * 4.0;
  Mat3d information = Mat3d::identity() * 0.25;
  Vec3d weighted = information * p;
  for (int k = 0; k < 5; ++k) {
    Mat<double, 2, 3> M;
    for (int i = 0; i < 6; ++i) M[i] = draw();
    const Vec2d measured = {{draw(), draw()}};
    const Mat2d V = {{2.0, 0.5, 0.5, 1.0}}, V_inverse = {{1.0 / 1.75, -0.5 / 1.75, -0.5 / 1.75, 2.0 / 1.75}};
    information += M.transposed() * V_inverse * M;
    weighted += M.transposed() * V_inverse * measured;
    ASSERT_TRUE(fuse_sighting<2>(M * p - measured, M, V, p, covariance));
  }
  EXPECT_LT((information * p - weighted).norm(), 1e-10);
  EXPECT_LT((information * covariance - Mat3d::identity()).norm(), 1e-10);
}

TEST(FuseSighting, ChangesNothingWhereACovarianceIsSingular) {
  Vec3d p = {{1.0, 2.0, 3.0}};
  Mat3d covariance = Mat3d::identity();
  EXPECT_FALSE(fuse_sighting<2>(Vec2d::zero(), Mat<double, 2, 3>::zero(), Mat2d::zero(), p, covariance));
  EXPECT_EQ(p, (Vec3d{{1.0, 2.0, 3.0}}));
  EXPECT_EQ(covariance, Mat3d::identity());
}

}  // namespace
}  // namespace oriel
