// Poses among known points, without a guess.
#include "oriel/window/relocate.h"

#include <gtest/gtest.h>

#include <random>

namespace oriel {
namespace {

StereoRigd rig() {
  StereoRigd r;
  const RadTanCamerad camera{458.0, 457.0, 367.0, 248.0, -0.283, 0.074, 0.0002, 0.00002};
  r.cameras[0] = {camera, Pose3d{Rot3d::exp({{0.01, -0.02, 0.01}}), {{0.0, -0.05, 0.02}}}};
  r.cameras[1] = {camera, Pose3d{Rot3d::exp({{0.0, -0.01, 0.02}}), {{0.11, -0.05, 0.02}}}};
  return r;
}

// Points that both cameras see from T, with noise; a share of the pixels is anywhere.
std::vector<PointSighting> sightings_from(const Pose3d& T, int count, double gross, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> x(-2.0, 2.0), depth(2.0, 6.0), share(0.0, 1.0), pixel(0.0, 480.0);
  std::normal_distribution<double> noise(0.0, 0.5);
  std::vector<PointSighting> out;
  const StereoRigd r = rig();
  while (static_cast<int>(out.size()) < count) {
    const Vec3d p_body = {{x(random), x(random), depth(random)}};
    PointSighting s{T * p_body, {}, {}, true};
    Vec2d* pixels[2] = {&s.pixel0, &s.pixel1};
    bool seen = true;
    for (int c = 0; c < 2; ++c) {
      const Vec3d h = r.cameras[c].T_body_camera().inverse() * p_body;
      seen = seen && r.cameras[c].camera.project(h, *pixels[c], nullptr);
      for (int i = 0; i < 2; ++i) (*pixels[c])[i] += noise(random);
    }
    if (!seen) continue;
    if (share(random) < gross) s.pixel0 = {{pixel(random), pixel(random)}};
    out.push_back(s);
  }
  return out;
}

TEST(Relocate, FindsAPoseFromAnyStartWithAThirdOfGrossErrors) {
  PoseWorkspace work;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Pose3d truth{Rot3d::exp({{0.3, 1.9, -0.8}}), {{2.0, -1.0, 0.5}}};
    const auto sightings = sightings_from(truth, 80, 0.33, seed);
    Pose3d T;  // two radians and two metres off
    const RefinePoseReport report = find_pose(sightings, rig(), 12, T, work);
    EXPECT_TRUE(agrees(report, 12));
    EXPECT_LT((T.t - truth.t).norm(), 0.03);
    EXPECT_LT((T.R.inverse() * truth.R).log().norm(), 0.01);
  }
}

TEST(Relocate, LeavesThePoseAndSaysSoWhereMostPointsAreWrong) {
  PoseWorkspace work;
  const auto sightings = sightings_from(Pose3d{Rot3d::exp({{0.3, 1.9, -0.8}}), {{2.0, -1.0, 0.5}}}, 80, 0.9, 3);
  Pose3d T;
  EXPECT_FALSE(agrees(find_pose(sightings, rig(), 12, T, work), 12));
}

TEST(Relocate, NeedsPointsThatBothCamerasSee) {
  PoseWorkspace work;
  auto sightings = sightings_from(Pose3d{}, 40, 0.0, 1);
  for (PointSighting& s : sightings) s.has_right = false;
  EXPECT_FALSE(relocate(sightings, rig(), 12, work).has_value());
  EXPECT_FALSE(relocate({}, rig(), 0, work).has_value());
}

TEST(Relocate, LaysATriangleOnAnotherUnlessTheyDifferOrAreFlat) {
  const Pose3d T{Rot3d::exp({{-1.0, 0.4, 2.0}}), {{1.0, 2.0, 3.0}}};
  const Vec3d b[3] = {{{1.0, 0.0, 2.0}}, {{0.0, 1.5, 3.0}}, {{-1.0, 0.2, 2.5}}};
  Vec3d a[3] = {T * b[0], T * b[1], T * b[2]};
  const auto found = lay_triangle(a, b, 0.1);
  ASSERT_TRUE(found.has_value());
  EXPECT_LT((found->t - T.t).norm(), 1e-12);
  EXPECT_LT((found->R.inverse() * T.R).log().norm(), 1e-12);
  a[2] = a[2] + (a[2] - a[0]);
  EXPECT_FALSE(lay_triangle(a, b, 0.1).has_value());
  const Vec3d line[3] = {{{0.0, 0.0, 0.0}}, {{1.0, 0.0, 0.0}}, {{2.0, 0.0, 0.0}}};
  EXPECT_FALSE(lay_triangle(line, line, 0.1).has_value());
}

}  // namespace
}  // namespace oriel
