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
  EXPECT_EQ(c.memory_limit_mb, 512u);
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
                    "run.yaml:7: expected a map of keys under `updates`"}));
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
  other.task = "two_frame";
  other.defer = true;
  other.two_frame.residual = MatchResidual::disparity;
  other.two_frame.coordinates = MatchCoordinates::world;
  other.two_frame.source = MatchSource::previous;
  other.two_frame.robust_start = false;
  other.engine = "ceres";
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
  EXPECT_EQ(again.config.task, "two_frame");
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
