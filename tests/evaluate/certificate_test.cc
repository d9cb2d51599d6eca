// The lower bound of a pose graph against costs that are found from many starts, other minima among them.
#include "oriel/evaluate/certificate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace oriel {
namespace {

// F, written down once more.
double cost_of(const std::vector<Pose2d>& poses, const std::vector<IsotropicEdge<2>>& edges) {
  double f = 0.0;
  for (const IsotropicEdge<2>& e : edges) {
    const Pose2d &a = poses[static_cast<std::size_t>(e.from)], &b = poses[static_cast<std::size_t>(e.to)];
    const Rot2d expected = a.R * Rot2d{e.R(0, 0), e.R(1, 0)};
    const double dc = b.R.c - expected.c, ds = b.R.s - expected.s;
    f += 0.5 * (e.kappa * 2.0 * (dc * dc + ds * ds) + e.tau * (b.t - a.t - a.R * e.t).squared_norm());
  }
  return f;
}

// A ring whose measurements are all of one turn, or of none: as many turns are local minima.
struct Ring {
  std::vector<Pose2d> poses;
  std::vector<IsotropicEdge<2>> edges;
  explicit Ring(int n, double turns, unsigned seed = 1, double noise = 0.0) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal(0.0, 1.0);
    const double angle = 2.0 * M_PI / n;
    for (int i = 0; i < n; ++i) {
      poses.push_back({Rot2d::exp(turns * angle * i), {{std::cos(angle * i), std::sin(angle * i)}}});
      const Rot2d R = Rot2d::exp(angle + noise * normal(random));
      edges.push_back({i, (i + 1) % n, {{R.c, R.s, -R.s, R.c}}, {{1.0, 0.1 * noise * normal(random)}}, 50.0, 100.0});
    }
  }
};

TEST(Certificate, IsGivenToPosesThatFitTheirMeasurements) {
  Ring ring(24, 1.0, 3, 0.02);
  const Certificate c = certify(ring.poses, ring.edges);
  EXPECT_TRUE(c.stationary);
  EXPECT_TRUE(c.certified()) << c.gap();
  EXPECT_LE(c.lower_bound, c.cost);
  EXPECT_NEAR(c.cost, cost_of(ring.poses, ring.edges), 1e-9 * c.cost);
}

TEST(Certificate, IsRefusedToAMinimumThatIsNotTheLeastOne) {
  Ring good(24, 1.0, 3, 0.02), twisted(24, 2.0, 3, 0.02);
  const Certificate best = certify(good.poses, good.edges), other = certify(twisted.poses, twisted.edges);
  ASSERT_TRUE(best.certified());
  ASSERT_GT(other.cost, 1.5 * best.cost) << "the twisted ring was to stay twisted";
  EXPECT_TRUE(other.stationary);
  EXPECT_FALSE(other.certified());
  EXPECT_LE(other.lower_bound, best.cost * (1.0 + 1e-9));
}

// Whatever the poses, and however they were found, none may cost less than the bound.
TEST(Certificate, BoundsWhatAnyPosesCost) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal(0.0, 1.0);
  int certified = 0, other_minima = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    Ring ring(8, 1.0, seed, 0.1);
    for (int k = 0; k < static_cast<int>(seed % 3); ++k) {  // chords that contradict it
      const Rot2d R = Rot2d::exp(normal(random));
      ring.edges.push_back({k, k + 3, {{R.c, R.s, -R.s, R.c}}, {{normal(random), normal(random)}}, 20.0, 30.0});
    }
    std::vector<Certificate> all;
    for (int start = 0; start < 8; ++start) {
      std::vector<Pose2d> poses = ring.poses;
      for (Pose2d& p : poses) p = p.plus({{start * normal(random), start * normal(random), start * normal(random)}});
      all.push_back(certify(poses, ring.edges));
      EXPECT_NEAR(all.back().cost, cost_of(poses, ring.edges), 1e-9 * all.back().cost);
    }
    for (const Certificate& a : all)
      for (const Certificate& b : all) EXPECT_LE(a.lower_bound, b.cost * (1.0 + 1e-9)) << "seed " << seed;
    const auto costs = std::minmax_element(all.begin(), all.end(), [](auto& a, auto& b) { return a.cost < b.cost; });
    certified += costs.first->certified();
    other_minima += costs.second->cost > 1.01 * costs.first->cost;
  }
  EXPECT_GE(certified, 10);
  EXPECT_GE(other_minima, 5);
}

TEST(Certificate, SaysThatAGraphWithLandmarksIsNotForIt) {
  PoseGraphFile file;
  file.file_name = "some.g2o";
  file.planar_sightings.push_back({0, 0, {{1.0, 0.0}}, {1.0, 0.0, 1.0}, 7});
  EXPECT_EQ(isotropic_edges2(file).error().message,
            "some.g2o: a certificate is for poses alone, and this has landmarks");
}

TEST(Certificate, NamesTheLineOfAnEdgeThatSaysNothingOfRotation) {
  PoseGraphFile file;
  file.file_name = "some.g2o";
  file.planar_edges.push_back({0, 1, {{1.0, 0.0, 0.0}}, {1.0, 0.0, 0.0, 1.0, 0.0, 0.0}, 7});
  const auto edges = isotropic_edges2(file);
  ASSERT_FALSE(edges);
  EXPECT_EQ(edges.error().line, 7);
}

}  // namespace
}  // namespace oriel
