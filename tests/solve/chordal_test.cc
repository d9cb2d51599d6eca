// Rotations first, then places: what it finds without noise, and how near the minimum it is with noise.
#include "oriel/solve/chordal.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace oriel {
namespace {

template <class Pose>
Pose random_pose(std::mt19937& random, double scale) {
  std::normal_distribution<double> normal;
  Vec<double, Pose::kDim> d;
  for (int i = 0; i < Pose::kDim; ++i) d[i] = scale * normal(random);
  return Pose{}.plus(d);
}

template <class Pose>
struct World {
  std::vector<Pose> truth;
  std::vector<RelativePose<Pose>> edges;

  // A chain with loops, every edge disturbed by `noise`; pose 0 is the identity.
  World(unsigned seed, int n, double noise) {
    std::mt19937 random(seed);
    truth.push_back(Pose{});
    for (int i = 1; i < n; ++i) truth.push_back(truth.back() * random_pose<Pose>(random, 1.0));
    auto add = [&](int i, int j) {
      RelativePose<Pose> e{i, j, truth[i].inverse() * truth[j] * random_pose<Pose>(random, noise), 1.0, {}};
      e.translation_information = decltype(e.translation_information)::identity();
      edges.push_back(e);
    };
    for (int i = 1; i < n; ++i) add(i - 1, i);
    for (int i = 0; i < 2 * n; ++i) {
      const int a = static_cast<int>(random() % n), b = static_cast<int>(random() % n);
      if (a != b) add(a, b);  // backward ones too
    }
  }
};

template <class Pose>
double worst(const std::vector<Pose>& a, const std::vector<Pose>& b) {
  double most = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, a[i].minus(b[i]).norm());
  return most;
}

TEST(ChordalStart, IsExactWithoutNoiseHoweverFarThePosesTurn) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const World<Pose2d> plane(seed, 60, 0.0);
    const World<Pose3d> space(seed, 60, 0.0);
    const auto flat = chordal_start(60, plane.edges);
    const auto solid = chordal_start(60, space.edges);
    ASSERT_TRUE(flat) << flat.error();
    ASSERT_TRUE(solid) << solid.error();
    EXPECT_LT(worst(*flat, plane.truth), 1e-9);
    EXPECT_LT(worst(*solid, space.truth), 1e-9);
  }
}

TEST(ChordalStart, IsNearTheTruthWithNoise) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const World<Pose3d> space(seed, 100, 0.05);
    const auto solid = chordal_start(100, space.edges);
    ASSERT_TRUE(solid);
    for (std::size_t i = 0; i < space.truth.size(); ++i) EXPECT_LT((*solid)[i].R.minus(space.truth[i].R).norm(), 0.2);
    for (const Pose3d& x : *solid)
      EXPECT_NEAR((x.R.matrix() * x.R.matrix().transposed() - Mat3d::identity()).norm(), 0.0, 1e-12);
  }
}

TEST(ChordalStart, KeepsWhatIsKnownAndBeginsEachOtherPieceAtItsFirstPose) {
  std::mt19937 random(3);
  const Pose3d known = random_pose<Pose3d>(random, 2.0), step = random_pose<Pose3d>(random, 1.0);
  const std::vector<RelativePose<Pose3d>> edges = {{0, 1, step, 1.0, Mat3d::identity()},
                                                   {3, 2, step, 1.0, Mat3d::identity()}};
  const std::vector<KnownPose<Pose3d>> at = {{1, known}};
  const auto poses = chordal_start(5, edges, at);
  ASSERT_TRUE(poses) << poses.error();
  EXPECT_LT((*poses)[1].minus(known).norm(), 1e-15);
  EXPECT_LT((*poses)[0].minus(known * step.inverse()).norm(), 1e-12);
  EXPECT_EQ((*poses)[2].minus(Pose3d{}).norm(), 0.0);
  EXPECT_LT((*poses)[3].minus(step.inverse()).norm(), 1e-12);
  EXPECT_EQ((*poses)[4].minus(Pose3d{}).norm(), 0.0);
}

TEST(ChordalStart, SaysThatAPlaceIsUndeterminedOrAnEndDoesNotExist) {
  const std::vector<RelativePose<Pose2d>> placeless = {{0, 1, Pose2d{}, 1.0, {{0, 0, 0, 0}}}};
  const auto poses = chordal_start(2, placeless);
  ASSERT_FALSE(poses);
  EXPECT_EQ(poses.error().code, ErrorCode::singular);
  const std::vector<RelativePose<Pose2d>> outside = {{0, 7, Pose2d{}, 1.0, {{1, 0, 0, 1}}}};
  EXPECT_EQ(chordal_start(2, outside).error().code, ErrorCode::bad_input);
  const std::vector<RelativePose<Pose2d>> weightless = {{0, 1, Pose2d{Rot2d::exp(1.0), {}}, 0.0, {{1, 0, 0, 1}}}};
  const auto apart = chordal_start(2, weightless);
  ASSERT_TRUE(apart);
  EXPECT_EQ((*apart)[1].minus(Pose2d{}).norm(), 0.0);
}

}  // namespace
}  // namespace oriel
