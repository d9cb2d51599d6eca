// Trouble around worker processes that is not theirs: a zygote that is stopped or killed, a program that ignores the
// ends of its children or ends its first thread, children of a task (R6, R7).
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/wait.h>

#include <functional>

#include "run/executor_tasks.h"
#include "run/processes.h"
#include "run/worker_of.h"

namespace oriel {
namespace {

using namespace testing_run;
using Clock = std::chrono::steady_clock;
using Sums = Executor<TravellingSums>;

double seconds_since(Clock::time_point t) { return std::chrono::duration<double>(Clock::now() - t).count(); }

Sums make(Zygote& zygote, ExecutorOptions options = {}) {
  options.zygote = &zygote;
  return std::move(Sums::start(ExecutorKind::process, {2.0, false}, options).value());
}

// What a program of its own writes, and how it ended.
struct Told {
  std::string text;
  int status = 0;
};
Told run_program(const std::function<std::string()>& program) {
  int ends[2];
  EXPECT_EQ(::pipe(ends), 0);
  const pid_t pid = ::fork();
  if (pid == 0) {
    ::close(ends[0]);
    const std::string text = program();
    static_cast<void>(!::write(ends[1], text.data(), text.size()));
    ::_exit(0);
  }
  ::close(ends[1]);
  Told out;
  char letters[512];
  for (ssize_t n; (n = ::read(ends[0], letters, sizeof(letters))) > 0;)
    out.text.append(letters, static_cast<std::size_t>(n));
  ::close(ends[0]);
  ::waitpid(pid, &out.status, 0);
  return out;
}

TEST(WorkerTrouble, AStoppedZygoteIsNotWaitedForBeyondTheLimit) {
  Zygote zygote = test_zygote();
  ExecutorOptions options;
  options.time_limit = Duration::from_seconds(0.2);
  auto executor = make(zygote, options);
  World world;
  ASSERT_TRUE(executor.submit({{1.0}}));
  ASSERT_EQ(executor.write_back(world).status, JobStatus::done);
  ::kill(zygote.pid(), SIGSTOP);
  ::kill(worker_of(zygote), SIGKILL);
  const auto begin = Clock::now();
  JobReport report = executor.submit({{1.0}});
  if (report) report = executor.write_back(world);
  EXPECT_LT(seconds_since(begin), 0.9) << "0.2 s are the limit, 1 s is what a zygote is waited for without one";
  EXPECT_EQ(report.status, JobStatus::died);
  report = executor.submit({{1.0}});
  EXPECT_EQ(report.status, JobStatus::died);
  EXPECT_EQ(report.message, "the zygote does not answer: somebody has stopped it");
  ::kill(zygote.pid(), SIGCONT);
  ASSERT_TRUE(executor.submit({{1.0}})) << "it goes on where the zygote does";
  EXPECT_EQ(executor.write_back(world).status, JobStatus::done);
  EXPECT_EQ(world.jobs, 2);
  for (int i = 0; i < 200 && children_of(zygote.pid()).size() > 1; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_EQ(children_of(zygote.pid()).size(), 1u) << "those that were made late have gone";
}

TEST(WorkerTrouble, AKilledZygoteIsAnErrorThatSaysSo) {
  Zygote zygote = test_zygote();
  auto executor = make(zygote);
  World world;
  const pid_t worker = worker_of(zygote);
  ::kill(zygote.pid(), SIGKILL);
  EXPECT_TRUE(goes(worker)) << "workers go with it";
  for (int i = 0; i < 2; ++i) {
    JobReport report = executor.submit({{1.0}});
    if (report) report = executor.write_back(world);
    EXPECT_EQ(report.status, JobStatus::died);
    EXPECT_NE(report.message.find("the zygote has gone"), std::string::npos) << report;
  }
  EXPECT_EQ(world.written, 0);
}

// R6: a child of the task holds the worker's socket open.
TEST(WorkerTrouble, WhomATaskForksGoesWithItsWorker) {
  Zygote zygote = test_zygote();
  auto executor = make(zygote);
  World world;
  ASSERT_TRUE(executor.submit({{1.0}, Mishap::forks}));
  ASSERT_EQ(executor.write_back(world).status, JobStatus::done);
  const auto grandchildren = children_of(world.worker);
  ASSERT_EQ(grandchildren.size(), 1u);
  ASSERT_TRUE(executor.submit({{1.0}, Mishap::sleeps, 10000}));
  const auto begin = Clock::now();
  ::kill(world.worker, SIGKILL);
  EXPECT_EQ(executor.write_back(world).status, JobStatus::died);
  EXPECT_LT(seconds_since(begin), 2.0);
  EXPECT_TRUE(goes(*grandchildren.begin()));
}

TEST(WorkerTrouble, AProgramThatIgnoresTheEndsOfItsChildrenIsToldOfAWorkers) {
  const Told told = run_program([] {
    std::signal(SIGCHLD, SIG_IGN);
    Zygote zygote = test_zygote();
    auto executor = make(zygote);
    World world;
    static_cast<void>(executor.submit({{1.0}, Mishap::sleeps, 10000}));
    ::kill(worker_of(zygote), SIGKILL);
    return executor.write_back(world).message;
  });
  EXPECT_EQ(told.text, "a worker of task 'sums' was killed by signal 9 (Killed)");
}

// R7: workers go with the program, and not with the thread that began it.
TEST(WorkerTrouble, WorkersLiveOnWhereTheFirstThreadOfAProgramEnds) {
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  const pid_t program = ::fork();
  if (program == 0) {
    static Zygote zygote = test_zygote();
    static Sums executor = make(zygote);
    std::thread([&ends] {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      World world;
      static_cast<void>(executor.submit({{1.0}}));
      const std::string text = name_of(executor.write_back(world).status);
      const pid_t worker = worker_of(zygote);
      static_cast<void>(!::write(ends[1], &worker, sizeof(worker)));
      static_cast<void>(!::write(ends[1], text.data(), text.size()));
      ::_exit(0);
    }).detach();
    ::syscall(SYS_exit, 0);  // of this thread
  }
  ::close(ends[1]);
  pid_t worker = -1;
  ASSERT_EQ(::read(ends[0], &worker, sizeof(worker)), static_cast<ssize_t>(sizeof(worker)));
  char letters[32] = {};
  EXPECT_GT(::read(ends[0], letters, sizeof(letters) - 1), 0);
  EXPECT_STREQ(letters, "done");
  ::close(ends[0]);
  int status = 0;
  ::waitpid(program, &status, 0);
  EXPECT_TRUE(goes(worker));
}

// R1, R6: the jobs since the last checkpoint are done again before the next one, and nobody waits for that at its
// submit.
TEST(WorkerTrouble, ASubmitAfterALossReturnsAtOnce) {
  Zygote zygote = test_zygote();
  ExecutorOptions options;
  options.checkpoint_every = 100;
  auto executor = make(zygote, options), calm = make(zygote, options);
  World world, expected;
  for (int job = 0; job < 5; ++job) {
    ASSERT_TRUE(executor.submit({{0.3, 1.0 * job}, Mishap::sleeps, 200}));
    ASSERT_EQ(executor.write_back(world).status, JobStatus::done);
    ASSERT_TRUE(calm.submit({{0.3, 1.0 * job}}));
    ASSERT_EQ(calm.write_back(expected).status, JobStatus::done);
  }
  ::kill(world.worker, SIGKILL);
  EXPECT_TRUE(goes(world.worker));
  const auto begin = Clock::now();
  ASSERT_TRUE(executor.submit({{0.7}}));
  EXPECT_LT(seconds_since(begin), 0.5);
  const JobReport report = executor.write_back(world);
  EXPECT_EQ(report.status, JobStatus::done) << report;
  EXPECT_TRUE(report.restarted);
  EXPECT_GT(seconds_since(begin), 0.9) << "five jobs of 0.2 s came first";
  ASSERT_TRUE(calm.submit({{0.7}}));
  ASSERT_EQ(calm.write_back(expected).status, JobStatus::done);
  EXPECT_TRUE(world.values == expected.values);
  EXPECT_EQ(world.jobs, 6);
}

// R6: with limits, and inputs that would not all fit into a socket: what was done before has its time again.
TEST(WorkerTrouble, ALimitIsOfEachJobThatIsDoneAgain) {
  Zygote zygote = test_zygote();
  ExecutorOptions options;
  options.checkpoint_every = 100;
  options.time_limit = Duration::from_seconds(0.3);
  auto executor = make(zygote, options);
  World world;
  for (int job = 0; job < 20; ++job) {
    ASSERT_TRUE(executor.submit({std::vector<double>(3900, 1.0 * job), Mishap::sleeps, 50}));
    ASSERT_EQ(executor.write_back(world).status, JobStatus::done);
  }
  const double before = world.values[0];
  ::kill(world.worker, SIGKILL);
  EXPECT_TRUE(goes(world.worker));
  const auto begin = Clock::now();
  ASSERT_TRUE(executor.submit({{0.0}}));
  EXPECT_LT(seconds_since(begin), 0.5) << "20 jobs of 0.05 s come first";
  const JobReport report = executor.write_back(world);
  EXPECT_EQ(report.status, JobStatus::done) << report;
  EXPECT_EQ(world.jobs, 21);
  EXPECT_GT(world.values[0], before * 0.9) << "the context is the one that was";
}

struct FailsAgain : TravellingSums {
  static constexpr const char* kName = "fails_again";
  static inline const pid_t* first = nullptr;  // the worker in which it succeeds, in memory that all see
  static Result<Output> optimize(TravellingContext& context, const Input& in) {
    if (context.jobs == 1 && *first != ::getpid()) return Error{ErrorCode::bad_input, "not here"};
    return TravellingSums::optimize(context, in);
  }
};

// R6: a job that cannot be done again leaves no context that anybody could go on with.
TEST(WorkerTrouble, AContextThatCannotBeComeToAgainIsSaid) {
  auto* pid =
      static_cast<pid_t*>(::mmap(nullptr, sizeof(pid_t), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0));
  FailsAgain::first = pid;
  Zygote zygote = Zygote::start({&kTaskOps<FailsAgain>}).value();
  ExecutorOptions options;
  options.zygote = &zygote;
  options.checkpoint_every = 100;
  auto executor = std::move(Executor<FailsAgain>::start(ExecutorKind::process, {1.0, false}, options).value());
  *pid = worker_of(zygote);
  World world;
  for (int job = 0; job < 3; ++job) {
    ASSERT_TRUE(executor.submit({{1.0}}));
    ASSERT_EQ(executor.write_back(world).status, JobStatus::done);
  }
  ::kill(world.worker, SIGKILL);
  EXPECT_TRUE(goes(world.worker));
  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(executor.submit({{1.0}}));
    const JobReport report = executor.write_back(world);
    EXPECT_EQ(report.status, JobStatus::failed);
    EXPECT_NE(report.message.find("failed when it was done again: not here"), std::string::npos) << report;
    EXPECT_TRUE(report.worker_lost);
  }
  EXPECT_EQ(world.written, 3);
  ::munmap(pid, sizeof(pid_t));
}

// R8: with retries left, neither a look at the result nor an end waits for a job that is begun again.
TEST(WorkerTrouble, ALookAtTheResultBeginsALostJobAgainAndDoesNotWait) {
  Zygote zygote = test_zygote();
  ExecutorOptions options;
  options.retries = 1;
  auto executor = make(zygote, options);
  ASSERT_TRUE(executor.submit({{1.0}, Mishap::sleeps, 1000}));
  ::kill(worker_of(zygote), SIGKILL);
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  const auto begin = Clock::now();
  EXPECT_EQ(executor.result(), nullptr);
  EXPECT_LT(seconds_since(begin), 0.5);
  EXPECT_TRUE(executor.is_running());
  World world;
  const JobReport report = executor.write_back(world);
  EXPECT_EQ(report.status, JobStatus::done);
  EXPECT_TRUE(report.restarted);
}

// A stopped zygote reads nothing, and its socket holds some 280 packets.
TEST(WorkerTrouble, AStoppedZygoteHoldsNobodyUpHoweverOftenItIsTold) {
  Zygote zygote = test_zygote();
  ::kill(zygote.pid(), SIGSTOP);
  const auto begin = Clock::now();
  for (int i = 0; i < 320; ++i) zygote.drop(1 << 30);
  EXPECT_LT(seconds_since(begin), 30.0);
  ::kill(zygote.pid(), SIGCONT);
}

// One that does not read what it is told does not hold up who tells it.
TEST(WorkerTrouble, AStoppedWorkerIsNotToldOfEachJobThatIsExpected) {
  Zygote zygote = test_zygote();
  auto executor = make(zygote);
  ::kill(worker_of(zygote), SIGSTOP);
  for (int i = 0; i < 100000; ++i) executor.expect();
  ::kill(worker_of(zygote), SIGCONT);
  World world;
  ASSERT_TRUE(executor.submit({{1.0}}));
  EXPECT_EQ(executor.write_back(world).status, JobStatus::done);
}

}  // namespace
}  // namespace oriel
