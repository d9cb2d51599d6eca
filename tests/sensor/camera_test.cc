#include "oriel/sensor/camera.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oriel/sensor/stereo_rig.h"

namespace oriel {

// A user's own camera: an ideal pinhole of one parameter. It needs no more than this.
template <class S>
struct IdealCamera {
  static constexpr std::string_view kName = "test.ideal_camera/1";
  static constexpr int kDim = 0;
  template <class T>
  using rebind = IdealCamera<T>;
  S f = S(1.0);
  MaskOf<S> project(const Vec<S, 3>& h, Vec<S, 2>& pixel, Mat<S, 2, 3>* J) const {
    const S m = f / h[2], o(0.0);
    pixel = {{h[0] * m, h[1] * m}};
    if (J != nullptr) *J = {{m, o, o, m, -m * h[0] / h[2], -m * h[1] / h[2]}};
    return h[2] > o;
  }
  Result<Vec2d> unproject(const Vec2d& pixel) const { return pixel / value(); }
  double value() const { return static_cast<double>(f); }
};

namespace {

constexpr RadTanCamerad kEuroc{458.654, 457.296, 367.215, 248.375, -0.28340811, 0.07395907, 0.00019359, 1.76187114e-05};

TEST(RadTanCamera, ProjectsByItsFormula) {
  const Vec3d p = {{0.6, -0.4, 2.0}};
  const double x = 0.3, y = -0.2, s = x * x + y * y, d = 1 + kEuroc.k1 * s + kEuroc.k2 * s * s;
  Vec2d pixel;
  ASSERT_TRUE(kEuroc.project(p, pixel, nullptr));
  EXPECT_NEAR(pixel[0], kEuroc.fx * (d * x + 2 * kEuroc.p1 * x * y + kEuroc.p2 * (s + 2 * x * x)) + kEuroc.cx, 1e-11);
  EXPECT_NEAR(pixel[1], kEuroc.fy * (d * y + kEuroc.p1 * (s + 2 * y * y) + 2 * kEuroc.p2 * x * y) + kEuroc.cy, 1e-11);
}

TEST(RadTanCamera, DoesNotSeeTheLengthOfAVector) {
  Vec2d near, far;
  ASSERT_TRUE(kEuroc.project({{0.3, -0.2, 1.0}}, near, nullptr));
  ASSERT_TRUE(kEuroc.project({{3e6, -2e6, 1e7}}, far, nullptr));
  EXPECT_LT((near - far).norm(), 1e-10);
}

TEST(RadTanCamera, HasTheJacobianOfDifferences) {
  for (const Vec3d& p : {Vec3d{{0, 0, 1}}, Vec3d{{1e-9, 0, 3}}, Vec3d{{0.6, -0.4, 2.0}}, Vec3d{{-1.0, 0.7, 1.1}}}) {
    Vec2d pixel, ahead, behind;
    Mat<double, 2, 3> J;
    ASSERT_TRUE(kEuroc.project(p, pixel, &J));
    for (int j = 0; j < 3; ++j) {
      const Vec3d d = Vec3d::unit(j) * 1e-5;
      kEuroc.project(p + d, ahead, nullptr);
      kEuroc.project(p - d, behind, nullptr);
      EXPECT_LT(((ahead - behind) / 2e-5 - J.col(j)).norm(), 1e-6);
    }
  }
}

TEST(RadTanCamera, UnprojectsEveryPixelOfItsImage) {
  for (double u = 0; u <= 752; u += 47)
    for (double v = 0; v <= 480; v += 40) {
      const auto ray = kEuroc.unproject({{u, v}});
      ASSERT_TRUE(ray.ok()) << ray.error();
      Vec2d pixel;
      ASSERT_TRUE(kEuroc.project({{(*ray)[0], (*ray)[1], 1.0}}, pixel, nullptr));
      EXPECT_LT((pixel - Vec2d{{u, v}}).norm(), 1e-10);
    }
}

// 1 + 3 k1 s vanishes at s = 1/0.9: rays further out fold back into the image.
TEST(RadTanCamera, DoesNotHoldWhereItsPolynomialFoldsBack) {
  const RadTanCamerad camera{400, 400, 320, 240, -0.3, 0.0, 0.0, 0.0};
  Vec2d pixel;
  EXPECT_TRUE(camera.project({{1.0, 0.0, 1.0}}, pixel, nullptr));
  EXPECT_FALSE(camera.project({{1.1, 0.0, 1.0}}, pixel, nullptr));
  EXPECT_FALSE(camera.project({{0.1, 0.0, -1.0}}, pixel, nullptr));
}

TEST(RadTanCamera, SaysSoWhenNoRayEndsAtAPixel) {
  const RadTanCamerad camera{400, 400, 320, 240, -0.3, 0.0, 0.0, 0.0};
  const auto ray = camera.unproject({{5000.0, 240.0}});
  ASSERT_FALSE(ray.ok());
  EXPECT_NE(ray.error().message.find("5000"), std::string::npos);
}

static_assert(Camera<IdealCamera<double>>);
static_assert(Constant<StereoRig<double, IdealCamera>> && Rebindable<StereoRig<double, IdealCamera>>);

TEST(StereoRig, IsNamedAfterItsCameras) {
  EXPECT_EQ(StereoRigd::kName, "stereo_rig/1(radtan_camera/1)");
  EXPECT_EQ((StereoRig<double, IdealCamera>::kName), "stereo_rig/1(test.ideal_camera/1)");
}

TEST(StereoRig, KeepsTheMountingOfItsCameras) {
  const Pose3d T = Pose3d::exp({{0.3, -1.2, 0.5, 0.1, 0.2, 0.3}});
  const MountedCamera<double> mounted(kEuroc, T);
  EXPECT_LT(mounted.T_body_camera().minus(T).norm(), 1e-14);
}

}  // namespace
}  // namespace oriel
