// What a solve goes by where its caller leaves it open.
#include "oriel/solve/defaults.h"

#include <gtest/gtest.h>

#include "oriel/manifold/se2.h"
#include "oriel/manifold/vector.h"

namespace oriel {
namespace {

TEST(Defaults, OneFreeVectorIsARegressionAndNothingElseIs) {
  Graph graph;
  EXPECT_FALSE(is_regression(graph));
  GraphEdit edit = graph.edit();
  edit.add(VectorNd<3>{});
  const auto other = edit.add(VectorNd<2>{});
  ASSERT_TRUE(graph.apply(edit));
  EXPECT_FALSE(is_regression(graph)) << "two vectors";
  edit = graph.edit();
  edit.fix(other);
  ASSERT_TRUE(graph.apply(edit));
  EXPECT_TRUE(is_regression(graph)) << "one of two is fixed";
  edit = graph.edit();
  edit.add(Pose2d{});
  ASSERT_TRUE(graph.apply(edit));
  EXPECT_FALSE(is_regression(graph)) << "a vector and a pose";

  Graph one_pose;
  edit = one_pose.edit();
  edit.add(Pose2d{});
  ASSERT_TRUE(one_pose.apply(edit));
  EXPECT_FALSE(is_regression(one_pose)) << "a pose: a front end waits for it";
}

TEST(Defaults, WhatTheCallerSaysStands) {
  SolveOptions options;
  options.max_iterations = 7, options.function_tolerance = 0.0, options.initial_lambda = 0.5;
  options.initial_radius = 3.0;
  for (const bool regression : {false, true}) {
    const Settled s = settle(options, false, regression);
    EXPECT_EQ(s.max_iterations, 7);
    EXPECT_EQ(s.function_tolerance, 0.0);
    EXPECT_EQ(s.initial_lambda, 0.5);
    EXPECT_EQ(s.initial_radius, 3.0);
  }
  const Settled graph = settle({}, false, false), fit = settle({}, false, true);
  EXPECT_EQ(graph.max_iterations, 100);
  EXPECT_EQ(graph.function_tolerance, 1e-9);
  EXPECT_EQ(graph.gradient_tolerance, 1e-10);
  EXPECT_EQ(graph.step_tolerance, 1e-12);
  EXPECT_EQ(fit.max_iterations, 10000);
  EXPECT_EQ(fit.function_tolerance, 1e-16);
  EXPECT_LT(graph.initial_lambda, settle({}, true, false).initial_lambda);
  EXPECT_LT(settle({}, true, false).initial_lambda, fit.initial_lambda);
}

}  // namespace
}  // namespace oriel
