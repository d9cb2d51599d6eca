// `oriel config`, and `oriel run` with a config and elsewhere.
#include "command_runner.h"

namespace oriel::apps {
namespace {

using ConfigCommand = CommandTest;

// R9
TEST_F(ConfigCommand, PrintsEverySettingAsAFileThatItTakesBack) {
  const CommandResult all = oriel("config");
  ASSERT_EQ(all.exit_code, 0) << all.err;
  EXPECT_NE(all.out.find("executor: inline\n"), std::string::npos);
  EXPECT_NE(all.out.find("  # Noise of a coordinate of a sighting. [px]\n  pixel_sigma: 1\n"), std::string::npos);
  const std::string file = write("run.yaml", all.out);
  EXPECT_EQ(oriel("config " + file).out, all.out);
}

// R9
TEST_F(ConfigCommand, RefusesAConfigWithALineForEachFaultBeforeAnythingStarts) {
  const std::string file = write("run.yaml", "task: inertial_odometry\nexecutor: gpu\nvisual:\n  colour: red\n");
  for (const std::string& arguments : {"config " + file, "run " + path("none") + " --config " + file}) {
    const CommandResult r = oriel(arguments);
    EXPECT_EQ(r.exit_code, 2) << arguments;
    EXPECT_TRUE(r.out.empty());
    EXPECT_NE(r.err.find("run.yaml:2: expected one of inline, thread, process for `executor`, found 'gpu'\n"),
              std::string::npos)
        << r.err;
    EXPECT_NE(r.err.find("run.yaml:4: unknown key 'visual.colour'"), std::string::npos) << r.err;
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 2) << r.err;
  }
  EXPECT_EQ(oriel("run " + path("none") + " --executor gpu").exit_code, 2);
}

// R1: the same poses, to the last digit that is written.
TEST_F(ConfigCommand, FliesTheSameWayInAllExecutors) {
  const std::string recording = path("recording");
  ASSERT_EQ(oriel("import " + data("euroc_v101") + " " + recording).exit_code, 0);
  std::string first;
  for (const std::string executor : {"inline", "thread", "process"}) {
    const std::string out = path(executor + ".tum");
    const std::string config = write(executor + ".yaml", "task: inertial_odometry\nexecutor: " + executor + "\n");
    const CommandResult r = oriel("run " + recording + " --config " + config + " --out " + out + " --json -");
    ASSERT_EQ(r.exit_code, 0) << r.err;
    if (first.empty()) first = read(out);
    EXPECT_FALSE(first.empty());
    EXPECT_EQ(read(out), first) << executor;
  }
}

}  // namespace
}  // namespace oriel::apps
