// One file, two graphs, two engines.
#pragma once
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "oriel/engines/ceres/ceres_engine.h"
#include "oriel/io/problem.h"
#include "oriel/io/problem_format.h"
#include "oriel/solve/native_engine.h"

namespace oriel {

inline void read_into(Graph& graph, const std::string& path) {
  const auto format = detect_format(path);
  ASSERT_TRUE(format) << format.error();
  if (*format == ProblemFormat::bal) {
    const auto file = read_bal(path);
    ASSERT_TRUE(file) << file.error();
    ASSERT_TRUE(add_bundle_adjustment(graph, *file, Loss::none()));
    return;
  }
  const auto file = read_g2o(path);
  ASSERT_TRUE(file) << file.error();
  if (file->planar_edges.empty())
    ASSERT_TRUE(add_pose_graph3(graph, *file, {}));
  else
    ASSERT_TRUE(add_pose_graph2(graph, *file, {}));
}

inline double relative_difference(double x, double y) { return std::fabs(x - y) / std::fmax(std::fabs(y), 1e-300); }

// The same cost at the start and at the native optimum (1e-12).
inline Summary expect_same_costs(Graph& graph) {
  NativeEngine native(graph);
  CeresEngine ceres(graph);
  EXPECT_LT(relative_difference(native.cost(), ceres.cost()), 1e-12) << "at the start";
  const Summary x = native.solve(SolveOptions{});
  EXPECT_TRUE(x.converged()) << x;
  EXPECT_LT(relative_difference(native.cost(), ceres.cost()), 1e-12) << "at the optimum";
  return x;
}

// Both, each from the file's start, end at the same cost.
inline void expect_same_cost_and_optimum(const std::string& path) {
  Graph a, b;
  read_into(a, path), read_into(b, path);
  const Summary x = expect_same_costs(a), y = CeresEngine(b).solve({});
  EXPECT_TRUE(y.converged()) << y;
  EXPECT_LT(relative_difference(x.final_cost, y.final_cost), 1e-6) << x << y;
}

// Where native ended, Ceres finds nothing better. (From the start of a bundle adjustment it takes hundreds of steps.)
inline void expect_optimum_confirmed(const std::string& path) {
  Graph graph;
  read_into(graph, path);
  const Summary x = expect_same_costs(graph), y = CeresEngine(graph).solve({.max_iterations = 10});
  EXPECT_FALSE(y.failed()) << y;
  EXPECT_LT(relative_difference(x.final_cost, y.final_cost), 1e-6) << x << y;
}

}  // namespace oriel
