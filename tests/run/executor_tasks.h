// Tasks for tests of executors.
#pragma once
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <stdexcept>
#include <thread>
#include <vector>

#include "oriel/run/executor.h"

namespace oriel::testing_run {

// What a job is to do beside its work.
enum class Mishap {
  none,
  throws,
  fails,
  segfaults,
  allocates,
  allocates_where_nothing_throws,
  stops,
  sleeps,
  exits,
  forks,  // a child that stays
  spins
};

struct World {
  std::vector<double> values;
  int written = 0, jobs = 0;
  pid_t worker = 0;
};

template <class Context>
struct Sums {
  struct Config {
    double factor = 1.0;
    bool refuses = false;
  };
  struct Input {
    std::vector<double> values;
    Mishap mishap = Mishap::none;
    int milliseconds = 0;
    int merged = 1;
  };
  struct Output {
    std::vector<double> values;
    int jobs = 0, merged = 0;
    pid_t worker = 0;
  };

  static Result<Context> init_context(const Config& c) {
    if (c.refuses) return Error{ErrorCode::bad_input, "expected a config that does not refuse"};
    Context context;
    context.factor = c.factor;
    return context;
  }
  Input collect(const World& world) const { return {world.values}; }
  static Result<Output> optimize(Context& context, const Input& in) {
    ++context.jobs;  // before anything goes wrong
    context.sum *= 1.0000001;
    for (const double v : in.values) context.sum += context.factor * v;
    if (in.mishap == Mishap::fails) return Error{ErrorCode::bad_input, "the lens is missing"};
    cause(in);
    Output out;
    out.jobs = context.jobs;
    out.merged = in.merged;
    out.worker = ::getpid();
    for (const double v : in.values) out.values.push_back(v / 3.0 + context.sum);
    return out;
  }
  static Input merge(const Input& waiting, const Input& newer) {
    Input both = newer;
    both.values.insert(both.values.begin(), waiting.values.begin(), waiting.values.end());
    both.merged = waiting.merged + newer.merged;
    return both;
  }
  static void write(const Output& out, World& world) {
    world.values = out.values;
    world.jobs = out.jobs;
    world.worker = out.worker;
    ++world.written;
  }

 private:
  [[noreturn]] static void allocate() {
    std::vector<std::vector<char>> all;
    for (;;) all.emplace_back(64u << 20);
  }
  static void cause(const Input& in) {
    switch (in.mishap) {
      case Mishap::none:
      case Mishap::fails:
        return;
      case Mishap::throws:
        throw std::runtime_error("the lens is dirty");
      case Mishap::segfaults:
        std::raise(SIGSEGV);
        return;
      case Mishap::allocates:
        allocate();
      case Mishap::allocates_where_nothing_throws:
        []() noexcept { allocate(); }();
        return;
      case Mishap::stops:
        std::raise(SIGSTOP);
        return;
      case Mishap::sleeps:
        std::this_thread::sleep_for(std::chrono::milliseconds(in.milliseconds));
        return;
      case Mishap::exits:
        ::_exit(3);
      case Mishap::forks:
        if (::fork() == 0) {
          ::pause();
          ::_exit(0);
        }
        return;
      case Mishap::spins:
        for (;;) std::atomic_signal_fence(std::memory_order_seq_cst);
    }
  }
};

struct TravellingContext {
  double factor = 1.0, sum = 0.0;
  int jobs = 0;
};
// Can be copied and cannot travel.
struct StayingContext : TravellingContext {
  std::vector<bool> cache;
};
// Can be neither.
struct UniqueContext : TravellingContext {
  UniqueContext() = default;
  UniqueContext(UniqueContext&&) = default;
  UniqueContext& operator=(UniqueContext&&) = default;
  std::vector<bool> cache;
};

// Can travel and cannot be copied.
struct MovingContext : TravellingContext {
  MovingContext() = default;
  MovingContext(MovingContext&&) = default;
  MovingContext& operator=(MovingContext&&) = default;
  template <class Visit>
  void transfer(Visit&& visit) {
    visit(factor, sum, jobs);
  }
};
// Cannot be copied any more after two jobs.
struct BrittleContext : TravellingContext {
  BrittleContext() = default;
  BrittleContext(const BrittleContext& other) : TravellingContext(other) {
    if (jobs >= 2) throw std::runtime_error("one copy too many");
  }
  BrittleContext& operator=(const BrittleContext&) = default;
  std::vector<bool> cache;
};

struct TravellingSums : Sums<TravellingContext> {
  static constexpr const char* kName = "sums";
};
struct StayingSums : Sums<StayingContext> {
  static constexpr const char* kName = "staying_sums";
};
struct UniqueSums : Sums<UniqueContext> {
  static constexpr const char* kName = "unique_sums";
};
struct MovingSums : Sums<MovingContext> {
  static constexpr const char* kName = "moving_sums";
};
struct BrittleSums : Sums<BrittleContext> {
  static constexpr const char* kName = "brittle_sums";
};
static_assert(kTaskOps<MovingSums>.context_travels && !std::copy_constructible<MovingContext>);
static_assert(Task<TravellingSums> && Task<StayingSums> && Task<UniqueSums>);
static_assert(kTaskOps<TravellingSums>.context_travels);
static_assert(!kTaskOps<StayingSums>.context_travels && !kTaskOps<UniqueSums>.context_travels);

inline Zygote test_zygote() {
  return Zygote::start({&kTaskOps<TravellingSums>, &kTaskOps<StayingSums>, &kTaskOps<UniqueSums>, &kTaskOps<MovingSums>,
                        &kTaskOps<BrittleSums>})
      .value();
}

}  // namespace oriel::testing_run
