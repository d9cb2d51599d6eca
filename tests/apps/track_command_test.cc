// `oriel track`, and `oriel run` by a config that names the task.
#include "command_runner.h"

namespace oriel::apps {
namespace {

using nlohmann::json;

class TrackCommand : public CommandTest {
 protected:
  std::string recording() const { return data("euroc_v101"); }
};

// Reference: stereo PnP chained frame to map has 0.184 m here.
TEST_F(TrackCommand, FollowsTheFlightWithoutImuAndReportsEveryKeyOfItsContract) {
  const CommandResult r = oriel("track " + recording() + " --json - --out " + path("flight.tum"));
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const json o = r.json();
  ASSERT_TRUE(o.is_object()) << r.out;
  for (const char* key : {"recording", "duration_s", "frames", "points", "matches", "inliers", "iterations",
                          "final_cost", "worker_restarts", "frame_ms", "ate_m", "ate_deg", "path_m", "warnings"})
    EXPECT_TRUE(o.contains(key)) << key;
  EXPECT_EQ(o["frames"]["origin"], 1);
  EXPECT_EQ(o["frames"]["solved"], 99);
  EXPECT_LE(o["ate_m"].get<double>(), 0.1);
  // The trajectory that was written is the one that was judged.
  const json judged = oriel("evaluate " + path("flight.tum") + " " + recording() + "/groundtruth.tum --json -").json();
  EXPECT_NEAR(judged["ate_m"].get<double>(), o["ate_m"].get<double>(), 1e-6);
}

// R1, R9
TEST_F(TrackCommand, WritesTheSameTrajectoryAndMapInAllExecutorsAndByAConfig) {
  std::string trajectory, map;
  for (const std::string executor : {"inline", "thread", "process"}) {
    ASSERT_EQ(oriel("track " + recording() + " --executor " + executor + " --out " + path("a.tum") + " --map " +
                    path("a.map"))
                  .exit_code,
              0);
    if (trajectory.empty()) trajectory = read(path("a.tum")), map = read(path("a.map"));
    EXPECT_EQ(read(path("a.tum")), trajectory) << executor;
    EXPECT_EQ(read(path("a.map")), map) << executor;
  }
  EXPECT_EQ(map.find("oriel-visual-map/1\n"), 0u);
  write("run.yaml", "task: two_frame\nexecutor: process\n");
  ASSERT_EQ(oriel("run " + recording() + " --config " + path("run.yaml") + " --out " + path("b.tum")).exit_code, 0);
  EXPECT_EQ(read(path("b.tum")), trajectory);
  write("points.yaml", "task: two_frame\nexecutor: inline\ntwo_frame: {residual: points}\n");
  ASSERT_EQ(oriel("track " + recording() + " --config " + path("points.yaml") + " --out " + path("c.tum")).exit_code,
            0);
  EXPECT_NE(read(path("c.tum")), trajectory);
}

TEST_F(TrackCommand, TakesEveryResidualInBothCoordinates) {
  for (const std::string residual : {"points", "pixel", "disparity", "stereo"}) {
    const CommandResult r = oriel("track " + recording() + " --json - --coordinates world --residual " + residual);
    ASSERT_EQ(r.exit_code, 0) << r.err;
    EXPECT_LE(r.json()["ate_m"].get<double>(), 0.15) << residual;
  }
}

// R9
TEST_F(TrackCommand, RefusesInOneLineWhatItCannotTake) {
  const auto refusal = [&](const std::string& arguments) {
    const CommandResult r = oriel(arguments);
    EXPECT_EQ(r.exit_code, 2) << arguments;
    EXPECT_TRUE(r.out.empty());
    return r.err;
  };
  EXPECT_NE(refusal("track " + recording() + " --residual lines").find("points, pixel, disparity or stereo"),
            std::string::npos);
  EXPECT_NE(refusal("track " + path("nothing")).find("found no such folder"), std::string::npos);
  write("window.yaml", "task: inertial_odometry\nexecutor: inline\n");
  EXPECT_NE(refusal("track " + recording() + " --config " + path("window.yaml")).find("expected the task two_frame"),
            std::string::npos);
  write("two.yaml", "task: two_frame\nexecutor: inline\n");
  EXPECT_NE(refusal("run " + recording() + " --config " + path("two.yaml") + " --journal " + path("j"))
                .find("--journal: expected the task inertial_odometry"),
            std::string::npos);
  write("ceres.yaml", "task: two_frame\nexecutor: inline\nengine: ceres\n");
  EXPECT_NE(refusal("track " + recording() + " --config " + path("ceres.yaml")).find("expected the engine native"),
            std::string::npos);
  write("defer.yaml", "task: two_frame\nexecutor: inline\ndefer: true\n");
  EXPECT_NE(refusal("track " + recording() + " --config " + path("defer.yaml"))
                .find("defer.yaml:3: expected a task with a window where solves are deferred"),
            std::string::npos);
  write("few.yaml", "task: two_frame\nexecutor: inline\ntwo_frame:\n  least_observations: 2\n");
  EXPECT_NE(refusal("track " + recording() + " --config " + path("few.yaml"))
                .find("few.yaml:4: expected a whole number from 3 to 100000 for `two_frame.least_observations`"),
            std::string::npos);
}

}  // namespace
}  // namespace oriel::apps
