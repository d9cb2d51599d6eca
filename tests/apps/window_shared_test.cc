// A window that a config puts together, on a recording that starts in motion.
#include "command_runner.h"

namespace oriel::apps {
namespace {

class WindowShared : public CommandTest {
 protected:
  nlohmann::json fly(const std::string& more) const {
    EXPECT_EQ(oriel("import " ORIEL_SHARED_DIR "/vio/euroc_mh01_first10s " + path("mh01")).exit_code, 0);
    return run("executor: inline\n" + more);
  }
  nlohmann::json run(const std::string& more) const {
    const std::string config = write("w.yaml", "task: sliding_window\n" + more);
    const CommandResult r = oriel("run " + path("mh01") + " --config " + config + " --json - --out " + path("out.tum"));
    EXPECT_EQ(r.exit_code, 0) << r.err;
    return r.json();
  }
};

// R9
TEST_F(WindowShared, FollowsTheStartOfMh01InMotionWithinFifteenMillimetres) {
  const auto report = fly("");
  EXPECT_EQ(report["coverage"], 1.0);
  EXPECT_GE(report["states"].get<int>(), 160);
  EXPECT_LE(report["ate_m"].get<double>(), 0.015);
}

TEST_F(WindowShared, FollowsItByStructurelessTracksAndWithoutAnImuToo) {
  for (const char* more : {"builders: [structureless]\n", "providers: [constant_velocity]\nhooks: [refine]\n"}) {
    const auto report = fly(more);
    EXPECT_EQ(report["coverage"], 1.0) << more;
    EXPECT_LE(report["ate_m"].get<double>(), 0.015) << more;
  }
}

// R1: a worker knows the factors of every provider.
TEST_F(WindowShared, FliesWithoutAnImuTheSameWayInAThreadAndWithSolvesThatAreNotWaitedFor) {
  const std::string parts = "providers: [constant_velocity]\nhooks: [refine]\n";
  (void)fly(parts);
  const std::string in_place = read(path("out.tum"));
  EXPECT_GT(std::count(in_place.begin(), in_place.end(), '\n'), 160);
  for (const char* place : {"executor: thread\n", "executor: inline\ndefer: true\n"}) {
    (void)run(place + parts);
    EXPECT_EQ(read(path("out.tum")), in_place) << place;
  }
}

}  // namespace
}  // namespace oriel::apps
