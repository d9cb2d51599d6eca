// Structureless tracks against the same tracks with their landmark as a variable.
#include "oriel/residual/structureless_track.h"

#include <gtest/gtest.h>

#include <vector>

#include "oriel/residual/between.h"
#include "oriel/residual/check_jacobian.h"
#include "oriel/residual/prior.h"
#include "oriel/residual/reprojection.h"
#include "oriel/solve/native_engine.h"
#include "residual/random_values.h"
#include "window/dense_oracle.h"

namespace oriel {
namespace {

using dense_oracle::difference;
using testing_values::euroc_like_rig;
using testing_values::Random;

// Poses side by side that look at a point, and what they see of it.
template <int N>
struct Scene {
  StereoRigd rig = euroc_like_rig();
  std::vector<Pose3d> poses;
  Vec3d p_world;
  StructurelessTrack<N> track;

  // right: of every how many views the right camera sees the point too; 0: never.
  Scene(Random& random, double pixel_sigma, int right, double depth = 4.0) {
    for (int k = 0; k < N; ++k)
      poses.push_back(Pose3d{Rot3d::exp(random.normal<3>(0.05)), {{0.3 * k, -0.1 * k, 0.05 * k * k}}});
    p_world = {{random.uniform(-0.5, 1.0), random.uniform(-0.5, 0.5), depth}};
    for (int k = 0; k < N; ++k) {
      TrackView& v = track.views[k];
      v.pixel0 = see(0, poses[k]) + random.normal<2>(pixel_sigma);
      v.bearing0 = *rig.cameras[0].camera.unproject(v.pixel0);
      if (right == 0 || k % right != 0) continue;
      v.right = 1.0;
      v.pixel1 = see(1, poses[k]) + random.normal<2>(pixel_sigma);
      v.bearing1 = *rig.cameras[1].camera.unproject(v.pixel1);
    }
  }
  Vec2d see(int camera, const Pose3d& pose) const {
    const auto& mount = rig.cameras[camera];
    const Vec3d h = mount.T_body_camera().inverse() * (pose.inverse() * p_world);
    Vec2d pixel;
    EXPECT_TRUE(mount.camera.project(h, pixel, nullptr));
    return pixel;
  }
  // f(the track, poses..., rig)
  template <class F>
  auto with_poses(F&& f) const {
    return [&]<std::size_t... I>(std::index_sequence<I...>) { return f(track, poses[I]..., rig); }
    (std::make_index_sequence<N>{});
  }
};

// The same track twice: with its landmark as a variable, at its best place, and without.
template <int N>
struct BothGraphs {
  Graph with, without;
  std::vector<VariableId<Pose3d>> poses_with, poses_without;

  explicit BothGraphs(const Scene<N>& scene, double sigma, const Loss& loss = Loss::none()) {
    GraphEdit edit = without.edit();
    const auto rig = edit.add(scene.rig);
    for (const Pose3d& p : scene.poses) poses_without.push_back(edit.add(p));
    [&]<std::size_t... I>(std::index_sequence<I...>) {
      edit.add(scene.track, Sigma(sigma), loss, poses_without[I]..., rig);
    }
    (std::make_index_sequence<N>{});
    EXPECT_TRUE(without.apply(edit).ok());
    add_landmark(scene, sigma);
  }
  void add_landmark(const Scene<N>& scene, double sigma) {
    GraphEdit edit = with.edit();
    const auto rig = edit.add(scene.rig);
    const auto point = edit.add(Point3d{scene.p_world});
    for (int k = 0; k < N; ++k) {
      poses_with.push_back(edit.add(scene.poses[k]));
      edit.fix(poses_with[k]);
      const TrackView& v = scene.track.views[k];
      if (v.right != 0.0)
        edit.add(StereoPointReprojectiond{v.pixel0, v.pixel1}, Sigma(sigma), poses_with[k], point, rig);
      else
        edit.add(MonoPointReprojectiond{v.pixel0}, Sigma(sigma), poses_with[k], point, rig);
    }
    EXPECT_TRUE(with.apply(edit).ok());
    EXPECT_TRUE(NativeEngine(with).solve().converged());
    for (int k = 0; k < 20; ++k) polish(point);
    edit.clear();
    for (const auto& id : poses_with) edit.fix(id, false);
    EXPECT_TRUE(with.apply(edit).ok());
  }
  // A Gauss–Newton step of the point; the engine stops where the cost no longer shows one.
  void polish(VariableId<Point3d> point) {
    const auto system = dense_oracle::system(with);
    const Eigen::Vector3d step = system.H.ldlt().solve(-system.g);
    GraphEdit edit = with.edit();
    edit.set(point, with.value(point).plus({{step[0], step[1], step[2]}}));
    EXPECT_TRUE(with.apply(edit).ok());
  }
};

template <int N>
void expect_schur_complement(unsigned seed, int right) {
  Random random(seed);
  const Scene<N> scene(random, 2.0, right);
  BothGraphs<N> both(scene, 0.7);
  const auto got = dense_oracle::system(both.without), whole = dense_oracle::system(both.with);
  auto rest = got;
  rest.variables.assign(both.poses_with.begin(), both.poses_with.end());
  const auto want = dense_oracle::schur_complement(whole, rest);
  EXPECT_LT(difference(got.H, want.H), 1e-9) << N << " poses, seed " << seed;
  EXPECT_LT((got.g - want.g).norm(), 1e-9 * (1.0 + want.H.norm())) << N << " poses, seed " << seed;
  const double cost = NativeEngine(both.with).cost();
  EXPECT_GT(cost, 1e-3);
  EXPECT_NEAR(NativeEngine(both.without).cost(), cost, 1e-9 * (1.0 + cost));
}

// W10
TEST(StructurelessTrack, HasTheCostGradientAndHessianOfATrackWhoseLandmarkIsEliminated) {
  for (unsigned seed = 1; seed <= 5; ++seed)
    for (const int right : {0, 1, 2}) {
      expect_schur_complement<2>(seed, right);
      expect_schur_complement<3>(seed, right);
      expect_schur_complement<5>(seed, right);
      expect_schur_complement<8>(seed, right);
    }
}

// V10
TEST(StructurelessTrack, HasTheJacobianOfItsResidualWhereThePointFitsExactly) {
  Random random(4);
  for (const int right : {0, 1, 2}) {
    const Scene<4> scene(random, 0.0, right);
    const JacobianCheck check =
        scene.with_poses([](const auto& track, const auto&... x) { return check_jacobian(track, 1e-4, x...); });
    EXPECT_LT(check.worst(), 1e-6) << check;
  }
}

// V10
TEST(StructurelessTrack, HasTheExactGradientOfItsCostWhereNothingFits) {
  Random random(5);
  for (int trial = 0; trial < 5; ++trial) {
    const Scene<4> scene(random, 3.0, 2);
    scene.with_poses([](const auto& track, const auto&... x) {
      Vec<double, 13> r;
      Mat<double, 13, 24> J, numeric;
      ASSERT_TRUE(evaluate_residual(track, r, &J, x...));
      ASSERT_TRUE(differentiate_numerically(track, numeric, 1e-5, x...));
      EXPECT_GT(r.norm(), 1.0);
      const auto gradient = transposed_times(J, r), want = transposed_times(numeric, r);
      EXPECT_LT((gradient - want).norm(), 1e-6 * want.norm());
      EXPECT_GT((J - numeric).norm(), 1e-4 * J.norm());  // Kaufman's approximation is one
    });
  }
}

// V10
TEST(StructurelessTrack, MovesItsResidualEvenlyAlongAPathOfPoses) {
  Random random(6);
  Scene<4> scene(random, 2.0, 2);
  Vec<double, 13> before;
  double largest = 0.0;
  for (int k = 0; k <= 4000; ++k) {  // half a turn about the viewing direction
    scene.poses[1].R = (scene.poses[1].R * Rot3d::exp({{0.0, 0.0, 1e-5}})).normalized();
    const Rot3d turn = Rot3d::exp({{0.0, 0.0, 3.2 / 4000}});
    for (Pose3d& p : scene.poses) p = Pose3d{turn, {}} * p;  // the world turns under all of them
    Vec<double, 13> r;
    ASSERT_TRUE(scene.with_poses(
        [&](const auto& track, const auto&... x) { return evaluate_residual(track, r, nullptr, x...); }));
    if (k > 0) largest = std::max(largest, (r - before).norm());
    before = r;
  }
  EXPECT_GT(before.norm(), 1.0);
  EXPECT_LT(largest, 0.05);
}

// V10
TEST(StructurelessTrack, IsNotValidBehindACameraOrWithoutParallax) {
  Random random(7);
  auto valid = [](const auto& scene) {
    return scene.with_poses([](const auto& track, const auto&... x) {
      Vec<double, 5> r;
      Mat<double, 5, 12> J;
      return evaluate_residual(track, r, &J, x...);
    });
  };
  Scene<2> mono(random, 0.0, 0), stereo(random, 0.0, 1);
  EXPECT_TRUE(valid(mono));
  EXPECT_TRUE(valid(stereo));
  mono.poses[1].t = mono.poses[0].t;
  EXPECT_FALSE(valid(mono));
  stereo.poses[1].t = stereo.poses[0].t;
  EXPECT_TRUE(valid(stereo)) << "the baseline is parallax enough";
  Scene<2> crossed(random, 0.0, 0);
  std::swap(crossed.poses[0].t, crossed.poses[1].t);
  EXPECT_FALSE(valid(crossed)) << "the rays meet behind the cameras";
  EXPECT_FALSE(valid(Scene<2>(random, 0.0, 0, 1e5)));
}

// W10
TEST(StructurelessTrack, LeadsToTheSolutionThatLandmarksLeadTo) {
  Random random(8);
  Graph with, without;
  GraphEdit a = with.edit(), b = without.edit();
  const StereoRigd rig = euroc_like_rig();
  const auto rig_a = a.add(rig), rig_b = b.add(rig);
  std::vector<VariableId<Pose3d>> poses_a, poses_b;
  Scene<4> scene(random, 0.0, 2);
  const std::vector<Pose3d> truth = scene.poses;
  for (const Pose3d& p : truth) {
    const Pose3d start = p.plus(random.normal<6>(0.01));
    poses_a.push_back(a.add(start));
    poses_b.push_back(b.add(start));
  }
  a.add(Prior{truth[0]}, Sigma(1e-2), poses_a[0]);
  b.add(Prior{truth[0]}, Sigma(1e-2), poses_b[0]);
  for (int k = 0; k < 20; ++k) {
    Scene<4> next(random, 0.0, 0);
    next.poses = truth;
    for (int i = 0; i < 4; ++i) {
      TrackView& v = next.track.views[i];
      v = {};
      v.pixel0 = next.see(0, truth[i]) + random.normal<2>(1.0);
      v.bearing0 = *rig.cameras[0].camera.unproject(v.pixel0);
      if (i % 2 == 0) continue;
      v.right = 1.0;
      v.pixel1 = next.see(1, truth[i]) + random.normal<2>(1.0);
      v.bearing1 = *rig.cameras[1].camera.unproject(v.pixel1);
    }
    const auto point = a.add(Point3d{next.p_world});
    for (int i = 0; i < 4; ++i) {
      const TrackView& v = next.track.views[i];
      if (v.right != 0.0)
        a.add(StereoPointReprojectiond{v.pixel0, v.pixel1}, Sigma(1.0), poses_a[i], point, rig_a);
      else
        a.add(MonoPointReprojectiond{v.pixel0}, Sigma(1.0), poses_a[i], point, rig_a);
    }
    b.add(next.track, Sigma(1.0), poses_b[0], poses_b[1], poses_b[2], poses_b[3], rig_b);
  }
  ASSERT_TRUE(with.apply(a).ok());
  ASSERT_TRUE(without.apply(b).ok());
  const SolveOptions tight{.function_tolerance = 1e-14};
  const Summary one = NativeEngine(with).solve(tight), two = NativeEngine(without).solve(tight);
  EXPECT_TRUE(one.converged());
  EXPECT_TRUE(two.converged());
  EXPECT_NEAR(one.final_cost, two.final_cost, 1e-9 * one.final_cost);
  for (int i = 0; i < 4; ++i)
    EXPECT_LT(with.value(poses_a[i]).minus(without.value(poses_b[i])).norm(), 1e-6) << "pose " << i;
}

}  // namespace
}  // namespace oriel
