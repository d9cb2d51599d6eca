// A known point seen from another frame: values by hand, Jacobians in three ways, and what its noise must be.
#include "oriel/residual/matched_point.h"

#include "random_values.h"
#include "residual/jacobian_agreement.h"

namespace oriel {
namespace {

using testing_values::euroc_like_rig;
using testing_values::Random;

StereoRigd rectified() {
  StereoRigd rig;
  rig.cameras[0].camera = rig.cameras[1].camera = {500.0, 400.0, 320.0, 240.0};
  rig.cameras[1].t_body_camera = {{0.2, 0.0, 0.0}};
  return rig;
}

// The body of b stands 1 m ahead of that of a, so that a point 6 m ahead of a is 5 m ahead of b.
TEST(MatchedPoint, IsThePixelsWhereTheOtherFrameSeesThePoint) {
  const Pose3d a{Rot3d{}, {{3.0, 0.0, 0.0}}}, b{Rot3d{}, {{3.0, 0.0, 1.0}}};
  const Vec3d p_a = {{0.5, -0.25, 6.0}};
  Vec4d r;
  ASSERT_TRUE((MatchedStereod{p_a, Vec4d::zero()}.evaluate(a, b, rectified(), r, nullptr, nullptr)));
  const Vec4d expected = {{320.0 + 50.0, 240.0 - 20.0, 320.0 + 30.0, 240.0 - 20.0}};
  EXPECT_LT((r - expected).norm(), 1e-12);
  Vec3d d;
  ASSERT_TRUE((MatchedDisparityd{p_a, {{370.0, 220.0, 19.0}}}.evaluate(a, b, rectified(), d, nullptr, nullptr)));
  EXPECT_LT((d - Vec3d{{0.0, 0.0, 1.0}}).norm(), 1e-12);  // f b / z = 20
  Vec2d l;
  ASSERT_TRUE((MatchedPixeld{p_a, {{369.0, 222.0}}}.evaluate(a, b, rectified(), l, nullptr, nullptr)));
  EXPECT_LT((l - Vec2d{{1.0, -2.0}}).norm(), 1e-12);
}

// V8
TEST(MatchedPoint, IsNotValidWhereThePointIsBehindACamera) {
  Vec4d r;
  EXPECT_FALSE((MatchedStereod{{{0.0, 0.0, -1.0}}, Vec4d::zero()}.evaluate(Pose3d{}, Pose3d{}, rectified(), r, nullptr,
                                                                           nullptr)));
}

template <int D>
void check_jacobians(unsigned seed) {
  Random random(seed);
  for (const double apart : {0.0, 1e-8, 0.05, 0.3}) {
    const Pose3d a = random.value<Pose3d>(0.8), b = a.plus(random.normal<6>(apart));
    // Ahead of the rig, whose cameras look along the body's z.
    const Vec3d p_a = {{random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), random.uniform(3.0, 6.0)}};
    expect_all(MatchedPoint<double, D>{p_a, random.normal<D>(100.0)}, a, b, euroc_like_rig());
  }
}
// V10
TEST(MatchedPoint, HasTheSameJacobianByThreeWays) {
  check_jacobians<2>(1);
  check_jacobians<3>(2);
  check_jacobians<4>(3);
}

// Moving the first body's origin moves the point with it: ∂r/∂p_a is the translation's part of J_a.
TEST(MatchedPoint, HasItsJacobianByThePointInThatOfTheFirstPose) {
  Random random(4);
  const Pose3d a = random.value<Pose3d>(0.5), b = a.plus(random.normal<6>(0.2));
  const Vec3d p = {{0.4, -0.3, 4.0}};
  const StereoRigd rig = euroc_like_rig();
  Vec4d r, plus, minus;
  Mat<double, 4, 6> J_a, J_b;
  ASSERT_TRUE((MatchedStereod{p, Vec4d::zero()}.evaluate(a, b, rig, r, &J_a, &J_b)));
  for (int j = 0; j < 3; ++j) {
    const Vec3d h = Vec3d::unit(j) * 1e-5;
    ASSERT_TRUE((MatchedStereod{p + h, Vec4d::zero()}.evaluate(a, b, rig, plus, nullptr, nullptr)));
    ASSERT_TRUE((MatchedStereod{p - h, Vec4d::zero()}.evaluate(a, b, rig, minus, nullptr, nullptr)));
    EXPECT_LT(((plus - minus) / 2e-5 - J_a.col(3 + j)).norm(), 1e-5);
  }
}

}  // namespace
}  // namespace oriel
