// A window that a config puts together, on a recording that starts in motion.
#include "command_runner.h"

namespace oriel::apps {
namespace {

class WindowShared : public CommandTest {
 protected:
  nlohmann::json fly(const std::string& more) const {
    EXPECT_EQ(oriel("import " ORIEL_SHARED_DIR "/vio/euroc_mh01_first10s " + path("mh01")).exit_code, 0);
    const std::string config = write("w.yaml", "task: sliding_window\nexecutor: inline\n" + more);
    const CommandResult r = oriel("run " + path("mh01") + " --config " + config + " --json -");
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

}  // namespace
}  // namespace oriel::apps
