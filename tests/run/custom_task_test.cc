// A task of one's own, in place, in a thread or in a child process.
#include <gtest/gtest.h>

#include "oriel/run/executor.h"

namespace oriel {
namespace {

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

// R1: the word of a config decides where it runs.
TEST(CustomTask, RunsWhereAWordSays) {
  Zygote zygote = Zygote::start({&kTaskOps<Smoothing>}).value();  // first line of main
  ExecutorOptions options;
  options.zygote = &zygote;
  for (const char* word : {"inline", "thread", "process"}) {
    auto executor = Executor<Smoothing>::start(executor_kind(word).value(), {0.5}, options).value();
    Smoothing::Map map;
    map.raw = {1.0, 1.0, 1.0};
    ASSERT_TRUE(executor.submit(Smoothing().collect(map)));  // at once, and the caller goes on
    ASSERT_TRUE(executor.write_back(map));
    EXPECT_EQ(map.smooth, (std::vector<double>{0.5, 0.75, 0.875})) << word;
  }
}

}  // namespace
}  // namespace oriel
