// A user's own camera in the reprojections of the library: a fisheye lens by the unified model (C. Mei, P. Rives,
// "Single View Point Omnidirectional Camera Calibration from Planar Grids", ICRA 2007, in the form of V. Usenko,
// N. Demmel, D. Cremers, "The Double Sphere Camera Model", 3DV 2018, equations 10 to 14):
//   pixel = f [x, y] / (α d + (1 - α) z) + c,   d = |h|;   it holds for z > -w d, w = min(α, 1 - α) / max(α, 1 - α).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "oriel/residual/check_jacobian.h"
#include "oriel/residual/prior.h"
#include "oriel/residual/reprojection.h"
#include "oriel/solve/native_engine.h"

namespace {

using namespace oriel;  // NOLINT(google-build-using-namespace): as a user would write it

template <class S>
struct Fisheye {
  static constexpr std::string_view kName = "example.fisheye/1";
  static constexpr int kDim = 0;
  template <class T>
  using rebind = Fisheye<T>;

  S f = S(1.0), cx = S(0.0), cy = S(0.0);  // [px]
  S alpha = S(0.5);                        // [-], in (0, 1)
  S w = S(1.0);                            // of alpha, see above

  static Fisheye of(double f, double cx, double cy, double alpha) {
    return {f, cx, cy, alpha, std::min(alpha, 1.0 - alpha) / std::max(alpha, 1.0 - alpha)};
  }
  MaskOf<S> project(const Vec<S, 3>& h, Vec<S, 2>& pixel, Mat<S, 2, 3>* J) const {
    using std::sqrt;
    const S d = sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]), rest = S(1.0) - alpha;
    const S m = f / (alpha * d + rest * h[2]);
    pixel = {{m * h[0] + cx, m * h[1] + cy}};
    if (J != nullptr) {
      // ∂m/∂h = -m²/f (α h/d + (1 - α) e_z)
      const S n = -m * m / f, x = n * alpha * h[0] / d, y = n * alpha * h[1] / d, z = n * (alpha * h[2] / d + rest);
      *J = {{m + h[0] * x, h[0] * y, h[1] * x, m + h[1] * y, h[0] * z, h[1] * z}};  // by columns
    }
    return h[2] > -w * d;
  }
  Result<Vec2d> unproject(const Vec2d& pixel) const requires std::same_as<S, double> {
    const Vec2d m = Vec2d{{pixel[0] - cx, pixel[1] - cy}} / f;
    const double rr = m.squared_norm(), inside = 1.0 - (2.0 * alpha - 1.0) * rr;
    const double z = inside < 0.0 ? -1.0 : (1.0 - alpha * alpha * rr) / (alpha * std::sqrt(inside) + 1.0 - alpha);
    if (!(z > 0.0)) return Error{ErrorCode::bad_input, "the ray of this pixel does not point forward", {}, 0};
    return m / z;
  }
};
static_assert(Camera<Fisheye<double>>);

using Rig = StereoRig<double, Fisheye>;
using Sight = MonoPointReprojection<double, 0, Fisheye>;

const Fisheye<double> kLens = Fisheye<double>::of(380.0, 320.0, 240.0, 0.6);

Rig rig() {
  Rig rig;
  rig.cameras[0] = {kLens, Pose3d{}.plus({{0.02, -0.01, 0.3, 0.1, 0.0, 0.05}})};
  return rig;
}

TEST(CustomCamera, IsDifferentiatedWithTheReprojectionThatItIsUsedIn) {  // V9, V10
  const Pose3d body = Pose3d{}.plus({{0.1, 0.2, -0.1, 0.3, -0.2, 0.1}});
  for (const Vec3d& p : {Vec3d{{0.5, 0.4, 3.0}}, Vec3d{{4.0, -3.0, 2.0}}, Vec3d{{-2.0, 0.1, 0.9}}}) {
    const JacobianCheck check = check_jacobian(Sight{Vec2d{{300.0, 200.0}}}, body, Point3d{p}, rig());
    EXPECT_LT(check.worst(), 1e-6) << check;
  }
}

TEST(CustomCamera, ReturnsTheRayThatItProjects) {  // V9
  for (const Vec2d& ray : {Vec2d{{0.0, 0.0}}, Vec2d{{0.7, -0.4}}, Vec2d{{-2.5, 1.5}}}) {
    Vec2d pixel;
    ASSERT_TRUE(kLens.project({{ray[0], ray[1], 1.0}}, pixel, nullptr));
    const Result<Vec2d> back = kLens.unproject(pixel);
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_LT((*back - ray).norm(), 1e-9);
  }
}

TEST(CustomCamera, FindsItsPoseBeforeKnownPointsOfWhichOneIsBehindIt) {  // V9, V8
  const Pose3d truth = Pose3d{}.plus({{0.05, -0.1, 0.2, 0.4, -0.3, 0.2}});
  std::mt19937 random(3);
  std::uniform_real_distribution<double> side(-6.0, 6.0), ahead(1.0, 5.0);
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto body = edit.add(Pose3d{}, Label("body"));
  const auto cameras = edit.add(rig());
  for (int k = 0; k < 40; ++k) {
    const Vec3d in_body = {{side(random), side(random), k == 0 ? -40.0 : ahead(random)}};
    Sight sight{Vec2d{{0.0, 0.0}}};
    Vec2d at;
    ASSERT_EQ(sight.evaluate(truth, Point3d{truth.R * in_body + truth.t}, rig(), at, nullptr, nullptr), k != 0);
    sight.pixel = at;  // beside the pixel (0, 0)
    const auto point = edit.add(Point3d{truth.R * in_body + truth.t});
    edit.fix(point);
    edit.add(sight, Sigma(1.0), Huber(2.0), body, point, cameras);
  }
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  const Summary summary = engine.solve();
  EXPECT_TRUE(summary.converged()) << summary;
  EXPECT_EQ(summary.invalid_factors, 1) << summary;
  EXPECT_LE(graph.value(body).minus(truth).norm(), 1e-7) << summary;
}

}  // namespace
