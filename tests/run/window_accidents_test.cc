// A window whose solves run in a child process, through accidents of all kinds at random moments: killed, a crash and a
// lack of memory in a user's residual, stopped past a time limit. What it comes to has the bits of the window that
// solves in place, and nothing is left behind (R6, R7). ORIEL_KILLS says how many accidents the long form makes.
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <iostream>
#include <random>
#include <utility>

#include "oriel/graph/fingerprint.h"
#include "oriel/run/beside_engine.h"
#include "oriel/run/thread_count.h"
#include "oriel/run/window_solver.h"
#include "oriel/window/inertial_odometry.h"
#include "run/processes.h"
#include "run/same_bits.h"
#include "window/simulated_flight.h"

namespace oriel {
namespace {

using Clock = std::chrono::steady_clock;

enum class Accident : int { killed, crashes, runs_out_of_memory, stops, count };
constexpr int kAccidents = static_cast<int>(Accident::count);

// What is to befall workers, one after the other, each after so many evaluations of the user's residual. In memory that
// all processes share, since a worker that is gone has to be remembered.
class Fate {
 public:
  static Fate* make() {
    void* at = ::mmap(nullptr, sizeof(Fate), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    return new (at) Fate;
  }
  void begin(unsigned seed, int wanted, bool may_limit_memory) {
    std::mt19937 random(seed);
    wanted_ = std::min<int>(wanted, kMost);
    for (int i = 0; i < wanted_; ++i) {
      Accident a = static_cast<Accident>(random() % kAccidents);
      if (a == Accident::stops && random() % 4 != 0) a = Accident::killed;  // each takes as long as the limit
      if (a == Accident::runs_out_of_memory && !may_limit_memory) a = Accident::killed;
      // Often enough none comes while one solve lasts.
      steps_[i] = {1 + static_cast<int>(random() % (random() % 3 == 0 ? 200 : 20)), a};
    }
    for (auto& n : seen_) n = 0;
    next_ = 0;
    left_ = steps_[0].evaluations;
    owner_ = ::getpid();
  }
  void end() { wanted_ = 0; }
  int seen(Accident a) const { return seen_[static_cast<std::size_t>(a)]; }
  int seen() const { return next_; }

  void evaluated() {
    if (::getpid() == owner_ || next_ >= wanted_ || --left_ > 0) return;
    const Accident a = steps_[next_].accident;
    if (++next_ < wanted_) left_ = steps_[next_].evaluations;
    ++seen_[static_cast<std::size_t>(a)];
    befall(a);
  }

 private:
  static constexpr int kMost = 1 << 15;
  struct Step {
    int evaluations;
    Accident accident;
  };
  static void befall(Accident a) {
    if (a == Accident::killed) ::kill(::getpid(), SIGKILL);
    if (a == Accident::crashes) std::raise(SIGSEGV);
    if (a == Accident::stops) std::raise(SIGSTOP);
    if (a != Accident::runs_out_of_memory) return;
    std::vector<std::unique_ptr<char[]>> all;
    for (;;) all.emplace_back(new char[std::size_t{64} << 20]);
  }

  std::atomic<int> next_{0}, left_{0}, wanted_{0};
  std::array<std::atomic<int>, kAccidents> seen_{};
  pid_t owner_ = 0;
  std::array<Step, kMost> steps_{};
};
Fate* fate = nullptr;  // the residual has no other way to it

// A user's residual: the height of the body [m].
struct Altimeter {
  static constexpr std::string_view kName = "test.altimeter/1";
  using Variables = Types<Pose3d>;
  double height;
  template <class S>
  Vec<S, 1> operator()(const Pose3<S>& T_world_body) const {
    fate->evaluated();
    return {{T_world_body.t[2] - S(height)}};
  }
};

struct AltimeterTypes {
  static constexpr const char* kName = "altimeter";
  static TypeList types() {
    TypeList types = shipped_types();
    types.factor<Altimeter, IsotropicNoise>();
    return types;
  }
};

constexpr double kTimeLimit = kSanitized ? 3.0 : 0.1;  // [s] of a job
constexpr double kBegunAnew = 0.03;                    // [s] that a new worker and another solve may take

class WindowAccidents : public ::testing::TestWithParam<bool> {  // whether solves go on beside the updates
 protected:
  WindowAccidents() : flight_({.rest_s = 1.5, .duration_s = 8.0 + wanted() / 8.0}) {}
  ~WindowAccidents() override { ::munmap(fate, sizeof(Fate)); }
  static bool is_long() { return std::getenv("ORIEL_KILLS") != nullptr; }
  static int wanted() { return is_long() ? std::atoi(std::getenv("ORIEL_KILLS")) : 60; }

  struct Flown {
    std::vector<std::uint64_t> fingerprints;
    Trajectory causal, final;
    double longest_s = 0.0;  // that an update took, beyond time limits and jobs that were begun anew
  };

  void place(WindowCore& window, ExecutorKind kind) {
    ExecutorOptions options;
    options.zygote = &zygote_;
    options.time_limit = Duration::from_seconds(kTimeLimit);
    options.retry_late = true;
    if (kMayLimitMemory) options.limits.memory_bytes = 1u << 30;
    if (GetParam()) {
      auto solver = WindowSolverWith<AltimeterTypes>::make(window.followed(), kind, options, kTries);
      ASSERT_TRUE(solver) << solver.error();
      ASSERT_TRUE(window.defer_to(std::move(*solver)));
    } else {
      auto engine = BesideEngineWith<AltimeterTypes>::make(window.followed(), kind, options, kTries);
      ASSERT_TRUE(engine) << engine.error();
      ASSERT_TRUE(window.use(std::move(*engine)));
    }
  }

  Flown fly(ExecutorKind kind) {
    InertialOdometry odometry(flight_.rig, true, flight_.noise, {});
    place(odometry.window(), kind);
    Flown out;
    struct Count {
      int stops = 0, all = 0;
    } before;
    std::size_t next = 0;
    for (std::size_t k = 0; k < flight_.frames.size(); ++k) {
      const auto& frame = flight_.frames[k];
      for (; next < flight_.imu.size() && flight_.imu[next].time <= frame.time; ++next)
        EXPECT_TRUE(odometry.add_imu(flight_.imu[next]));
      // An update beside waits for what the one before began.
      const Count now{fate->seen(Accident::stops), fate->seen()}, since = GetParam() ? std::exchange(before, now) : now;
      const auto begin = Clock::now();
      odometry.update({frame.time, frame.features});
      const double took = std::chrono::duration<double>(Clock::now() - begin).count();
      out.longest_s = std::max(out.longest_s, took - kTimeLimit * (fate->seen(Accident::stops) - since.stops) -
                                                  kBegunAnew * (fate->seen() - since.all));
      out.fingerprints.push_back(fingerprint(odometry.window().graph()));
      if (k % 3 == 0) add_altimeter(odometry, flight_.pose(0.1 * static_cast<double>(k)).t[2]);
    }
    odometry.settle();
    out.fingerprints.push_back(fingerprint(odometry.window().graph()));
    out.causal = odometry.causal();
    out.final = odometry.final();
    return out;
  }
  static void add_altimeter(InertialOdometry& odometry, double height) {
    if (odometry.timeline().size() == 0) return;
    odometry.window().edit().add(Altimeter{height}, Sigma(0.05), odometry.timeline().latest()->pose);
    ASSERT_TRUE(odometry.window().commit());
  }

  static constexpr int kTries = 60;  // accidents come one after the other
  Zygote zygote_ = [] {
    fate = Fate::make();
    return Zygote::start({&SolveBesideWith<AltimeterTypes>::kTask}).value();
  }();
  SimulatedFlight flight_;
};

TEST_P(WindowAccidents, HaveTheTrajectoryOfTheUndisturbedRunAndLeaveNothingBehind) {
  fate->end();
  const Flown calm = fly(ExecutorKind::in_place);
  const int descriptors = descriptor_count(), threads = thread_count();
  fate->begin(3, wanted(), kMayLimitMemory);
  const Flown stormy = fly(ExecutorKind::process);
  EXPECT_EQ(fate->seen(), wanted());
  for (int a = 0; a < kAccidents; ++a)
    EXPECT_TRUE(fate->seen(static_cast<Accident>(a)) > 0 || !kMayLimitMemory) << "accident " << a;
  EXPECT_TRUE(stormy.fingerprints == calm.fingerprints);
  EXPECT_TRUE(same_bits(stormy.causal, calm.causal));
  EXPECT_TRUE(same_bits(stormy.final, calm.final));
  // 100 ms are the claim; tests share their machine with whatever else runs on it.
  if (!kSanitized) {
    EXPECT_LT(stormy.longest_s, is_long() ? 0.1 : 2.0);
  }
  EXPECT_TRUE(goes_childless(zygote_.pid()));
  EXPECT_EQ(descriptor_count(), descriptors);
  EXPECT_EQ(thread_count(), threads);
  if (is_long())
    std::cout << fate->seen() << " accidents in " << flight_.frames.size()
              << " frames: " << fate->seen(Accident::killed) << " killed, " << fate->seen(Accident::crashes)
              << " crashed, " << fate->seen(Accident::runs_out_of_memory) << " without memory, "
              << fate->seen(Accident::stops) << " stopped; longest update " << stormy.longest_s
              << " s past the limits\n";
}
INSTANTIATE_TEST_SUITE_P(Waiting, WindowAccidents, ::testing::Values(false));
INSTANTIATE_TEST_SUITE_P(Beside, WindowAccidents, ::testing::Values(true));

}  // namespace
}  // namespace oriel
