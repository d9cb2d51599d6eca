// `oriel run --defer`: the whole recording of the project, with the same bits wherever its solves run.
#include <array>

#include "command_runner.h"

namespace oriel::apps {
namespace {

class DeferOption : public CommandTest {
 protected:
  DeferOption() { EXPECT_EQ(oriel("import " + data("euroc_v101") + " " + path("recording")).exit_code, 0); }
  CommandResult run(const std::string& options) const { return oriel("run " + path("recording") + " " + options); }
};

// R1, R9: by the command line, and by the config.
TEST_F(DeferOption, FliesTheSameWayInAllExecutorsAndEndsWhereTheFlightThatWaitsEnds) {
  const nlohmann::json waits = run("--json - --out " + path("waits.tum")).json();
  const std::string config = write("run.yaml", "task: inertial_odometry\nexecutor: process\ndefer: true\n");
  const std::array<std::string, 4> ways = {"--defer", "--defer --executor thread", "--defer --executor process",
                                           "--config " + config};
  for (const std::string& way : ways) {
    const CommandResult r = run(way + " --json - --out " + path("flight.tum"));
    ASSERT_EQ(r.exit_code, 0) << r.err;
    const nlohmann::json o = r.json();
    EXPECT_EQ(o["states"], waits["states"]) << way;
    EXPECT_EQ(o["dropped"], waits["dropped"]) << way;
    EXPECT_EQ(o["ate_final_m"], waits["ate_final_m"]) << way;  // what was solved has the same bits
    EXPECT_LE(o["ate_m"].get<double>(), 0.06) << way;          // what was predicted is near
    EXPECT_NE(o["ate_m"], waits["ate_m"]) << way;
    if (way == ways[0])
      std::filesystem::rename(path("flight.tum"), path("in_place.tum"));
    else
      EXPECT_EQ(read(path("flight.tum")), read(path("in_place.tum"))) << way;
  }
  EXPECT_NE(read(path("waits.tum")), read(path("in_place.tum")));
}

TEST_F(DeferOption, IsRefusedWithOneLineWhereNothingCanBeDeferred) {
  const auto refused = [&](const std::string& options, const std::string& why) {
    const CommandResult r = run(options + " --json -");
    EXPECT_EQ(r.exit_code, 2) << options;
    EXPECT_TRUE(r.out.empty()) << r.out;
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
    EXPECT_NE(r.err.find(why), std::string::npos) << r.err;
  };
  refused("--defer --journal " + path("flight.journal"), "--journal: expected solves that are waited for");
  EXPECT_FALSE(std::filesystem::exists(path("flight.journal")));
  const std::string config = write("two.yaml", "task: two_frame\nexecutor: inline\ndefer: true\n");
  refused("--config " + config, "two.yaml:3: expected a task with a window where solves are deferred, found two_frame");
  const std::string waits = write("waits.yaml", "task: two_frame\nexecutor: inline\n");
  refused("--defer --config " + waits, "--defer: expected a task with a window, found two_frame");
  if (std::filesystem::exists(std::string(ORIEL_COMMAND) + "-ceres"))
    refused("--defer --engine ceres", "--defer: expected the engine native, found ceres");
}

// A frame cannot take less than its front end does.
TEST_F(DeferOption, BurnsTheTimeOfAFrontEndBeforeEachFrame) {
  const double rate = run("--front-end-ms 5 --json -").json()["frames_per_second"].get<double>();
  EXPECT_GT(rate, 0.0);
  EXPECT_LT(rate, 200.0);
  EXPECT_EQ(run("--front-end-ms -1").exit_code, 2);
}

}  // namespace
}  // namespace oriel::apps
