// A window that is put together by a config: its parts by name, each with settings of its own (R9).
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "oriel/io/run_config.h"

namespace oriel {
namespace {

std::vector<std::string> faults(const std::string& text) {
  std::vector<std::string> out;
  for (const Error& e : parse_run_config("task: sliding_window\nexecutor: inline\n" + text, "w.yaml").errors)
    out.push_back(e.text());
  return out;
}
using Faults = std::vector<std::string>;

std::vector<std::string> names_of(const std::vector<PartChoice>& parts) {
  std::vector<std::string> out;
  for (const PartChoice& p : parts) out.push_back(p.name);
  return out;
}

// R9
TEST(WindowConfig, PutsAWindowTogetherOutOfPartsByName) {
  const auto reading = parse_run_config(
      "task: sliding_window\n"
      "executor: process\n"
      "defer: true\n"
      "window: {max_iterations: 5, landmarks: keep, policy: {name: lag, max_states: 6}}\n"
      "providers:\n"
      "  - {name: imu, noise_factor: 4}\n"
      "builders: [structureless]\n"
      "hooks:\n"
      "  - cheirality\n"
      "  - {name: mahalanobis_gate, builder: structureless, probability: 0.99}\n",
      "w.yaml");
  ASSERT_TRUE(reading.errors.empty()) << reading.errors[0];
  const WindowPlan& plan = reading.config.window;
  EXPECT_TRUE(reading.config.defer);
  EXPECT_EQ(plan.window.solve.max_iterations, 5);
  EXPECT_EQ(plan.window.marginalize.landmarks, LandmarkPolicy::keep);
  EXPECT_EQ(names_of(plan.providers), (Faults{"imu"}));
  EXPECT_EQ(names_of(plan.builders), (Faults{"structureless"}));
  EXPECT_EQ(names_of(plan.hooks), (Faults{"cheirality", "mahalanobis_gate"}));
  EXPECT_EQ(plan.policy.name, "lag");
  EXPECT_EQ(plan.policy.options.as<Lag>().max_states, 6);
  EXPECT_EQ(plan.policy.line, 4);
}

// R9: what is not said is visual-inertial odometry.
TEST(WindowConfig, HasPartsByDefault) {
  const auto reading = parse_run_config("task: sliding_window\nexecutor: inline\n", "w.yaml");
  ASSERT_TRUE(reading.errors.empty()) << reading.errors[0];
  EXPECT_EQ(names_of(reading.config.window.providers), (Faults{"imu"}));
  EXPECT_EQ(names_of(reading.config.window.builders), (Faults{"tracks"}));
  EXPECT_EQ(names_of(reading.config.window.hooks), (Faults{"refine", "cheirality", "standstill"}));
  EXPECT_EQ(reading.config.window.policy.name, "keyframes");
}

// R9: all of them, each with its line.
TEST(WindowConfig, NamesEveryFaultOfItsPartsWithFileAndLine) {
  EXPECT_EQ(
      faults("window:\n"
             "  policy: {name: lag, max_states: none}\n"
             "  colour: red\n"
             "providers:\n"
             "  - name: gyroscope\n"
             "  - {name: constant_velocity, gravity: 9.8}\n"
             "  - constant_velocity\n"
             "builders:\n"
             "  - {name: tracks, leaving: absorb, states: imu, gate: -1}\n"
             "  - {gate: 3}\n"
             "hooks: cheirality\n"),
      (Faults{"w.yaml:4: expected a whole number from 1 to 100000 for `window.policy.lag.max_states`, found 'none'",
              "w.yaml:5: unknown key 'window.colour'; expected max_iterations, function_tolerance, first_estimates, "
              "landmarks, outlier_threshold, keep_prior, slide_before_solve, failures_before_reset, policy",
              "w.yaml:7: unknown provider 'gyroscope'; expected one of imu, constant_velocity, odometry",
              "w.yaml:8: unknown key 'gravity' of the provider constant_velocity (it is of imu); expected name, "
              "acceleration, rotation, longest",
              "w.yaml:9: two of kind provider are named 'constant_velocity'",
              "w.yaml:11: unknown key 'leaving' of the builder tracks (it is of structureless); expected name, states, "
              "landmarks, stereo, pixel_sigma, loss, gate, start_gate, least_depth, greatest_depth, least_parallax, "
              "expected_tracks, expected_states",
              "w.yaml:11: expected a number from 0 to 1e+12 for `builders.tracks.gate`, found '-1'",
              "w.yaml:12: expected the key `name` in a part of `builders`",
              "w.yaml:13: expected a list of parts under `hooks`, found 'cheirality'",
              "w.yaml:11: expected one of this window's providers (constant_velocity, constant_velocity) for "
              "`builders.tracks.states`, found 'imu'"}));
}

// R9: parts that are right each by itself, and do not fit each other, before anything starts.
TEST(WindowConfig, NamesPartsThatDoNotFitEachOther) {
  EXPECT_EQ(faults("providers: [constant_velocity]\nhooks:\n  - refine\n  - standstill\n"),
            (Faults{"w.yaml:6: the hook standstill: expected an IMU as provider"}));
  EXPECT_EQ(faults("window: {policy: {name: lag, min_states: 9, max_states: 4}}\n"),
            (Faults{"w.yaml:3: the policy lag: max_states = 4 is less than min_states = 9"}));
  EXPECT_EQ(faults("window: {keep_prior: true}\nproviders: []\n"), (Faults{"w.yaml:4: a window needs a provider"}));
  EXPECT_EQ(faults("builders: []\n"), (Faults{"w.yaml:3: a window needs a builder"}));
  // A part that is there by default has no line but that of the task.
  EXPECT_EQ(faults("providers: [constant_velocity]\n"),
            (Faults{"w.yaml:1: the hook standstill: expected an IMU as provider"}));
  // Of another task it is not put together.
  EXPECT_TRUE(parse_run_config("task: two_frame\nexecutor: inline\nproviders: []\n", "w.yaml").errors.empty());
}

// Every part with every setting, those that are not in use as comments; and again what it was.
TEST(WindowConfig, IsPrintedWithAllPartsThatThereAre) {
  const RunNames names = shipped_names();
  const std::string text = run_config_text(names);
  for (const auto* table : {&names.providers, &names.builders, &names.hooks, &names.policies})
    for (const auto& [name, part] : table->items()) {
      EXPECT_NE(text.find("name: " + name + "\n"), std::string::npos) << name;
      EXPECT_NE(text.find(std::string("# ") + part.sentence + "\n"), std::string::npos) << name;
      for (const Setting& s : part.settings) EXPECT_NE(text.find(" " + s.name + ": "), std::string::npos) << s.name;
    }
  const auto other = parse_run_config(
      "task: sliding_window\nexecutor: thread\nwindow: {policy: lag}\nproviders: [constant_velocity]\n"
      "builders: [{name: tracks, loss: 'huber:3', states: constant_velocity}]\n"
      "hooks: [{name: mahalanobis_gate, probability: 0.5}, mahalanobis_gate]\n",
      "w.yaml");
  ASSERT_TRUE(other.errors.empty()) << other.errors[0];
  const std::string changed = run_config_text(other.config);
  const auto again = parse_run_config(changed, "printed");
  ASSERT_TRUE(again.errors.empty()) << again.errors[0] << changed;
  EXPECT_EQ(run_config_text(again.config), changed);
  EXPECT_EQ(again.config.window.hooks.size(), 2u);
}

// A part that is a comment is used by taking the first # of its lines away.
TEST(WindowConfig, ShowsPartsThatAreNotInUseAsCommentsThatCanBeTakenAway) {
  std::istringstream in(run_config_text());
  std::string out;
  bool inside = false;
  for (std::string line; std::getline(in, line); out += line + '\n') {
    if (line == "#  - name: gap_reset") inside = true;
    if (line.find("# Takes out sightings") != std::string::npos) inside = false;
    if (inside && line[0] == '#') line.erase(0, 1);
  }
  const auto reading = parse_run_config(out, "printed");
  ASSERT_TRUE(reading.errors.empty()) << reading.errors[0] << out;
  EXPECT_EQ(names_of(reading.config.window.hooks), (Faults{"refine", "cheirality", "standstill", "gap_reset"}));
}

// What docs/config.md shows. (tests/apps flies with it.)
TEST(WindowConfig, OfThePageIsTakenAsItStandsThere) {
  std::ifstream in(std::string(ORIEL_SOURCE_DIR) + "/docs/config.md");
  int shown = 0;
  std::string yaml;
  bool inside = false;
  for (std::string line; std::getline(in, line);) {
    if (line == "```yaml") {
      inside = true, yaml.clear();
    } else if (inside && line == "```") {
      inside = false, ++shown;
      const auto reading = parse_run_config(yaml, "docs/config.md");
      EXPECT_TRUE(reading.errors.empty()) << reading.errors[0] << yaml;
    } else if (inside) {
      yaml += line + '\n';
    }
  }
  EXPECT_EQ(shown, 2);
}

}  // namespace
}  // namespace oriel
