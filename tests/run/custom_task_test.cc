// A task of one's own, named by a config, in place, in a thread or in a child process. This file is all that it takes.
#include <gtest/gtest.h>

#include "oriel/io/run_config.h"

namespace {

using namespace oriel;  // NOLINT(google-build-using-namespace): as a user would write it

// A smoothed track: what the caller has, what the work is told and answers, what it keeps from job to job.
struct Smoothing {
  static constexpr const char* kName = "smoothing";
  struct Map {
    std::vector<double> raw, smooth;
  };
  struct Config {
    double gain = 0.5;
  };
  struct Context {
    double gain, last = 0.0;
  };
  struct Input {
    std::vector<double> raw;
  };
  struct Output {
    std::vector<double> smooth;
  };

  static Context init_context(const Config& config) { return {config.gain}; }
  Input collect(const Map& map) const { return {map.raw}; }
  static Output optimize(Context& context, const Input& in) {
    Output out;
    for (const double z : in.raw) out.smooth.push_back(context.last += context.gain * (z - context.last));
    return out;
  }
  static void write(const Output& out, Map& map) { map.smooth = out.smooth; }
};

// R1, R9: the words of a config decide what runs, and where.
TEST(CustomTask, RunsWhereAConfigSays) {
  const setting::Real gain{setting::member<&Smoothing::Config::gain>, 0.0, 1.0};
  RunNames names = shipped_names();
  ASSERT_TRUE(names.tasks.add("smoothing", named_task<Smoothing>("A mean.", {{"gain", gain, "-", "Of the news."}})));
  Zygote zygote = Zygote::start({names.tasks.get("smoothing")->worker}).value();  // first line of main
  for (const std::string executor : {"inline", "thread", "process"}) {
    const std::string yaml = "task: smoothing\nexecutor: " + executor + "\nsmoothing: {gain: 0.25}\n";
    const auto [config, errors] = parse_run_config(yaml, "mine.yaml", names);
    ASSERT_TRUE(errors.empty()) << errors[0];
    const auto& options = config.options_of<Smoothing::Config>(config.task);
    auto run = Executor<Smoothing>::start(config.executor, options, worker_options(config, &zygote)).value();
    Smoothing::Map map{{1.0, 1.0, 1.0}, {}};
    ASSERT_TRUE(run.submit(Smoothing().collect(map)));  // at once, and the caller goes on
    ASSERT_TRUE(run.write_back(map));
    EXPECT_EQ(map.smooth, (std::vector<double>{0.25, 0.4375, 0.578125})) << executor;
  }
}

}  // namespace
