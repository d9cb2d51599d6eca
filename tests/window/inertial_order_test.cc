// An IMU's window ends where it ends, in whatever order its fixes came: motions that are split are preintegrated anew.
#include <gtest/gtest.h>

#include "fixed_flight.h"

namespace oriel {
namespace {

WindowOptions to_the_optimum() {
  WindowOptions o;
  o.solve.max_iterations = 40;
  o.solve.function_tolerance = 1e-15;
  return o;
}

// W8: the biases are known as well as a start at rest knows them. A motion is preintegrated about those of its older
// state at that time, so that orders differ by the second order in how far biases have moved since (1.5e-6 m here):
// that may be no more than a thousandth of what a fix is uncertain by.
TEST(InertialOrder, EndsAtTheSameOptimumInAnyOrderOfArrival) {
  const SimulatedFlight flight({.rest_s = 0.3, .duration_s = 3.0, .points = 0});
  const std::vector<std::vector<int>> orders = {{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12},
                                                {0, 12, 6, 3, 9, 1, 2, 4, 5, 7, 8, 10, 11},
                                                {0, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1},
                                                {0, 2, 1, 4, 3, 6, 5, 8, 7, 10, 9, 12, 11}};
  std::vector<std::vector<Pose3d>> poses(orders.size());
  std::vector<std::vector<ImuBiasd>> biases(orders.size());
  std::vector<double> costs;
  for (std::size_t o = 0; o < orders.size(); ++o) {
    FixedFlight run(flight, 50, to_the_optimum());
    for (const int k : orders[o]) {
      ASSERT_EQ(run.fix(flight, k).status, WindowUpdate::Status::updated);
      ASSERT_EQ(run.window.last_update().entered, 1);
    }
    const Graph& graph = run.window.graph();
    const Timeline<State>& line = run.window.states().timeline(run.body);
    ASSERT_EQ(line.size(), 13u);
    EXPECT_EQ(graph.factor_count(), 3u + 12u + 13u);
    for (const State& s : line) {
      poses[o].push_back(graph.value(ImuProvider::pose(s)));
      biases[o].push_back(graph.value(ImuProvider::bias(s)));
    }
    costs.push_back(run.window.last_update().solve.final_cost);
  }
  EXPECT_GT(costs[0], 1.0);
  for (std::size_t o = 1; o < orders.size(); ++o) {
    EXPECT_NEAR(costs[o], costs[0], 1e-5 * costs[0]) << o;
    for (std::size_t k = 0; k < 13; ++k) {
      EXPECT_LT(poses[o][k].minus(poses[0][k]).norm(), 1e-3 * FixedFlight::kFixSigma)
          << "order " << o << ", state " << k;
      EXPECT_LT((biases[o][k].gyro - biases[0][k].gyro).norm(), 1e-6);    // [rad/s]
      EXPECT_LT((biases[o][k].accel - biases[0][k].accel).norm(), 2e-5);  // [m/s²]
    }
  }
}

}  // namespace
}  // namespace oriel
