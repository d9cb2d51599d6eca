// What running beside the caller costs and wins: round trips of the three executors, throughput of their messages, the
// time until a killed worker answers again, and frames per second beside a front end that takes 20 ms of each. What a
// window's updates take whose solves run elsewhere says `oriel run RECORDING --executor process`.
//
//   executors [ROUNDS]
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "oriel/base/percentile.h"
#include "oriel/run/executor.h"

namespace oriel {
namespace {

using Clock = std::chrono::steady_clock;
double micros_since(Clock::time_point t) { return std::chrono::duration<double, std::micro>(Clock::now() - t).count(); }
double share(std::vector<double>& us, double p) {
  std::sort(us.begin(), us.end());
  return percentile(us, p);
}
void spin(double ms) {
  for (const auto begin = Clock::now(); micros_since(begin) < 1e3 * ms;) {
  }
}

struct Echo {
  static constexpr const char* kName = "echo";
  struct Map {
    std::uint64_t bytes = 0;
  };
  struct Config {};
  struct Context {
    std::uint64_t jobs = 0;
  };
  struct Input {
    double work_ms = 0.0;
    std::vector<double> values;
  };
  struct Output {
    std::vector<double> values;
  };
  static Context init_context(const Config&) { return {}; }
  Input collect(const Map&) const { return {}; }
  static Output optimize(Context& context, const Input& in) {
    ++context.jobs;
    if (in.work_ms > 0.0) spin(in.work_ms);
    return {in.values};
  }
  static void write(const Output& out, Map& map) { map.bytes += out.values.size() * sizeof(double); }
};

constexpr ExecutorKind kAll[] = {ExecutorKind::in_place, ExecutorKind::thread, ExecutorKind::process};

Executor<Echo> echo(ExecutorKind kind, Zygote& zygote) {
  ExecutorOptions options;
  options.zygote = &zygote;
  return std::move(Executor<Echo>::start(kind, {}, options).value());
}

void round_trips(Zygote& zygote, int rounds) {
  std::printf("round trips of a task that gives back what it gets [us]\n");
  std::printf("%10s %10s %10s %10s %12s\n", "bytes", "executor", "p50", "p99", "GB/s, p50");
  for (const std::size_t bytes : {std::size_t{64}, std::size_t{16384}, std::size_t{1} << 20, std::size_t{1} << 25}) {
    for (const ExecutorKind kind : kAll) {
      auto executor = echo(kind, zygote);
      Echo::Map map;
      Echo::Input in;
      in.values.assign(bytes / sizeof(double), 1.0);
      std::vector<double> us;
      for (int i = 0, n = bytes > (1u << 20) ? 30 : rounds; i < n; ++i) {
        const auto begin = Clock::now();
        executor.submit(in);
        executor.write_back(map);
        us.push_back(micros_since(begin));
      }
      const double p50 = share(us, 0.5);
      std::printf("%10zu %10s %10.1f %10.1f %12.2f\n", bytes, name_of(kind).c_str(), p50, share(us, 0.99),
                  2.0 * static_cast<double>(bytes) / p50 * 1e-3);
    }
  }
}

void restarts(Zygote& zygote, int rounds) {
  auto executor = echo(ExecutorKind::process, zygote);
  Echo::Map map;
  std::vector<double> us;
  for (int i = 0; i < rounds / 10; ++i) {
    executor.submit({});
    executor.write_back(map);
    pid_t pid = -1;
    std::ifstream("/proc/" + std::to_string(zygote.pid()) + "/task/" + std::to_string(zygote.pid()) + "/children") >>
        pid;
    ::kill(pid, SIGKILL);
    spin(2.0);  // it is gone by then
    const auto begin = Clock::now();
    executor.submit({});
    if (executor.write_back(map).restarted) us.push_back(micros_since(begin));
  }
  std::printf("a killed worker answers again after [us]: p50 %.0f, p99 %.0f, of %zu\n", share(us, 0.5), share(us, 0.99),
              us.size());
}

void front_end(Zygote& zygote) {
  std::printf("frames per second, with 20 ms of a front end and a solve of 10 ms in each\n");
  for (const ExecutorKind kind : kAll) {
    auto executor = echo(kind, zygote);
    Echo::Map map;
    const auto begin = Clock::now();
    const int frames = 100;
    for (int i = 0; i < frames; ++i) {
      spin(20.0);
      executor.write_back(map);  // of the frame before
      executor.submit({10.0, {}});
    }
    executor.write_back(map);
    std::printf("%10s %10.1f\n", name_of(kind).c_str(), frames * 1e6 / micros_since(begin));
  }
}

}  // namespace
}  // namespace oriel

int main(int argc, char** argv) {
  using namespace oriel;
  auto zygote = Zygote::start({&kTaskOps<Echo>});
  if (!zygote) {
    std::fprintf(stderr, "%s\n", zygote.error().text().c_str());
    return 1;
  }
  const int rounds = argc > 1 ? std::atoi(argv[1]) : 2000;
  if (argc > 2 || rounds < 100) {
    std::fprintf(stderr, "executors: expected [ROUNDS], at least 100\n");
    return 2;
  }
  round_trips(*zygote, rounds);
  restarts(*zygote, rounds);
  front_end(*zygote);
}
