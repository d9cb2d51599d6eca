// A task and a loss of one's own in a config: their settings, their faults, and how they are printed. (The shortest
// task is in tests/run/custom_task_test.cc.)
#include <gtest/gtest.h>

#include "oriel/io/run_config.h"

namespace {

using namespace oriel;  // NOLINT(google-build-using-namespace): as a user would write it

struct Smoothing {
  static constexpr const char* kName = "smoothing";
  struct Map {
    std::vector<double> raw, smooth;
  };
  struct Config {
    double gain = 0.5;
    int passes = 1;
  };
  struct Context {
    Config config;
    double last = 0.0;
  };
  struct Input {
    std::vector<double> raw;
  };
  struct Output {
    std::vector<double> smooth;
  };
  static Context init_context(const Config& config) { return {config}; }
  Input collect(const Map& map) const { return {map.raw}; }
  static Output optimize(Context& c, const Input& in) {
    Output out;
    for (const double z : in.raw) out.smooth.push_back(c.last += c.config.gain * (z - c.last));
    return out;
  }
  static void write(const Output& out, Map& map) { map.smooth = out.smooth; }
};

struct Saturating {  // at most c², however far the measurement is off
  static constexpr std::string_view kName = "example.saturating/1";
  static LossValue<double> evaluate(double c, double s) {
    const double u = 1.0 + s / (c * c);
    return {s / u, 1.0 / (u * u)};
  }
};

RunNames my_names() {
  using namespace oriel::setting;
  RunNames names = shipped_names();
  const std::vector<Setting> settings = {
      {"gain", Real{member<&Smoothing::Config::gain>, 0.0, 1.0}, "-", "Share of the news that is believed."},
      {"passes", Whole{member<&Smoothing::Config::passes>, 1, 9}, "-", "How often."}};
  EXPECT_TRUE(names.tasks.add("smoothing", named_task<Smoothing>("An exponential mean.", settings)));
  EXPECT_TRUE(names.losses.add("saturating", {CustomLoss<Saturating>(1.0), "At most SCALE^2."}));
  return names;
}

// R9
TEST(CustomNames, ATaskOfOnesOwnRunsWhereTheConfigSaysWithItsSettings) {
  const RunNames names = my_names();
  Zygote zygote = Zygote::start({names.tasks.get("smoothing")->worker}).value();  // first line of main
  for (const char* executor : {"inline", "thread", "process"}) {
    const auto reading = parse_run_config(
        std::string("task: smoothing\nexecutor: ") + executor + "\nsmoothing: {gain: 0.25}\n", "mine.yaml", names);
    ASSERT_TRUE(reading.errors.empty()) << reading.errors[0];
    ASSERT_EQ(reading.config.task, "smoothing");
    ExecutorOptions options;
    options.zygote = &zygote;
    const auto& config = reading.config.options_of<Smoothing::Config>("smoothing");
    auto run = Executor<Smoothing>::start(reading.config.executor, config, options).value();
    Smoothing::Map map{{1.0, 1.0}, {}};
    ASSERT_TRUE(run.submit(Smoothing().collect(map)));
    ASSERT_TRUE(run.write_back(map));
    EXPECT_EQ(map.smooth, (std::vector<double>{0.25, 0.4375})) << executor;
  }
}

// R9
TEST(CustomNames, ALossOfOnesOwnIsNamedByAConfigAndPrintedAgain) {
  const RunNames names = my_names();
  const std::string text = "task: inertial_odometry\nexecutor: inline\nvisual: {loss: 'saturating:3'}\n";
  const auto reading = parse_run_config(text, "mine.yaml", names);
  ASSERT_TRUE(reading.errors.empty()) << reading.errors[0];
  EXPECT_EQ(reading.config.odometry.visual.loss.ops, &kLossOps<Saturating>);
  EXPECT_EQ(reading.config.odometry.visual.loss.scale, 3.0);
  const std::string all = run_config_text(reading.config, names);
  EXPECT_NE(all.find("loss: saturating:3\n"), std::string::npos);
  EXPECT_NE(all.find("\nsmoothing:\n  # Share of the news that is believed. 0 to 1.\n  gain: 0.5\n"), std::string::npos)
      << all;
  EXPECT_EQ(run_config_text(parse_run_config(all, "printed", names).config, names), all);
}

// R9
TEST(CustomNames, AreKnownWhereTheyWereAddedAloneAndListedThere) {
  const std::string text = "task: smoothing\nexecutor: inline\nsmoothing: {gain: 2}\nvisual: {loss: 'saturating:0'}\n";
  const auto mine = parse_run_config(text, "mine.yaml", my_names());
  ASSERT_EQ(mine.errors.size(), 2u);
  EXPECT_EQ(mine.errors[0].text(), "mine.yaml:3: expected a number from 0 to 1 for `smoothing.gain`, found '2'");
  EXPECT_EQ(mine.errors[1].text(),
            "mine.yaml:4: expected none, huber:SCALE, cauchy:SCALE, geman-mcclure:SCALE, tukey:SCALE, truncated:SCALE, "
            "barron:SCALE:ALPHA or saturating:SCALE with SCALE > 0 and ALPHA <= 2 for `visual.loss`, found "
            "'saturating:0'");
  const auto shipped = parse_run_config(text, "mine.yaml");
  ASSERT_EQ(shipped.errors.size(), 3u);
  EXPECT_EQ(shipped.errors[0].text(),
            "mine.yaml:1: expected one of inertial_odometry, sliding_window, two_frame for `task`, found 'smoothing'");
  EXPECT_EQ(shipped.errors[1].text().substr(0, 36), "mine.yaml:3: unknown key 'smoothing'");
  RunNames names = my_names();
  EXPECT_EQ(names.losses.add("huber", {Huber(1.0), ""}).error().message, "two of kind loss are named 'huber'");
  EXPECT_EQ(names.tasks.add("smoothing", {""}).error().code, ErrorCode::duplicate);
}

}  // namespace
