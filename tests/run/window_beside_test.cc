// A window whose solves run in another thread or process flies the same way, bit for bit, also when workers are killed.
#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <iostream>
#include <random>

#include "oriel/graph/fingerprint.h"
#include "oriel/run/beside_engine.h"
#include "oriel/window/inertial_odometry.h"
#include "run/worker_of.h"
#include "window/simulated_flight.h"

namespace oriel {
namespace {

struct Flown {
  std::vector<Pose3d> poses;
  std::vector<std::uint64_t> fingerprints;
  int killed = 0;
};

// `kill`: of a hundred frames so many lose their worker, before or during the update.
Flown fly(const SimulatedFlight& flight, ExecutorKind kind, Zygote& zygote, int kill = 0) {
  InertialOdometry odometry(flight.rig, true, flight.noise, {});
  ExecutorOptions options;
  options.zygote = &zygote;
  if (kind != ExecutorKind::in_place) {
    auto engine = BesideEngine::make(odometry.window().followed(), kind, options, 8);
    EXPECT_TRUE(engine) << engine.error();
    EXPECT_TRUE(odometry.window().use(std::move(*engine)));
  }
  Flown out;
  std::mt19937 random(5);
  std::size_t next = 0;
  for (const auto& frame : flight.frames) {
    for (; next < flight.imu.size() && flight.imu[next].time <= frame.time; ++next)
      EXPECT_TRUE(odometry.add_imu(flight.imu[next]));
    std::thread killer;
    if (static_cast<int>(random() % 100) < kill) {
      const auto delay = std::chrono::microseconds(random() % 8000);
      killer = std::thread([&zygote, &out, delay] {
        std::this_thread::sleep_for(delay);
        if (const pid_t pid = worker_of(zygote); pid > 0 && ::kill(pid, SIGKILL) == 0) ++out.killed;
      });
    }
    const UpdateReport report = odometry.update({frame.time, frame.features});
    if (killer.joinable()) killer.join();
    out.poses.push_back(report.values.T_world_body);
    out.fingerprints.push_back(fingerprint(odometry.window().graph()));
  }
  return out;
}

class WindowBeside : public ::testing::Test {
 protected:
  WindowBeside() : flight_(flight_options()) {}
  static FlightOptions flight_options() {
    FlightOptions o;
    o.rest_s = 2.0;
    o.duration_s = std::getenv("ORIEL_KILLS") != nullptr ? 60.0 : 6.0;
    return o;
  }
  Zygote zygote_ = Zygote::start({&SolveBeside::kTask}).value();
  SimulatedFlight flight_;
};

// R1
TEST_F(WindowBeside, FliesTheSameWayInAllExecutors) {
  const Flown in_place = fly(flight_, ExecutorKind::in_place, zygote_);
  EXPECT_NE(in_place.fingerprints.front(), in_place.fingerprints.back());
  EXPECT_TRUE(fly(flight_, ExecutorKind::thread, zygote_).fingerprints == in_place.fingerprints);
  EXPECT_TRUE(fly(flight_, ExecutorKind::process, zygote_).fingerprints == in_place.fingerprints);
}

// R6
TEST_F(WindowBeside, FliesTheSameWayWhileItsWorkersAreKilled) {
  const Flown in_place = fly(flight_, ExecutorKind::in_place, zygote_);
  const Flown stormy = fly(flight_, ExecutorKind::process, zygote_, 50);
  EXPECT_GT(stormy.killed, 5);
  EXPECT_TRUE(stormy.fingerprints == in_place.fingerprints);
  if (std::getenv("ORIEL_KILLS") != nullptr)
    std::cout << stormy.killed << " workers killed in " << flight_.frames.size() << " frames\n";
}

}  // namespace
}  // namespace oriel
