// `oriel simulate` along real trajectories, and `oriel run` on what it makes.
#include "command_runner.h"

namespace oriel::apps {
namespace {

using SimulateShared = CommandTest;

TEST_F(SimulateShared, FliesAlongEachTrajectoryOfTheSimulatorDataAndRunFollowsIt) {
  for (const std::string name : {"tum_corridor1_512_16_okvis", "udel_garage", "udel_gore"}) {
    const std::string way = std::string(ORIEL_SHARED_DIR) + "/vio/sim_trajectories/" + name + ".txt";
    const CommandResult made =
        oriel("simulate " + way + " " + path(name) + " --seconds 25 --camera-rate 10 --tracks 80");
    ASSERT_EQ(made.exit_code, 0) << made.err;
    const auto o = oriel("run " + path(name) + " --json -").json();
    ASSERT_TRUE(o.is_object());
    EXPECT_EQ(o["coverage"], 1.0) << name;
    EXPECT_GT(o["path_m"].get<double>(), 10.0) << name;
    // Drift of 0.3 % of the way is twice what is found.
    EXPECT_LT(o["ate_m"].get<double>(), 0.02 + 0.003 * o["path_m"].get<double>()) << name;
  }
}

}  // namespace
}  // namespace oriel::apps
