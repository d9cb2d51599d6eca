// The reduced system gives the step of the full one, whatever is eliminated and whatever is kept.
#include "oriel/linear/landmark_schur.h"

#include <gtest/gtest.h>

#include "linear/random_problem.h"
#include "oriel/linear/block_matrix.h"
#include "oriel/linear/hessian_product.h"

namespace oriel {
namespace {

using testing::Markd;
using testing::RandomProblem;
using testing::System;

Eigen::MatrixXd dense(const BlockMatrix& m) {
  Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(m.dim(), m.dim()), out(m.dim(), m.dim());
  const auto n = static_cast<std::size_t>(unit.size());
  m.multiply({unit.data(), n}, m.dim(), {out.data(), n});
  return out;
}

// H, g, cost and the damped step against dense algebra.
void expect_dense(const RandomProblem& problem, System& system, double tolerance = 1e-10) {
  const auto d = problem.dense(system.structure);
  const double scale = 1.0 + d.h.norm();
  EXPECT_LE((dense(hessian(problem.graph, system.structure, system.numbers)) - d.h).norm(), 1e-12 * scale);
  EXPECT_LE((system.gradient() - d.g).norm(), 1e-12 * (1.0 + d.g.norm()));
  EXPECT_NEAR(system.active.total, d.cost, 1e-12 * d.cost);
  for (int i = 0; i < system.structure.dim(); ++i)
    ASSERT_NEAR(system.numbers.diagonal[static_cast<std::size_t>(i)], d.h(i, i), 1e-12 * scale);
  HessianProduct product;
  product.prepare(system.structure);
  const Eigen::VectorXd x = Eigen::VectorXd::LinSpaced(system.structure.dim(), -1.0, 2.0);
  Eigen::VectorXd hx(x.size());
  product.whole(system.structure, system.numbers, x.data(), hx.data());
  EXPECT_LE((hx - d.h * x).norm(), 1e-12 * scale * x.norm());
  const Eigen::VectorXd damping = Eigen::VectorXd::LinSpaced(system.structure.dim(), 0.3, 0.9);
  const Eigen::VectorXd step = system.solve(damping), expected = testing::dense_step(d, damping);
  EXPECT_LE((step - expected).norm(), tolerance * (1.0 + expected.norm()));
}

TEST(LandmarkSchur, SolvesTheSameSystemAsDenseWithEveryKindOfLandmarkAndVariable) {  // L2
  for (unsigned seed = 1; seed <= 4; ++seed) {
    RandomProblem p(seed);
    const auto k1 = p.variables<VectorNd<1>>(3);
    const auto k2 = p.variables<VectorNd<2>>(3);
    const auto k3 = p.variables<VectorNd<3>>(3);
    const auto k6 = p.variables<VectorNd<6>>(3);
    const auto k7 = p.variables<VectorNd<7>>(2);
    const auto k9 = p.variables<VectorNd<9>>(2);
    const auto k4 = p.variables<VectorNd<4>>(2);
    const auto k5 = p.variables<VectorNd<5>>(2);
    const auto k8 = p.variables<VectorNd<8>>(2);
    const auto l1 = p.variables<Markd<1>>(7);
    const auto l2 = p.variables<Markd<2>>(7);
    const auto l3 = p.variables<Markd<3>>(7);
    for (int i = 0; i < 30; ++i) {
      const Loss loss = i % 3 == 0 ? Huber(0.5) : i % 3 == 1 ? Cauchy(0.7) : Loss::none();
      p.factor<2>(loss, p.any(k6), p.any(l3));
      p.factor<2>(loss, p.any(k3), p.any(l2));
      p.factor<1>(loss, p.any(l1), p.any(k9));  // a landmark on the left
      p.factor<3>(loss, p.any(k7), p.any(l2));
      p.factor<2>(loss, p.any(l3), p.any(k4), p.any(k1));
      p.factor<1>(p.any(k5), p.any(l3), p.any(k8));
      p.factor<2>(p.any(k2), p.any(k6));
      p.factor<3>(p.any(k9), p.any(k4));
      p.factor<2>(p.any(k8), p.any(k7));
      p.factor<2>(p.any(k6), p.any(k6));  // now and then the same one twice
    }
    p.factor<2>(l3[0]);
    p.factor<2>(l2[1], l3[1]);  // two landmarks: one of them is kept
    p.factor<2>(l3[2], l3[3]);
    p.factor<2>(l3[4], l3[4]);  // the same landmark twice
    p.factor<2>(k3[0], k3[0]);
    p.prior({l3[5], k6[0]}, {3, 6}, 7);  // a landmark that a prior touches is kept
    p.prior({k1[0], k8[0], k2[2]}, {1, 8, 2}, 5);
    p.fix(l2[3]), p.fix(l1[2]), p.fix(k6[1]), p.fix(k4[0]), p.fix(k5[1]);
    ASSERT_TRUE(p.apply());
    System system(p.graph);
    EXPECT_GT(system.linearizer.kernel_fallbacks(), 0);
    EXPECT_EQ(system.structure.landmarks().size(), 21u - 2u - 1u - 1u - 1u - 1u);
    expect_dense(p, system);
  }
}

TEST(LandmarkSchur, EliminatesByPanelWhereAllSeeAllAndByBlocksWhereFewSeeEach) {  // L2
  for (const bool all : {true, false}) {
    RandomProblem p(17);
    const auto poses = p.variables<VectorNd<6>>(all ? 10 : 60);
    const auto velocities = p.variables<VectorNd<3>>(10);
    const auto marks = p.variables<Markd<3>>(50);
    for (std::size_t m = 0; m < marks.size(); ++m)
      for (std::size_t k = 0; k < (all ? poses.size() : 3); ++k)
        p.factor<2>(poses[all ? k : (m + k * 7) % poses.size()], marks[m]);
    for (std::size_t k = 0; k + 1 < 10; ++k) p.factor<6>(poses[k], velocities[k], poses[k + 1], velocities[k + 1]);
    ASSERT_TRUE(p.apply());
    System system(p.graph);
    EXPECT_EQ(system.structure.landmark_panel(), all);
    expect_dense(p, system);
  }
}

TEST(LandmarkSchur, SolvesTheSameSystemAsDenseInTwoSlices) {  // L2
  RandomProblem p(23);
  const auto poses = p.variables<VectorNd<6>>(120);
  const auto marks = p.variables<Markd<3>>(180);
  for (std::size_t m = 0; m < marks.size(); ++m)
    for (std::size_t k = 0; k < 18; ++k) p.factor<2>(poses[(m * 5 + k * 3) % poses.size()], marks[m]);
  ASSERT_TRUE(p.apply());
  System system(p.graph);
  EXPECT_FALSE(system.structure.landmark_panel());
  EXPECT_GT(system.structure.landmark_flops(), 4e6);
  expect_dense(p, system, 1e-9);
}

TEST(LandmarkSchur, SolvesWithoutAnyKeptVariable) {  // L2
  RandomProblem p(3);
  const auto poses = p.variables<VectorNd<6>>(4);
  const auto marks = p.variables<Markd<3>>(20);
  for (const auto m : marks)
    for (const auto x : poses) p.factor<2>(x, m);
  for (const auto x : poses) p.fix(x);
  ASSERT_TRUE(p.apply());
  System system(p.graph);
  EXPECT_EQ(system.structure.kept_dim(), 0);
  EXPECT_EQ(system.structure.dim(), 60);
  expect_dense(p, system);
}

TEST(LandmarkSchur, SolvesWhereNoLandmarkIsLeft) {  // L2
  RandomProblem p(3);
  const auto poses = p.variables<VectorNd<6>>(4);
  const auto marks = p.variables<Markd<3>>(5);
  for (const auto m : marks)
    for (const auto x : poses) p.factor<2>(x, m);
  for (const auto m : marks) p.fix(m);
  ASSERT_TRUE(p.apply());
  System system(p.graph);
  EXPECT_TRUE(system.structure.landmarks().empty());
  expect_dense(p, system);
}

TEST(LandmarkSchur, LeavesALandmarkWithoutFactorsWhereItIs) {  // L2, L6
  RandomProblem p(29);
  const auto x = p.variable<VectorNd<6>>();
  const auto seen = p.variable<Markd<3>>();
  const auto alone = p.variable<Markd<2>>();
  for (int i = 0; i < 6; ++i) p.factor<3>(x, seen);
  ASSERT_TRUE(p.apply());
  System system(p.graph);
  const Eigen::VectorXd step = system.solve(Eigen::VectorXd::Zero(11));
  const int at = p.offset(system.structure, alone);
  EXPECT_EQ(step[at], 0.0);
  EXPECT_EQ(step[at + 1], 0.0);
  EXPECT_EQ(system.schur.undetermined(), (std::vector<int>{at, at + 1}));
  const auto d = p.dense(system.structure);
  const Eigen::VectorXd rest = d.h.topLeftCorner(9, 9).ldlt().solve(-d.g.head(9));
  Eigen::VectorXd compare(9);
  compare.head(6) = step.head(6);
  compare.tail(3) = step.segment(p.offset(system.structure, seen), 3);
  if (p.offset(system.structure, seen) == 6) {
    EXPECT_LE((compare - rest).norm(), 1e-8 * (1 + rest.norm()));
  }
}

TEST(LandmarkSchur, KeepsAUserLandmarkOfFourDimensionsInTheReducedSystem) {  // V9, L2
  // Elimination has kernels up to dimension 3; what is larger is a variable like any other.
  RandomProblem p(31);
  const auto x = p.variables<VectorNd<6>>(3);
  const auto big = p.variables<Markd<4>>(5);
  for (const auto b : big)
    for (const auto k : x) p.factor<3>(k, b);
  ASSERT_TRUE(p.apply());
  System system(p.graph);
  EXPECT_TRUE(system.structure.landmarks().empty());
  expect_dense(p, system);
}

}  // namespace
}  // namespace oriel
