// A user's measurement as a residual, in the forms that there are: over any scalar (Jacobian by dual numbers), with its
// own Jacobian, and optional where it may not be valid.
#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "oriel/manifold/se2.h"
#include "oriel/residual/check_jacobian.h"
#include "oriel/residual/prior.h"
#include "oriel/solve/native_engine.h"

namespace {

using namespace oriel;  // NOLINT(google-build-using-namespace): as a user would write it

struct Beacon {  // a constant that many rows share
  static constexpr std::string_view kName = "example.beacon/1";
  static constexpr int kDim = 0;
  double x = 0.0, y = 0.0;  // [m]
};

struct Range {  // distance of a pose to a beacon [m]; says nothing from closer than 0.1 m
  static constexpr std::string_view kName = "example.range/1";
  using Variables = Types<Pose2d, Beacon>;
  double meters = 0.0;
  template <class S>
  std::optional<S> operator()(const Pose2<S>& pose, const Beacon& beacon) const {
    using std::sqrt;
    const Vec<S, 2> p = pose.translation();
    const S dx = p[0] - beacon.x, dy = p[1] - beacon.y, d = sqrt(dx * dx + dy * dy);
    if (d < S(0.1)) return std::nullopt;
    return d - meters;
  }
};

struct Offset {  // of a pose along x [m], with a Jacobian by hand
  static constexpr std::string_view kName = "example.offset/1";
  static constexpr int kDim = 1;
  using Variables = Types<Pose2d>;
  double x = 0.0;
  bool evaluate(const Pose2d& pose, Vec1d& r, Mat<double, 1, 3>* J_pose) const {
    r[0] = pose.translation()[0] - x;
    // The tangent [angle; translation] moves the pose in its own frame: t + R rho.
    if (J_pose != nullptr) *J_pose = {{0.0, pose.rotation().c, -pose.rotation().s}};
    return true;
  }
};

TEST(CustomResidual, LocalizesAPoseBetweenThreeBeacons) {  // V9
  Graph graph;
  GraphEdit edit = graph.edit();
  const Pose2d truth = Pose2d{}.plus({{0.3, 1.0, 2.0}});
  const auto pose = edit.add(Pose2d{}, Label("robot"));
  for (const auto& [x, y] : {std::pair{-5.0, 0.0}, {4.0, -3.0}, {1.0, 6.0}}) {
    const auto beacon = edit.add(Beacon{x, y});
    const Vec2d p = truth.translation();
    edit.add(Range{std::hypot(p[0] - x, p[1] - y)}, Sigma(0.05), Cauchy(2.0), pose, beacon);
  }
  edit.add(Prior{truth}, Sigmas(Vec3d{{0.1, 10.0, 10.0}}), pose);
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  const Summary summary = engine.solve();
  EXPECT_TRUE(summary.converged()) << summary;
  EXPECT_LE(graph.value(pose).minus(truth).norm(), 1e-5);
}

TEST(CustomResidual, CountsAsInvalidWhereItSaysSo) {  // V9, V8
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto pose = edit.add(Pose2d{});
  const auto here = edit.add(Beacon{0.0, 0.01});
  edit.add(Range{1.0}, Sigma(0.1), pose, here);
  edit.add(Prior{Pose2d{}}, Sigma(0.1), pose);
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  EXPECT_EQ(engine.solve().invalid_factors, 1);
}

TEST(CustomResidual, MayBringItsOwnJacobian) {  // V9, V10
  const JacobianCheck check = check_jacobian(Offset{7.0}, Pose2d{}.plus({{0.5, 3.0, 1.0}}));
  EXPECT_LT(check.worst(), 1e-8) << check;
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto pose = edit.add(Pose2d{}.plus({{0.5, 3.0, 1.0}}));
  edit.add(Offset{7.0}, Sigma(0.1), pose);
  edit.add(Prior{Pose2d{}.plus({{0.5, 3.0, 1.0}})}, Sigma(100.0), pose);
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  EXPECT_TRUE(engine.solve().converged());
  EXPECT_NEAR(graph.value(pose).translation()[0], 7.0, 1e-4);
}

}  // namespace
