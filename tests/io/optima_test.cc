// Gauss–Newton and Levenberg–Marquardt come to the known optima of the project's own problem files.
#include <gtest/gtest.h>

#include "oriel/io/problem.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

const std::string kData = ORIEL_DATA_DIR;

// Half of chi² after a solve from the file's own start.
template <class Add>
Summary solve_file(const std::string& name, Method method, Add&& add) {
  const auto file = read_g2o(kData + "/" + name);
  EXPECT_TRUE(file) << file.error();
  Graph graph;
  EXPECT_TRUE(add(graph, *file));
  NativeEngine engine(graph);
  SolveOptions options;
  options.method = method;
  options.function_tolerance = 1e-12;
  Summary summary = engine.solve(options);
  EXPECT_EQ(engine.cost(), summary.final_cost);
  return summary;
}

TEST(Optima, AreReachedByBothMethodsOnAPlanarPoseGraph) {  // L7
  for (const Method method : {Method::gauss_newton, Method::levenberg_marquardt}) {
    const Summary s = solve_file("intel.g2o", method,
                                 [](Graph& g, const PoseGraphFile& f) { return add_pose_graph2(g, f, {}).ok(); });
    EXPECT_TRUE(s.converged()) << s;
    EXPECT_NEAR(s.final_cost, 45.004696 / 2, 1e-6);
    EXPECT_TRUE(s.undetermined.empty() && s.gauge.empty()) << s;
  }
}

TEST(Optima, AreReachedByBothMethodsOnASpatialPoseGraph) {  // L7
  // From chained odometry.
  for (const Method method : {Method::gauss_newton, Method::levenberg_marquardt}) {
    const Summary s = solve_file("sphere2500.g2o", method, [](Graph& g, const PoseGraphFile& f) {
      PoseGraphOptions options;
      options.start = PoseStart::odometry;
      return add_pose_graph3(g, f, options).ok();
    });
    EXPECT_TRUE(s.converged()) << s;
    EXPECT_NEAR(s.final_cost, 727.149667 / 2, 1e-5);
  }
}

TEST(Optima, IsReachedOnABundleAdjustmentWithItsGaugeNamed) {  // L7, L6
  const auto file = read_bal(kData + "/problem-49-7776-pre.txt");
  ASSERT_TRUE(file) << file.error();
  Graph graph;
  ASSERT_TRUE(add_bundle_adjustment(graph, *file, Loss::none()));
  NativeEngine engine(graph);
  SolveOptions options;
  options.max_iterations = 60;
  const Summary s = engine.solve(options);
  EXPECT_NEAR(s.initial_cost, 8.509125e5, 1.0);
  EXPECT_LE(s.final_cost, 1.334435e4 * (1 + 1e-4)) << s;
  EXPECT_EQ(s.kept_dim, 49 * 9);
  EXPECT_EQ(s.landmark_dim, 7776 * 3);
  EXPECT_EQ(s.kernel_fallbacks, 0);
}

}  // namespace
}  // namespace oriel
