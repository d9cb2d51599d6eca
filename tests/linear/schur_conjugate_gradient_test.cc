// The reduced system without the reduced system: the same step as dense algebra, and a choice that follows the sizes.
#include "oriel/linear/schur_conjugate_gradient.h"

#include <gtest/gtest.h>

#include "linear/random_problem.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

using testing::Markd;
using testing::RandomProblem;
using Camera = VectorNd<6>;

// Cameras that see points; some know of each other, and one has a prior.
RandomProblem bundle(unsigned seed, int cameras, int points, int sightings) {
  RandomProblem p(seed);
  p.curvature = 0.01;
  const auto c = p.variables<Camera>(cameras);
  const auto l3 = p.variables<Markd<3>>(points);
  const auto l1 = p.variables<Markd<1>>(points);
  for (int i = 0; i < sightings; ++i) {
    p.factor<2>(p.any(c), p.any(l3));
    p.factor<2>(p.any(c), p.any(c), p.any(l1));  // two cameras and a landmark in one factor
  }
  for (const auto& id : c) p.factor<6>(id);
  for (const auto& id : l3) p.factor<3>(id);
  for (const auto& id : l1) p.factor<1>(id);
  for (int i = 1; i < cameras; ++i) p.factor<3>(Huber(1.0), c[i - 1], c[i]);
  p.prior({c[0], c[1]}, {6, 6}, 12);
  EXPECT_TRUE(p.apply());
  return p;
}

SolveOptions with(LinearSolver solver) {
  SolveOptions o;
  o.linear_solver = solver;
  o.conjugate_gradient = {1e-16, 2000};
  o.first_estimates = false;
  return o;
}

// L2
TEST(SchurConjugateGradient, GivesTheStepOfDenseAlgebra) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const RandomProblem p = bundle(seed, 8 + 40 * (seed % 2), 30, 120);
    LinearStructure structure;
    FactorOptions options;
    options.linear_solver = LinearSolver::conjugate_gradient;
    ASSERT_TRUE(structure.build(p.graph, options));
    ASSERT_FALSE(structure.forms_reduced());
    Point point;
    point.take(p.graph);
    Linearizer linearizer;
    linearizer.first_estimates = false;
    ActiveSet active;
    LinearSystem system;
    linearizer.evaluate(p.graph, structure, point, nullptr, active, nullptr);
    linearizer.linearize(p.graph, structure, point, &active, system, nullptr);
    const auto dense = p.dense(structure);
    const Eigen::VectorXd damping = Eigen::VectorXd::LinSpaced(structure.dim(), 0.2, 0.7),
                          expected = testing::dense_step(dense, damping);
    HessianProduct product;
    product.prepare(structure);
    const Eigen::VectorXd x = Eigen::VectorXd::LinSpaced(structure.dim(), -1.0, 2.0);
    Eigen::VectorXd hx(x.size());
    product.whole(structure, system, x.data(), hx.data());
    EXPECT_LE((hx - dense.h * x).norm(), 1e-12 * dense.h.norm() * x.norm());
    SchurConjugateGradient cg;
    cg.prepare(structure);
    Eigen::VectorXd step(structure.dim());
    const auto report = cg.solve(structure, system, product, damping.data(), {1e-16, 2000}, step.data(), nullptr);
    EXPECT_TRUE(report.finite);
    EXPECT_GT(report.iterations, 1);
    EXPECT_LE((step - expected).norm(), 1e-8 * (1.0 + expected.norm())) << "seed " << seed;
  }
}

// L2, L10
TEST(SchurConjugateGradient, FindsTheMinimumOfADirectSolveWithTheSameBitsForAnyNumberOfThreads) {
  RandomProblem a = bundle(7, 12, 60, 200), b = bundle(7, 12, 60, 200), c = bundle(7, 12, 60, 200);
  const Summary direct = NativeEngine(a.graph).solve(with(LinearSolver::direct));
  SolveOptions options = with(LinearSolver::conjugate_gradient);
  const Summary one = NativeEngine(b.graph).solve(options);
  options.threads = 2;
  const Summary two = NativeEngine(c.graph).solve(options);
  EXPECT_TRUE(one.converged());
  EXPECT_NEAR(one.final_cost, direct.final_cost, 1e-9 * direct.final_cost);
  EXPECT_EQ(one.final_cost, two.final_cost);
  EXPECT_EQ(one.linear_iterations, two.linear_iterations);
  EXPECT_GT(one.linear_iterations, 0);
  EXPECT_STREQ(one.linear_solver, "landmark_schur+conjugate_gradient");
  EXPECT_EQ(direct.linear_iterations, 0);
}

TEST(LinearSolver, IsChosenByTheSizes) {
  // Few cameras: direct. Many, each pair of which sees a point: the reduced system would be dense and large.
  for (const bool large : {false, true}) {
    const RandomProblem p = bundle(3, large ? 1500 : 20, 3000, 9000);
    LinearStructure structure;
    FactorOptions options;
    options.linear_solver = LinearSolver::automatic;
    ASSERT_TRUE(structure.build(p.graph, options));
    EXPECT_EQ(structure.forms_reduced(), !large);
  }
}

// L11
TEST(SchurConjugateGradient, LeavesCovariancesToADirectSolve) {
  RandomProblem a = bundle(9, 6, 20, 80), b = bundle(9, 6, 20, 80);
  NativeEngine direct(a.graph), iterative(b.graph);
  (void)direct.solve(with(LinearSolver::direct));
  (void)iterative.solve(with(LinearSolver::conjugate_gradient));
  const VariablePool& pool = *a.graph.pools()[0];
  const VariableKey id[] = {{pool.ops().key, pool.slots().key(0)}};
  const auto expected = direct.joint_covariance(id), found = iterative.joint_covariance(id);
  ASSERT_TRUE(expected);
  ASSERT_TRUE(found);
  for (std::size_t i = 0; i < expected->size(); ++i) EXPECT_NEAR((*found)[i], (*expected)[i], 1e-6 * (*expected)[0]);
}

}  // namespace
}  // namespace oriel
