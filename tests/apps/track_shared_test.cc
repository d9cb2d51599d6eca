// Two-frame odometry on real stereo recordings, against what chaining stereo PnP without covariances comes to.
#include "command_runner.h"

namespace oriel::apps {
namespace {

using nlohmann::json;

class TrackShared : public CommandTest {
 protected:
  json track(const std::string& set, const std::string& options = "") const {
    const CommandResult r = oriel("track " ORIEL_SHARED_DIR "/vio/" + set + " --json - " + options);
    EXPECT_EQ(r.exit_code, 0) << r.err;
    return r.json();
  }
};

TEST_F(TrackShared, IsNoWorseThanChainedStereoPnpOnAnyRecording) {
  const std::pair<const char*, double> kReference[] = {
      {"euroc_v101_keyframes", 0.184},           {"euroc_mh01_first10s", 0.006},
      {"kitti_klt/2011_09_26_drive_0001", 1.54}, {"kitti_klt/2011_09_26_drive_0009", 6.21},
      {"kitti_klt/2011_09_26_drive_0027", 9.09}, {"kitti_klt/2011_09_26_drive_0035", 0.85},
      {"kitti_klt/2011_09_26_drive_0039", 2.71}, {"kitti_klt/2011_09_26_drive_0095", 1.66},
      {"kitti_klt/2011_09_30_drive_0020", 50.0}, {"kitti_klt/2011_10_03_drive_0042", 247.0},
  };
  for (const auto& [set, ate] : kReference) EXPECT_LE(track(set)["ate_m"].get<double>(), ate) << set;
}

// Lights whose pixels are known to six and eleven pixels; frames that see nothing are not in the recording, and most
// others see too little.
TEST_F(TrackShared, FlagsAndInterpolatesMostFramesOfTheStarryNight) {
  const json r = track("starry_night");
  EXPECT_GT(r["frames"]["few"].get<int>(), 1000);
  EXPECT_GT(r["frames"]["solved"].get<int>(), 200);
  EXPECT_LE(r["ate_m"].get<double>(), 1.0);
}

// Against the poses that the example begins from.
TEST_F(TrackShared, FollowsTheStereoExampleOfGtsam) {
  const json r = track("gtsam_stereo");
  EXPECT_EQ(r["frames"]["solved"], 76);
  EXPECT_LE(r["ate_m"].get<double>(), 0.1);
}

// R1
TEST_F(TrackShared, HasTheSameBitsInAProcessOverAWholeDrive) {
  const std::string drive = "kitti_klt/2011_09_26_drive_0009";
  track(drive, "--map " + path("a.map"));
  track(drive, "--executor process --map " + path("b.map"));
  const std::string a = read(path("a.map"));
  EXPECT_GT(a.size(), 1'000'000u);
  EXPECT_TRUE(a == read(path("b.map")));
}

}  // namespace
}  // namespace oriel::apps
