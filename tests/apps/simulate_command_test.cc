// `oriel simulate`, and `oriel run` on what it makes.
#include "command_runner.h"

namespace oriel::apps {
namespace {

using nlohmann::json;
using SimulateCommand = CommandTest;

TEST_F(SimulateCommand, MakesARecordingOnWhichRunStaysNearTheTruth) {
  const CommandResult made = oriel("simulate " + path("flight") + " --seconds 12 --tracks 80 --camera-rate 10");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const json o = oriel("run " + path("flight") + " --json -").json();
  ASSERT_TRUE(o.is_object());
  EXPECT_EQ(o["updates"], 121);
  EXPECT_EQ(o["coverage"], 1.0);
  EXPECT_GT(o["path_m"].get<double>(), 5.0);
  EXPECT_LT(o["ate_m"].get<double>(), 0.03);
}

TEST_F(SimulateCommand, MakesTheSameFilesFromTheSameSeed) {
  const std::string options = " --seconds 3 --tracks 20 --seed ";
  ASSERT_EQ(oriel("simulate " + path("a") + options + "5").exit_code, 0);
  ASSERT_EQ(oriel("simulate " + path("b") + options + "5").exit_code, 0);
  ASSERT_EQ(oriel("simulate " + path("c") + options + "6").exit_code, 0);
  for (const std::string file : {"/imu.csv", "/tracks.csv"}) {
    EXPECT_EQ(read(path("a") + file), read(path("b") + file));
    EXPECT_NE(read(path("a") + file), read(path("c") + file));
  }
  EXPECT_EQ(read(path("a") + "/groundtruth.tum"), read(path("c") + "/groundtruth.tum"));
}

TEST_F(SimulateCommand, FliesAlongATrajectoryWithColumnsThatItPassesOver) {
  std::string text = "# t x y z qx qy qz qw and covariances\n";
  for (int k = 0; k < 60; ++k)
    text += "15000000" + std::to_string(10 + k / 10) + "." + std::to_string(k % 10) + " " + std::to_string(0.1 * k) +
            " 0 0 0 0 0 1 0.1 0.2 0.3 0.4 0.5 0.6\n";
  const CommandResult made = oriel("simulate " + write("way.txt", text) + " " + path("way") + " --rest 0 --tracks 20");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_NE(made.out.find("path 5."), std::string::npos) << made.out;  // 5.9 m less the ends of the spline
}

TEST_F(SimulateCommand, LeavesOutWhatDropsOutAndLastsThroughIt) {
  const CommandResult made = oriel("simulate " + path("gap") +
                                   " --seconds 8 --tracks 60 --camera-rate 10 --fault dropout:imu:4:5 "
                                   "--fault blind:camera:6:6.5 --fault outlier:camera:3:8:0.1");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_NE(made.out.find("76 frames"), std::string::npos) << made.out;
  EXPECT_NE(made.out.find("1401 IMU samples"), std::string::npos) << made.out;
  const json o = oriel("run " + path("gap") + " --json -").json();
  EXPECT_EQ(o["coverage"], 1.0);
  EXPECT_LT(o["ate_m"].get<double>(), 0.06);
}

TEST_F(SimulateCommand, RefusesBadOptionsWithOneLineAndWritesNothing) {
  const std::string short_way = write("short.txt", "1 0 0 0 0 0 0 1\n1.1 0 0 0 0 0 0 1\n");
  const std::string x = path("x");
  const std::vector<std::string> bad = {
      "",
      x + " --seconds -1",
      x + " --seconds abc",
      x + " --seed 1.5",
      x + " --tracks 0",
      x + " --fault nan:imu:1:2",
      x + " --fault dropout:gnss:1:2",
      x + " --fault dropout:imu:2:1",
      x + " --fault dropout:imu:1:2:0",
      x + " --fault dropout",
      x + " --fault blind:imu:1:2",
      x + " --still 5",
      x + " --still 5:4",
      x + " --still 2.5:4",  // the rest at the start ends at 2 s
      path("absent") + " " + x,
      short_way + " " + x,
      x + " --frobnicate",
  };
  for (const std::string& arguments : bad) {
    const CommandResult r = oriel("simulate " + arguments);
    EXPECT_EQ(r.exit_code, 2) << arguments;
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << arguments << ": " << r.err;
    EXPECT_TRUE(r.out.empty()) << arguments;
    EXPECT_FALSE(std::filesystem::exists(path("x"))) << arguments;
  }
}

TEST_F(SimulateCommand, DoesNotReplaceAFolderThatIsNoRecording) {
  std::filesystem::create_directory(path("mine"));
  write("mine/thesis.txt", "years of work");
  const CommandResult r = oriel("simulate " + path("mine") + " --seconds 2");
  EXPECT_EQ(r.exit_code, 2);
  EXPECT_EQ(read(path("mine/thesis.txt")), "years of work");
}

}  // namespace
}  // namespace oriel::apps
