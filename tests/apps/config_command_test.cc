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

// R9: the whole flight through a window that is put together from parts.
TEST_F(ConfigCommand, FliesAWindowThatTheConfigPutsTogether) {
  const std::string recording = path("recording");
  ASSERT_EQ(oriel("import " + data("euroc_v101") + " " + recording).exit_code, 0);
  const std::string config = write("window.yaml", "task: sliding_window\nexecutor: inline\n");
  const CommandResult r = oriel("run " + recording + " --config " + config + " --json -");
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const nlohmann::json o = r.json();
  EXPECT_EQ(o["updates"], 100);
  EXPECT_EQ(o["coverage"], 1.0);
  EXPECT_GT(o["frames_per_second"].get<double>(), 0.0);
  EXPECT_EQ(o["solves_refused"], 0);
  EXPECT_EQ(o["states"], 99);  // it begins with the second frame
  EXPECT_LE(o["ate_m"].get<double>(), 0.05);
  for (const char* reason : {"outlier", "wrong_match", "uninitialised", "group_too_old"})
    EXPECT_TRUE(o["dropped"].contains(reason)) << reason;
  EXPECT_EQ(o["dropped"]["uninitialised"], 1);
  const CommandResult journal = oriel("run " + recording + " --config " + config + " --journal " + path("j"));
  EXPECT_EQ(journal.exit_code, 2);
  EXPECT_NE(journal.err.find("--journal: expected the task inertial_odometry, found sliding_window"), std::string::npos)
      << journal.err;
}

// R9: with the config that docs/config.md shows.
TEST_F(ConfigCommand, FliesWithTheConfigOfThePage) {
  const std::string page = read(ORIEL_SOURCE_DIR "/docs/config.md");
  const std::size_t begin = page.find("task: sliding_window"), end = page.find("```", begin);
  ASSERT_LT(begin, end);
  const std::string config = write("page.yaml", page.substr(begin, end - begin));
  ASSERT_EQ(oriel("import " + data("euroc_v101") + " " + path("recording")).exit_code, 0);
  const CommandResult r = oriel("run " + path("recording") + " --config " + config + " --json -");
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_EQ(r.json()["coverage"], 1.0);
  EXPECT_LE(r.json()["ate_m"].get<double>(), 0.06);
}

// R1, R4
TEST_F(ConfigCommand, FliesWindowsOfPartsTheSameWayInAllExecutorsWithAndWithoutWaitingForTheirSolves) {
  ASSERT_EQ(oriel("simulate " + path("flight") + " --seconds 6 --camera-rate 5 --tracks 40").exit_code, 0);
  for (const std::string parts : {"builders: [structureless]\n", "providers: [constant_velocity]\nhooks: [refine]\n"}) {
    std::string first;
    for (const std::string defer : {"false", "true"})
      for (const std::string executor : {"inline", "thread", "process"}) {
        const std::string config =
            write("w.yaml", "task: sliding_window\nexecutor: " + executor + "\ndefer: " + defer + "\n" + parts);
        const CommandResult r = oriel("run " + path("flight") + " --config " + config + " --out " + path("out.tum"));
        ASSERT_EQ(r.exit_code, 0) << r.err;
        if (first.empty()) first = read(path("out.tum"));
        EXPECT_GT(std::count(first.begin(), first.end(), '\n'), 20) << parts;
        EXPECT_EQ(read(path("out.tum")), first) << executor << " defer " << defer << " " << parts;
      }
  }
}

// R5: what a worker came to, in every task with a window, also where no start was found because of it.
TEST_F(ConfigCommand, SaysWhatItsWorkersCameToAndHowManySolvesThatCost) {
  ASSERT_EQ(oriel("simulate " + path("flight") + " --seconds 6 --camera-rate 5 --tracks 40").exit_code, 0);
  for (const std::string task : {"inertial_odometry", "sliding_window"})
    for (const std::string defer : {"false", "true"}) {
      const std::string config =
          write("late.yaml", "task: " + task + "\nexecutor: thread\ntime_limit: 1e-9\ndefer: " + defer + "\n");
      const CommandResult r = oriel("run " + path("flight") + " --config " + config + " --json -");
      ASSERT_FALSE(r.out.empty()) << r.err;
      const nlohmann::json o = r.json();
      EXPECT_GT(o["solves_refused"].get<int>(), 1) << task;
      const auto warning = o["warnings"][0].get<std::string>();
      EXPECT_EQ(warning.find(o["solves_refused"].dump() + " solves were refused; the first: not done "), 0u) << warning;
    }
}

// What a recording has not, by the line of the part that needs it.
TEST_F(ConfigCommand, RefusesPartsThatNeedWhatTheRecordingHasNot) {
  ASSERT_EQ(oriel("simulate " + path("flight") + " --seconds 3 --camera-rate 5 --tracks 20").exit_code, 0);
  const std::string config =
      write("w.yaml", "task: sliding_window\nexecutor: inline\nbuilders:\n  - tracks\n  - gnss\n");
  const CommandResult r = oriel("run " + path("flight") + " --config " + config + " --json -");
  EXPECT_EQ(r.exit_code, 2);
  EXPECT_NE(r.err.find("w.yaml:5: the builder gnss: expected a recording with positions\n"), std::string::npos)
      << r.err;
  EXPECT_TRUE(r.out.empty());
}

}  // namespace
}  // namespace oriel::apps
