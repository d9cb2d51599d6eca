// The file that describes a run is checked whole before anything starts (R9).
#include "oriel/io/run_config.h"

#include <gtest/gtest.h>

#include "oriel/io/run_config_keys.h"
#include "oriel/run/name_table.h"

namespace oriel {
namespace {

std::vector<std::string> faults(const std::string& text) {
  std::vector<std::string> out;
  for (const Error& e : parse_run_config(text, "run.yaml").errors) out.push_back(e.text());
  return out;
}
using Faults = std::vector<std::string>;

// R9
TEST(RunConfig, TakesWhatItIsTold) {
  const auto reading = parse_run_config(
      "task: inertial_odometry\n"
      "executor: process\n"
      "time_limit: 0.5\n"
      "memory_limit: 512\n"
      "cpu_limit: 3600\n"
      "keyframes:\n"
      "  max_keyframes: 7\n"
      "  interval: 0.25\n"
      "visual: {pixel_sigma: 1.5, loss: 'huber:3', landmarks: point}\n"
      "updates: {first_estimates: false}\n",
      "run.yaml");
  ASSERT_TRUE(reading.errors.empty()) << reading.errors[0];
  const RunConfig& c = reading.config;
  EXPECT_EQ(c.executor, ExecutorKind::process);
  EXPECT_EQ(c.time_limit.ns, 500'000'000);
  EXPECT_EQ(worker_options(c, nullptr).limits.memory_bytes, 512'000'000u);
  EXPECT_EQ(worker_options(c, nullptr).limits.cpu_seconds, 3600u);
  EXPECT_EQ(c.odometry.keyframes.max_keyframes, 7);
  EXPECT_EQ(c.odometry.keyframes.interval.ns, 250'000'000);
  EXPECT_EQ(c.odometry.visual.pixel_sigma, 1.5);
  EXPECT_EQ(c.odometry.visual.loss.kind, LossKind::huber);
  EXPECT_EQ(c.odometry.visual.loss.scale, 3.0);
  EXPECT_EQ(c.odometry.visual.landmarks, LandmarkModel::point);
  EXPECT_FALSE(c.odometry.first_estimates);
  EXPECT_EQ(c.odometry.visual.gate, OdometryOptions{}.visual.gate);  // the rest has defaults
}

// R9: one line each.
TEST(RunConfig, NamesWrongTypesUnknownAndMissingKeysEachWithFileAndLine) {
  EXPECT_EQ(faults("task: inertial_odometry\n"
                   "executor: gpu\n"
                   "visual:\n"
                   "  pixel_sigma: wide\n"
                   "  gate: -1\n"
                   "  colour: red\n"
                   "updates: 3\n"),
            (Faults{"run.yaml:2: expected one of inline, thread, process for `executor`, found 'gpu'",
                    "run.yaml:4: expected a number from 1e-12 to 1e+12 for `visual.pixel_sigma`, found 'wide'",
                    "run.yaml:5: expected a number from 1e-12 to 1e+12 for `visual.gate`, found '-1'",
                    "run.yaml:6: unknown key 'visual.colour'; expected landmarks, pixel_sigma, loss, gate, match_gate, "
                    "start_gate, least_depth, greatest_depth, least_parallax, least_mono_parallax, refine_above",
                    "run.yaml:7: expected a map of keys under `updates`, found '3'"}));
  EXPECT_EQ(faults("engine: native\n"), (Faults{"run.yaml:1: expected the key `task`, found none",
                                                "run.yaml:1: expected the key `executor`, found none"}));
  EXPECT_EQ(faults("task: slam\nexecutor: inline\nexecutor: inline\n"),
            (Faults{"run.yaml:1: expected one of inertial_odometry, sliding_window, two_frame for `task`, found 'slam'",
                    "run.yaml:3: the key `executor` stands twice"}));
  EXPECT_EQ(
      faults("task: [inertial_odometry]\nexecutor: inline\nkeyframes: {max_keyframes: 2.5}\n"),
      (Faults{
          "run.yaml:1: expected one of inertial_odometry, sliding_window, two_frame for `task`, found a list or a map",
          "run.yaml:3: expected a whole number from 2 to 1000 for `keyframes.max_keyframes`, found '2.5'"}));
  EXPECT_EQ(faults("- 1\n").size(), 1u);
  EXPECT_EQ(faults("task: {\n").size(), 1u);
  const auto absent = read_run_config("/nonexistent/run.yaml");
  ASSERT_EQ(absent.errors.size(), 1u);
}

// R9: what says nothing, by the line of its key; a file that is empty, or two.
TEST(RunConfig, NamesWhatSaysNothingAndWhatSaysTooMuch) {
  EXPECT_EQ(
      faults("task:\nexecutor: inline\nengine:\ndefer: ~\nvisual:\nkeyframes:\n  interval:\nproviders:\n"
             "builders:\n  -\n  - tracks\nwindow:\n  policy:\n"),
      (Faults{"run.yaml:1: expected one of inertial_odometry, sliding_window, two_frame for `task`, found nothing",
              "run.yaml:3: expected one of native, ceres for `engine`, found nothing",
              "run.yaml:4: expected true or false for `defer`, found nothing",
              "run.yaml:5: expected a map of keys under `visual`, found nothing",
              "run.yaml:7: expected a number of seconds from 1e-09 to 1e+09 for `keyframes.interval`, found "
              "nothing",
              "run.yaml:8: expected a list of parts under `providers`, found nothing",
              "run.yaml:9: expected a name, or a map with the key `name`, under `builders`, found nothing",
              "run.yaml:13: expected a name, or a map with the key `name`, under `window.policy`, found "
              "nothing"}));
  const Faults nothing = {"run.yaml:1: expected a map of keys and values, found nothing"};
  for (const char* text : {"", "\n\n", "# a comment\n"}) EXPECT_EQ(faults(text), nothing) << text;
  const std::string one = "task: two_frame\nexecutor: inline\n";
  for (const char* second : {"---\n", "---\ntask: two_frame\n"}) EXPECT_EQ(faults(one + second).size(), 1u) << second;
  EXPECT_EQ(faults(one + "---\n"), (Faults{"run.yaml:3: expected one YAML document, found a second"}));
  EXPECT_TRUE(faults("---\n" + one + "...\n").empty());
}

// R9: a number that would be none in nanoseconds, or is none that a machine has.
TEST(RunConfig, SaysTheRangeOfWhatIsOutOfIt) {
  EXPECT_EQ(
      faults("task: two_frame\nexecutor: inline\ntime_limit: 1e-10\nspin: 1e10\ncpu_limit: 1e10\n"
             "memory_limit: -1\nkeyframes: {interval: 1e-12}\n"),
      (Faults{"run.yaml:3: expected 0, or a number of seconds from 1e-09 to 1e+09 for `time_limit`, found '1e-10'",
              "run.yaml:4: expected 0, or a number of seconds from 1e-09 to 1e+09 for `spin`, found '1e10'",
              "run.yaml:5: expected a whole number from 0 to 1000000000 for `cpu_limit`, found '1e10'",
              "run.yaml:6: expected a whole number from 0 to 1099511627776 for `memory_limit`, found '-1'",
              "run.yaml:7: expected a number of seconds from 1e-09 to 1e+09 for `keyframes.interval`, found "
              "'1e-12'"}));
  const auto reading = parse_run_config("task: two_frame\nexecutor: inline\ntime_limit: 1e-9\nspin: 0\n", "run.yaml");
  ASSERT_TRUE(reading.errors.empty()) << reading.errors[0];
  EXPECT_EQ(reading.config.time_limit.ns, 1);
}

// R9: each right by itself, and not together.
TEST(RunConfig, NamesTheLeastThatIsMoreThanTheGreatest) {
  EXPECT_EQ(faults("task: inertial_odometry\nexecutor: inline\n"
                   "visual: {least_depth: 5,\n  greatest_depth: 2}\n"
                   "initialisation: {block: 2, moving: 9}\n"
                   "builders:\n  - {name: tracks, least_depth: 200}\n"),
            (Faults{"run.yaml:7: expected `builders.tracks.least_depth` = 200 to be at most "
                    "`builders.tracks.greatest_depth` = 150",
                    "run.yaml:4: expected `visual.least_depth` = 5 to be at most `visual.greatest_depth` = 2",
                    "run.yaml:5: expected `initialisation.block` = 2 to be at most `initialisation.still` = 1",
                    "run.yaml:5: expected `initialisation.moving` = 9 to be at most `initialisation.longest` = 4"}));
  EXPECT_TRUE(
      faults("task: inertial_odometry\nexecutor: inline\nvisual: {least_depth: 2, greatest_depth: 2}\n").empty());
  // What could not be read is no order.
  EXPECT_EQ(faults("task: two_frame\nexecutor: inline\nvisual: {least_depth: 500, greatest_depth: far}\n").size(), 1u);
}

// R9: what `oriel run` would refuse.
TEST(RunConfig, NamesPlacesThatTheTaskCannotHave) {
  const std::string native =
      "expected the engine native where the executor is not inline or solves are deferred, found 'ceres'";
  for (const std::string task : {"inertial_odometry", "sliding_window"}) {
    EXPECT_EQ(faults("task: " + task + "\nexecutor: thread\nengine: ceres\n"), (Faults{"run.yaml:3: " + native}));
    EXPECT_EQ(faults("engine: ceres\ntask: " + task + "\nexecutor: process\n"), (Faults{"run.yaml:1: " + native}));
    EXPECT_EQ(faults("task: " + task + "\nexecutor: inline\ndefer: true\nengine: ceres\n"),
              (Faults{"run.yaml:4: " + native}));
    EXPECT_TRUE(faults("task: " + task + "\nexecutor: inline\nengine: ceres\n").empty());
    EXPECT_TRUE(faults("task: " + task + "\nexecutor: process\ndefer: true\n").empty());
  }
  EXPECT_EQ(faults("task: two_frame\nexecutor: inline\nengine: ceres\ndefer: true\n"),
            (Faults{"run.yaml:4: expected a task with a window where solves are deferred, found two_frame",
                    "run.yaml:3: expected the engine native for the task two_frame, found 'ceres'"}));
}

// R9: a section of another task is no fault, so the text says whose it is.
TEST(RunConfig, SaysOfWhichTaskASectionIs) {
  const std::string text = run_config_text();
  for (const char* section : {"# Of the task inertial_odometry.\nvisual:\n", "# Of the task two_frame.\ntwo_frame:\n",
                              "# Of the task sliding_window.\nwindow:\n",
                              "# Of the task inertial_odometry, and of the provider imu of sliding_window.\n"
                              "initialisation:\n",
                              "# Of the task sliding_window: what it is put together from.\nproviders:\n"})
    EXPECT_NE(text.find(section), std::string::npos) << section;
  EXPECT_TRUE(faults("task: two_frame\nexecutor: inline\nvisual: {gate: 3}\nbuilders: []\n").empty());
}

// What `oriel config` prints is a config, says every key, and gives the defaults back.
TEST(RunConfig, PrintsEveryKeyWithItsDefaultSoThatItCanBeReadAgain) {
  const std::string text = run_config_text();
  const auto reading = parse_run_config(text, "printed");
  ASSERT_TRUE(reading.errors.empty()) << reading.errors[0] << '\n' << text;
  EXPECT_EQ(run_config_text(reading.config), text);
  for (const io_detail::ConfigKey& key : io_detail::run_config_keys()) {
    EXPECT_NE(text.find(std::string(key.name) + ": "), std::string::npos) << key.name;
    EXPECT_NE(text.find(key.sentence), std::string::npos) << key.name;
  }
  // And a config where nothing is as it is by default comes back, too.
  RunConfig other = reading.config;
  other.executor = ExecutorKind::thread;
  other.task = "sliding_window";
  other.defer = true;
  other.cpu_limit_s = 7;
  other.two_frame.residual = MatchResidual::disparity;
  other.two_frame.coordinates = MatchCoordinates::world;
  other.two_frame.source = MatchSource::previous;
  other.two_frame.robust_start = false;
  other.time_limit = {1'500'000'000};
  other.odometry.visual.loss = Barron(2.0, -2.0);
  other.odometry.inertial.loss = Loss::none();
  other.odometry.rest.pixels = 0.1 + 0.2;
  const std::string changed = run_config_text(other);
  EXPECT_NE(changed, text);
  const auto again = parse_run_config(changed, "printed");
  ASSERT_TRUE(again.errors.empty()) << again.errors[0];
  EXPECT_EQ(run_config_text(again.config), changed);
  EXPECT_EQ(again.config.odometry.rest.pixels, 0.1 + 0.2);
  EXPECT_EQ(again.config.task, "sliding_window");
  EXPECT_TRUE(again.config.defer);
  EXPECT_EQ(again.config.two_frame.source, MatchSource::previous);
}

// R9
TEST(NameTable, ListsWhatItKnowsAndRefusesANameThatIsTaken) {
  NameTable<int> tasks("task");
  EXPECT_EQ(tasks.find("a").error().message, "unknown task 'a'; expected one of none, since none was added");
  ASSERT_TRUE(tasks.add("a", 1));
  ASSERT_TRUE(tasks.add("b", 2));
  EXPECT_EQ(*tasks.find("b"), 2);
  EXPECT_EQ(tasks.find("c").error().message, "unknown task 'c'; expected one of a, b");
  const auto twice = tasks.add("a", 3);
  ASSERT_FALSE(twice);
  EXPECT_EQ(twice.error().code, ErrorCode::duplicate);
  EXPECT_EQ(twice.error().message, "two of kind task are named 'a'");
}

}  // namespace
}  // namespace oriel
