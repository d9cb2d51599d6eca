// Directions that are held, through Ceres: the same cost, the same optimum and the same covariances as the native
// engine, and one ceres::Problem that is followed without making a residual anew.
#include <gtest/gtest.h>

#include <bit>
#include <cstring>
#include <set>

#include "engines/two_engines.h"
#include "oriel/engines/ceres/ceres_problem.h"
#include "solve/freedom_world.h"

namespace oriel {
namespace {

using testing_freedom::World;

// Those whose free directions are closed: the optimum does not depend on the way there.
void restrict_closed(World& w) {
  for (const auto id : w.poses) w.set(id, Freedom::planar());
  w.set(w.poses[0], Freedom::rotation());
  w.set(w.poses[3], Freedom::yaw());
  w.set(w.poses[5], Freedom::yaw_and_position());
  w.set(w.poses[6], Freedom::position());
  w.set(w.velocities[1], Freedom::hold({0, 2}));
  w.set(w.points[0], Freedom::hold({2}));
  w.set(w.points[1], Freedom::hold({0, 1}, Freedom::Axes::world));
}

void expect_same_values(World& a, World& b, double tolerance) {
  for (std::size_t i = 0; i < a.poses.size(); ++i) {
    EXPECT_LT(a.graph.value(a.poses[i]).minus(b.graph.value(b.poses[i])).norm(), tolerance) << i;
    EXPECT_LT(a.graph.value(a.velocities[i]).minus(b.graph.value(b.velocities[i])).norm(), tolerance) << i;
  }
  for (std::size_t i = 0; i < a.points.size(); ++i)
    EXPECT_LT(a.graph.value(a.points[i]).minus(b.graph.value(b.points[i])).norm(), tolerance) << i;
}

// C8
TEST(CeresFreedom, FindsTheOptimumThatTheNativeEngineFinds) {
  World a(8, 24, 3), b(8, 24, 3);
  restrict_closed(a), restrict_closed(b);
  NativeEngine native(a.graph);
  CeresEngine ceres(b.graph);
  EXPECT_LT(relative_difference(native.cost(), ceres.cost()), 1e-12);
  SolveOptions options;
  options.function_tolerance = 1e-15, options.max_iterations = 200;
  const Summary x = native.solve(options), y = ceres.solve(options);
  EXPECT_TRUE(x.converged() && y.converged()) << x << y;
  EXPECT_LT(x.final_cost, 0.9 * x.initial_cost);
  EXPECT_LT(relative_difference(x.final_cost, y.final_cost), 1e-9);
  expect_same_values(a, b, 1e-6);
  EXPECT_LT(relative_difference(CeresEngine(a.graph).cost(), native.cost()), 1e-12);
}

// C8: with what marginalization leaves, on variables that are restricted and others; first estimates off.
TEST(CeresFreedom, FindsTheSameOptimumWithALinearPrior) {
  World a(8, 24, 3), b(8, 24, 3);
  for (World* w : {&a, &b}) restrict_closed(*w), w->add_prior();
  NativeEngine native(a.graph);
  CeresEngine ceres(b.graph);
  EXPECT_LT(relative_difference(native.cost(), ceres.cost()), 1e-12);
  SolveOptions options;
  options.function_tolerance = 1e-15, options.max_iterations = 200, options.first_estimates = false;
  const Summary x = native.solve(options), y = ceres.solve(options);
  EXPECT_TRUE(x.converged() && y.converged()) << x << y;
  EXPECT_LT(relative_difference(x.final_cost, y.final_cost), 1e-6);
}

// C6, C7: set, replaced, taken back while both follow; after each the optimum is that of the moment.
TEST(CeresFreedom, FollowsWhatIsSetReplacedAndTakenBack) {
  World a(6, 12, 3), b(6, 12, 3);
  NativeEngine native(a.graph);
  CeresEngine ceres(b.graph);
  SolveOptions options;
  options.function_tolerance = 1e-15, options.max_iterations = 200;
  for (const Freedom& f : {Freedom::yaw(), Freedom::planar(), Freedom::full(), Freedom::position(), Freedom::full()}) {
    for (World* w : {&a, &b})
      for (const std::size_t k : {1u, 2u, 4u}) w->set(w->poses[k], f);
    const auto ok = check(ceres, b.graph);
    ASSERT_TRUE(ok) << ok.error();
    const Summary x = native.solve(options), y = ceres.solve(options);
    EXPECT_LT(relative_difference(x.initial_cost, y.initial_cost), 1e-6);
    EXPECT_LT(relative_difference(x.final_cost, y.final_cost), 1e-9);
    expect_same_values(a, b, 1e-5);
    EXPECT_TRUE(check(ceres, b.graph));
  }
}

// C6: fixed and restricted in whatever order; fixed is stronger, and what was held is held after it.
TEST(CeresFreedom, IsKeptWhileItsVariableIsFixed) {
  World w(4, 4, 2);
  CeresEngine ceres(w.graph);
  const Pose3d before = w.graph.value(w.poses[1]);
  GraphEdit edit = w.graph.edit();
  edit.fix(w.poses[1]);
  edit.set(w.poses[1], Freedom::yaw());
  ASSERT_TRUE(w.graph.apply(edit));
  ASSERT_GT(ceres.solve().accepted, 0);
  EXPECT_EQ(std::memcmp(&w.graph.value(w.poses[1]), &before, sizeof(before)), 0);
  edit.clear();
  edit.fix(w.poses[1], false);
  ASSERT_TRUE(w.graph.apply(edit));
  ASSERT_TRUE(check(ceres, w.graph));
  ASSERT_GT(ceres.solve().accepted, 0);
  const Pose3d after = w.graph.value(w.poses[1]);
  EXPECT_EQ((after.translation() - before.translation()).norm(), 0.0);
  EXPECT_GT(after.minus(before).norm(), 1e-4);
}

int free_scalars(const ceres::Problem& problem) {
  std::vector<double*> blocks;
  problem.GetParameterBlocks(&blocks);
  int n = 0;
  for (const double* b : blocks) n += problem.ParameterBlockTangentSize(b);
  return n;
}

// C3
TEST(CeresFreedom, KeepsEveryResidualBlock) {
  World w;
  const Subscription follower = w.graph.subscribe();
  ceres_detail::CeresProblem problem;
  GraphEdit net;
  const auto look = [&] {
    w.graph.collect(follower, net);
    problem.apply(net);
    problem.take_values(w.graph);
    std::vector<ceres::ResidualBlockId> blocks;
    problem.problem().GetResidualBlocks(&blocks);
    return std::set<ceres::ResidualBlockId>(blocks.begin(), blocks.end());
  };
  const auto before = look();
  const int tangent = free_scalars(problem.problem());
  restrict_closed(w);
  EXPECT_EQ(look(), before);
  EXPECT_EQ(free_scalars(problem.problem()), tangent - (4 * 3 + 3 + 5 + 2 + 3) - 2 - (1 + 2));
  for (const auto id : w.poses) w.set(id, Freedom::full());
  EXPECT_EQ(look(), before);
}

// L11
TEST(CeresFreedom, HasTheCovariancesOfTheNativeEngine) {
  World w(6, 12, 3);
  w.restrict_some();
  NativeEngine native(w.graph);
  CeresEngine ceres(w.graph);
  ASSERT_TRUE(native.solve({.first_estimates = false}).converged());
  const std::vector<VariableKey> ids = {w.poses[1], w.points[0], w.velocities[1], w.poses[5], w.poses[4]};
  const auto x = native.joint_covariance(ids), y = ceres.joint_covariance(ids);
  ASSERT_TRUE(x) << x.error();
  ASSERT_TRUE(y) << y.error();
  ASSERT_EQ(x->size(), y->size());
  double largest = 0.0;
  for (const double v : *x) largest = std::max(largest, std::fabs(v));
  for (std::size_t i = 0; i < x->size(); ++i) EXPECT_NEAR((*x)[i], (*y)[i], 1e-8 * largest) << i;
}

// (x ⊞ δ) ⊟ x = δ, and the two Jacobians undo each other; where a block is all values, x ⊞ δ has the slope that is
// told.
void expect_laws(const VariableOps& ops, const Freedom& freedom, const std::vector<double>& x) {
  const ceres_detail::FreeManifold manifold(ops, freedom);
  const int n = manifold.TangentSize(), m = manifold.AmbientSize();
  EXPECT_EQ(n, ops.dim - std::popcount(freedom.held));
  Eigen::VectorXd delta = Eigen::VectorXd::Constant(n, 0.2), y(m), back(n);
  ASSERT_TRUE(manifold.Plus(x.data(), delta.data(), y.data()));
  ASSERT_TRUE(manifold.Minus(y.data(), x.data(), back.data()));
  EXPECT_LT((back - delta).norm(), 1e-12);
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Rows plus(m, n), minus(n, m);
  ASSERT_TRUE(manifold.PlusJacobian(x.data(), plus.data()));
  ASSERT_TRUE(manifold.MinusJacobian(x.data(), minus.data()));
  EXPECT_LT((minus * plus - Rows::Identity(n, n)).norm(), 1e-12);
  if (m != ops.dim) return;
  for (int k = 0; k < n; ++k) {
    delta = Eigen::VectorXd::Unit(n, k);
    ASSERT_TRUE(manifold.Plus(x.data(), delta.data(), y.data()));
    for (int i = 0; i < m; ++i) EXPECT_NEAR(y[i] - x[static_cast<std::size_t>(i)], plus(i, k), 1e-14);
  }
}

TEST(CeresFreedom, IsAManifoldByTheLawsOfOne) {
  for (const Freedom& f : {Freedom::hold({1}), Freedom::hold({0, 2}, Freedom::Axes::world)})
    expect_laws(kVariableOps<Velocity3d>, f, {1.0, -2.0, 0.5});
  const Pose3d pose = Pose3d{}.plus({{0.4, -1.1, 0.7, 3.0, -2.0, 0.5}});
  std::vector<double> x(estimate_doubles(kVariableOps<Pose3d>));
  std::memcpy(x.data(), &pose, sizeof(pose));
  for (const Freedom& f : {Freedom::position(), Freedom::yaw(), Freedom::hold({1, 3}, Freedom::Axes::world)})
    expect_laws(kVariableOps<Pose3d>, f, x);
}

}  // namespace
}  // namespace oriel
