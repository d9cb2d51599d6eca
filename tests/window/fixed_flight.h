// A window of an IMU over a simulated flight, with fixes of its pose five times a second.
#pragma once
#include <gtest/gtest.h>

#include <cmath>

#include "oriel/window/imu_provider.h"
#include "oriel/window/sensor_builder.h"
#include "oriel/window/sliding_window.h"
#include "window/simulated_flight.h"

namespace oriel {

struct FixedFlight {
  using PoseFix = SensorBuilder<Prior<Pose3d>, IsotropicNoise>;
  static constexpr double kFixSigma = 0.02;  // [m, rad]

  SlidingWindow window;
  ImuProvider* imu = nullptr;
  PoseFix* fixes = nullptr;
  ProviderId body;

  // `states`: that stay at most.
  FixedFlight(const SimulatedFlight& flight, int states, const WindowOptions& options = {}) : window(options) {
    auto provider = std::make_unique<ImuProvider>(flight.noise);
    imu = provider.get();
    body = window.add(std::move(provider));
    auto sensor = std::make_unique<PoseFix>("fix", body);
    fixes = sensor.get();
    window.add(std::move(sensor));
    auto lag = std::make_unique<LagPolicy>();
    EXPECT_TRUE(lag->set({1, states, {}}).ok());
    window.set(std::move(lag));
    ImuStart start;
    start.T_world_body = flight.pose(0.0);
    start.bias = flight.bias;
    imu->start_at(start);
    for (const ImuSample& s : flight.imu) EXPECT_TRUE(imu->add(s).ok());
  }
  // The k-th, off by what it may be, and an update.
  const WindowUpdate& fix(const SimulatedFlight& flight, int k) {
    const double t = 0.2 * k;
    const Vec6d error = {{0.004 * std::sin(9.0 * k), 0.003 * std::cos(5.0 * k), 0.002, 0.02 * std::sin(7.0 * k), 0.01,
                          0.02 * std::cos(3.0 * k)}};
    fixes->add(SimulatedFlight::time_of(t), Prior{flight.pose(t).plus(error)}, Sigma(kFixSigma));
    return window.update();
  }
};

}  // namespace oriel
