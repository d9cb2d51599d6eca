// An IMU's window ends where it ends, in whatever order its fixes came: motions that are split are preintegrated anew.
#include <gtest/gtest.h>

#include "oriel/window/imu_provider.h"
#include "oriel/window/sensor_builder.h"
#include "oriel/window/sliding_window.h"
#include "simulated_flight.h"

namespace oriel {
namespace {

using PoseFix = SensorBuilder<Prior<Pose3d>, IsotropicNoise>;

constexpr double kFixSigma = 0.02;  // [m, rad]

struct FixedFlight {
  SlidingWindow window;
  ImuProvider* imu = nullptr;
  PoseFix* fixes = nullptr;
  ProviderId body;

  explicit FixedFlight(const SimulatedFlight& flight) : window(options()) {
    auto provider = std::make_unique<ImuProvider>(flight.noise);
    imu = provider.get();
    body = window.add(std::move(provider));
    auto sensor = std::make_unique<PoseFix>("fix", body);
    fixes = sensor.get();
    window.add(std::move(sensor));
    auto lag = std::make_unique<LagPolicy>();
    EXPECT_TRUE(lag->set({1, 50, {}}).ok());
    window.set(std::move(lag));
    ImuStart start;
    start.T_world_body = flight.pose(0.0);
    start.bias = flight.bias;
    imu->start_at(start);
    for (const ImuSample& s : flight.imu) EXPECT_TRUE(imu->add(s).ok());
  }
  static WindowOptions options() {
    WindowOptions o;
    o.solve.max_iterations = 40;
    o.solve.function_tolerance = 1e-15;
    return o;
  }
  void fix(const SimulatedFlight& flight, int k) {
    const double t = 0.2 * k;
    const Vec6d error = {{0.004 * std::sin(9.0 * k), 0.003 * std::cos(5.0 * k), 0.002, 0.02 * std::sin(7.0 * k), 0.01,
                          0.02 * std::cos(3.0 * k)}};
    fixes->add(SimulatedFlight::time_of(t), Prior{flight.pose(t).plus(error)}, Sigma(kFixSigma));
    ASSERT_EQ(window.update().status, WindowUpdate::Status::updated);
    ASSERT_EQ(window.last_update().entered, 1);
  }
};

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
    FixedFlight run(flight);
    for (const int k : orders[o]) run.fix(flight, k);
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
      EXPECT_LT(poses[o][k].minus(poses[0][k]).norm(), 1e-3 * kFixSigma) << "order " << o << ", state " << k;
      EXPECT_LT((biases[o][k].gyro - biases[0][k].gyro).norm(), 1e-6);    // [rad/s]
      EXPECT_LT((biases[o][k].accel - biases[0][k].accel).norm(), 2e-5);  // [m/s²]
    }
  }
}

}  // namespace
}  // namespace oriel
