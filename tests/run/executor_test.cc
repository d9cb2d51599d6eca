// The same task in place, in a thread and in a child process. What is about processes alone: worker_process_test.cc.
#include "oriel/run/executor.h"

#include <gtest/gtest.h>

#include <random>

#include "run/executor_tasks.h"

namespace oriel {
namespace {

using namespace testing_run;
using std::chrono::steady_clock;

constexpr ExecutorKind kAll[] = {ExecutorKind::in_place, ExecutorKind::thread, ExecutorKind::process};

class ExecutorTest : public ::testing::Test {
 protected:
  template <class T = TravellingSums>
  Executor<T> make(ExecutorKind kind, ExecutorOptions options = {}, typename T::Config config = {2.0, false}) {
    options.zygote = &zygote_;
    auto made = Executor<T>::start(kind, config, options);
    EXPECT_TRUE(made) << made.error();
    return std::move(*made);
  }
  static TravellingSums::Input input(std::vector<double> values, Mishap mishap = Mishap::none, int ms = 0) {
    return {std::move(values), mishap, ms};
  }
  Zygote zygote_ = test_zygote();
};

// R1
TEST_F(ExecutorTest, GivesTheSameBitsInPlaceInAThreadAndInAProcess) {
  std::vector<std::vector<double>> results;
  for (const ExecutorKind kind : kAll) {
    auto executor = make(kind);
    std::mt19937 random(4);
    World world;
    std::vector<double> all;
    for (int job = 0; job < 50; ++job) {
      world.values.resize(1 + random() % 5000);  // small ones and some that need shared memory
      for (double& v : world.values) v = std::uniform_real_distribution<double>(-1.0, 1.0)(random);
      ASSERT_TRUE(executor.submit(TravellingSums().collect(world)));
      ASSERT_EQ(executor.write_back(world).status, JobStatus::done);
      EXPECT_EQ(world.jobs, job + 1);
      all.insert(all.end(), world.values.begin(), world.values.end());
    }
    results.push_back(std::move(all));
  }
  EXPECT_TRUE(results[0] == results[1]);
  EXPECT_TRUE(results[0] == results[2]);
}

// R1
TEST_F(ExecutorTest, SubmitReturnsWhenDoneInPlaceAndAtOnceElsewhere) {
  for (const ExecutorKind kind : kAll) {
    auto executor = make(kind);
    const auto begin = steady_clock::now();
    ASSERT_TRUE(executor.submit(input({1.0}, Mishap::sleeps, 1500)));
    const double took = std::chrono::duration<double>(steady_clock::now() - begin).count();
    if (kind == ExecutorKind::in_place)
      EXPECT_GE(took, 0.5);
    else
      EXPECT_LT(took, 0.49) << name_of(kind);
    World world;
    EXPECT_EQ(executor.write_back(world).status, JobStatus::done);
  }
}

// R2
TEST_F(ExecutorTest, WritesAResultBackOnceAndDoesNothingWithoutAJob) {
  for (const ExecutorKind kind : kAll) {
    auto executor = make(kind);
    World world;
    EXPECT_EQ(executor.write_back(world).status, JobStatus::none);
    EXPECT_EQ(world.written, 0);
    ASSERT_TRUE(executor.submit(input({1.0, 2.0}, Mishap::sleeps, 20)));
    EXPECT_EQ(executor.write_back(world).status, JobStatus::done);
    EXPECT_EQ(world.written, 1);
    EXPECT_EQ(executor.write_back(world).status, JobStatus::none);
    EXPECT_EQ(world.written, 1) << name_of(kind);
  }
}

// R3
TEST_F(ExecutorTest, RefusesASecondJobAsBusyUntilTheFirstIsWrittenBack) {
  for (const ExecutorKind kind : kAll) {
    auto executor = make(kind);
    World world;
    const JobReport first = executor.submit(input({1.0}, Mishap::sleeps, 20));
    const JobReport second = executor.submit(input({5.0}));
    EXPECT_EQ(second.status, JobStatus::busy) << name_of(kind);
    EXPECT_FALSE(second);
    const JobReport done = executor.write_back(world);
    EXPECT_EQ(done.job, first.job);
    EXPECT_EQ(world.jobs, 1);
    const JobReport third = executor.submit(input({5.0}));
    EXPECT_GT(third.job, first.job);
    EXPECT_EQ(executor.write_back(world).job, third.job);
    EXPECT_EQ(world.jobs, 2);
  }
}

// R3
TEST_F(ExecutorTest, MergesWhatWaitsWhereItMayCoalesce) {
  for (const ExecutorKind kind : kAll) {
    ExecutorOptions options;
    options.coalesce = true;
    auto executor = make(kind, options);
    World world;
    const JobId first = executor.submit(input({1.0}, Mishap::sleeps, 20)).job;
    const JobReport second = executor.submit(input({2.0})), third = executor.submit(input({3.0, 4.0}));
    EXPECT_EQ(second.status, JobStatus::waiting);
    EXPECT_EQ(third.status, JobStatus::waiting);
    EXPECT_EQ(executor.write_back(world).job, first);
    EXPECT_EQ(world.values.size(), 1u);
    EXPECT_EQ(executor.write_back(world).job, third.job) << name_of(kind);
    EXPECT_EQ(world.values.size(), 3u);  // both inputs
    EXPECT_EQ(world.jobs, 2);            // in one job
    EXPECT_EQ(executor.write_back(world).status, JobStatus::none);
  }
}

// R4
TEST_F(ExecutorTest, SharesNoMemoryWithTheCaller) {
  for (const ExecutorKind kind : kAll) {
    auto executor = make(kind);
    auto in = input(std::vector<double>(100000, 1.0), Mishap::sleeps, 30);
    ASSERT_TRUE(executor.submit(in));
    for (double& v : in.values) v = 1e9;
    World world;
    ASSERT_EQ(executor.write_back(world).status, JobStatus::done);
    EXPECT_EQ(world.values.front(), world.values.back());
    EXPECT_LT(world.values.front(), 2.1e5);
  }
}

// R4
TEST_F(ExecutorTest, KeepsTheContextWhereTheWorkRunsAlsoOneThatCanNeitherBeCopiedNorTravel) {
  for (const ExecutorKind kind : kAll) {
    auto executor = make<UniqueSums>(kind);
    World world;
    for (int job = 1; job <= 5; ++job) {
      ASSERT_TRUE(executor.submit({{1.0}}));
      ASSERT_EQ(executor.write_back(world).status, JobStatus::done);
      EXPECT_EQ(world.jobs, job);
    }
    EXPECT_EQ(world.worker != ::getpid(), kind == ExecutorKind::process);
  }
}

// R5
TEST_F(ExecutorTest, BringsTheTextOfAnErrorAndPutsACopyableContextBack) {
  for (const ExecutorKind kind : kAll) {
    auto executor = make<StayingSums>(kind);
    World world;
    ASSERT_TRUE(executor.submit({{1.0}}));
    ASSERT_EQ(executor.write_back(world).status, JobStatus::done);
    ASSERT_TRUE(executor.submit({{1.0}, Mishap::throws}));
    const JobReport failed = executor.write_back(world);
    EXPECT_EQ(failed.status, JobStatus::failed);
    EXPECT_NE(failed.message.find("the lens is dirty"), std::string::npos) << failed;
    EXPECT_EQ(world.written, 1);
    ASSERT_TRUE(executor.submit({{1.0}}));
    ASSERT_EQ(executor.write_back(world).status, JobStatus::done);
    EXPECT_EQ(world.jobs, 2) << name_of(kind);  // the one that failed left no trace
  }
}

// R5: also of one that travels and cannot be copied; and a task's own error is its text.
TEST_F(ExecutorTest, PutsAContextBackThatTravels) {
  for (const ExecutorKind kind : kAll) {
    auto executor = make<MovingSums>(kind);
    World world;
    for (const Mishap mishap : {Mishap::none, Mishap::fails, Mishap::throws, Mishap::none}) {
      ASSERT_TRUE(executor.submit({{1.0}, mishap}));
      const JobReport report = executor.write_back(world);
      EXPECT_EQ(report.status, mishap == Mishap::none ? JobStatus::done : JobStatus::failed) << report;
      EXPECT_TRUE(mishap != Mishap::fails || report.message == "the lens is missing") << report;
    }
    EXPECT_EQ(world.jobs, 2) << name_of(kind);
  }
}

// R5: what is thrown where nobody would look for it, in a copy of the context, is an error as any other.
TEST_F(ExecutorTest, AnswersACopyThatThrowsWithItsText) {
  for (const ExecutorKind kind : kAll) {
    auto executor = make<BrittleSums>(kind);
    World world;
    for (int job = 1; job <= 2; ++job) {
      ASSERT_TRUE(executor.submit({{1.0}}));
      ASSERT_EQ(executor.write_back(world).status, JobStatus::done);
    }
    ASSERT_TRUE(executor.submit({{1.0}}));
    const JobReport report = executor.write_back(world);
    EXPECT_EQ(report.status, JobStatus::failed) << name_of(kind);
    EXPECT_EQ(report.message, "the task: one copy too many");
    EXPECT_EQ(world.written, 2);
  }
}

struct Unwritable : TravellingSums {
  static void write(const Output& out, World& world) {
    TravellingSums::write(out, world);
    throw std::runtime_error("the map is full");
  }
};

// R2: applied once, whatever comes of it.
TEST_F(ExecutorTest, WritesOnceAlsoWhereThatThrows) {
  auto executor = std::move(Executor<Unwritable>::start(ExecutorKind::thread, {1.0, false}).value());
  World world;
  ASSERT_TRUE(executor.submit({{1.0}}));
  EXPECT_THROW(executor.write_back(world), std::runtime_error);
  EXPECT_EQ(executor.write_back(world).status, JobStatus::none);
  EXPECT_EQ(world.written, 1);
  EXPECT_TRUE(executor.submit({{1.0}}));
}

// R3, R7: what waits for its turn is not forgotten without a word.
TEST_F(ExecutorTest, SaysThatWhatWaitedWasTerminated) {
  for (const ExecutorKind kind : {ExecutorKind::thread, ExecutorKind::process}) {
    ExecutorOptions options;
    options.coalesce = true;
    auto executor = make(kind, options);
    World world;
    ASSERT_TRUE(executor.submit(input({1.0}, Mishap::sleeps, 50)));
    const JobReport waits = executor.submit(input({2.0}));
    ASSERT_EQ(waits.status, JobStatus::waiting);
    executor.terminate();
    EXPECT_EQ(executor.write_back(world).status, JobStatus::terminated);
    const JobReport report = executor.write_back(world);
    EXPECT_EQ(report.status, JobStatus::terminated);
    EXPECT_EQ(report.job, waits.job);
    EXPECT_EQ(executor.write_back(world).status, JobStatus::none);
    EXPECT_EQ(world.written, 0);
  }
}

// R6: what arrived in time is not lost because nobody looked in time.
TEST_F(ExecutorTest, DeliversWhatArrivedInTimeToWhoeverLooksLate) {
  for (const ExecutorKind kind : {ExecutorKind::thread, ExecutorKind::process}) {
    ExecutorOptions options;
    options.time_limit = Duration::from_seconds(0.3);
    auto executor = make(kind, options);
    World world;
    ASSERT_TRUE(executor.submit(input({1.0})));
    std::this_thread::sleep_for(std::chrono::milliseconds(400));
    EXPECT_FALSE(executor.is_running());
    EXPECT_EQ(executor.write_back(world).status, JobStatus::done) << name_of(kind);
  }
}

// A worker that was told that a job comes, and a caller that looks instead of sleeping, change nothing but the time.
TEST_F(ExecutorTest, ComesToTheSameWhereJobsAreExpectedAndWaitsLook) {
  for (const ExecutorKind kind : kAll) {
    ExecutorOptions options;
    options.spin = Duration::from_seconds(0.005);
    options.time_limit = Duration::from_seconds(5.0);
    auto executor = make(kind, options), plain = make(kind);
    World world, expected;
    for (int job = 0; job < 6; ++job) {
      for (int n = 0; n <= job % 3; ++n) executor.expect();
      if (job == 4) std::this_thread::sleep_for(std::chrono::milliseconds(5));  // longer than it stays awake
      ASSERT_TRUE(executor.submit(input({1.0, 1.0 * job}, Mishap::sleeps, job % 2 * 10)));
      executor.expect();  // while it runs: nothing
      ASSERT_TRUE(plain.submit(input({1.0, 1.0 * job})));
      ASSERT_EQ(executor.write_back(world).status, JobStatus::done);
      ASSERT_EQ(plain.write_back(expected).status, JobStatus::done);
      EXPECT_TRUE(world.values == expected.values) << name_of(kind);
    }
    executor.terminate();
    executor.expect();
  }
  ExecutorOptions options;
  options.spin = Duration{-1};
  EXPECT_FALSE(Executor<TravellingSums>::start(ExecutorKind::thread, {}, options));
}

// R5
TEST_F(ExecutorTest, RefusesToStartWhereTheContextCannotBeMade) {
  for (const ExecutorKind kind : kAll) {
    ExecutorOptions options;
    options.zygote = &zygote_;
    const auto made = Executor<TravellingSums>::start(kind, {1.0, true}, options);
    ASSERT_FALSE(made);
    EXPECT_NE(made.error().message.find("expected a config that does not refuse"), std::string::npos) << made.error();
  }
}

// R7
TEST_F(ExecutorTest, TerminatesWhileBusyAndTwiceAndRefusesJobsAfterwards) {
  for (const ExecutorKind kind : kAll) {
    auto executor = make(kind);
    World world;
    ASSERT_TRUE(executor.submit(input({1.0}, Mishap::sleeps, 50)));
    executor.terminate();
    executor.terminate();
    EXPECT_FALSE(executor.is_running());
    const JobReport r = executor.write_back(world);  // in place it had been done
    EXPECT_EQ(r.status, kind == ExecutorKind::in_place ? JobStatus::done : JobStatus::terminated) << name_of(kind);
    EXPECT_EQ(world.written, kind == ExecutorKind::in_place ? 1 : 0);
    EXPECT_EQ(executor.submit(input({1.0})).status, JobStatus::terminated);
    EXPECT_EQ(executor.write_back(world).status, JobStatus::none);
  }
}

// R7, R6: what had arrived before is still delivered
TEST_F(ExecutorTest, DeliversAfterTerminationWhatHadArrivedBefore) {
  for (const ExecutorKind kind : kAll) {
    auto executor = make(kind);
    World world;
    ASSERT_TRUE(executor.submit(input({1.0})));
    while (executor.is_running()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    executor.terminate();
    EXPECT_EQ(executor.write_back(world).status, JobStatus::done) << name_of(kind);
    EXPECT_EQ(world.written, 1);
  }
}

// R8
TEST_F(ExecutorTest, SaysThatItRunsUntilTheResultIsThereAndNeverWaits) {
  for (const ExecutorKind kind : kAll) {
    auto executor = make(kind);
    EXPECT_FALSE(executor.is_running());
    EXPECT_EQ(executor.result(), nullptr);
    const auto begin = steady_clock::now();
    ASSERT_TRUE(executor.submit(input({3.0}, Mishap::sleeps, 500)));
    if (kind != ExecutorKind::in_place) {
      EXPECT_TRUE(executor.is_running());
      EXPECT_EQ(executor.result(), nullptr);
      EXPECT_LT(steady_clock::now() - begin, std::chrono::milliseconds(490)) << name_of(kind);
    }
    while (executor.is_running()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    ASSERT_NE(executor.result(), nullptr);
    EXPECT_EQ(executor.result()->jobs, 1);
    World world;
    EXPECT_EQ(executor.write_back(world).status, JobStatus::done);
    EXPECT_EQ(executor.result(), nullptr);
  }
}

TEST_F(ExecutorTest, GivesUpAJobThatTakesTooLongAndGoesOn) {
  for (const ExecutorKind kind : {ExecutorKind::thread, ExecutorKind::process}) {
    ExecutorOptions options;
    options.time_limit = Duration::from_seconds(0.2);
    auto executor = make(kind, options);
    World world;
    const auto begin = steady_clock::now();
    ASSERT_TRUE(executor.submit(input({1.0}, Mishap::sleeps, 500)));
    const JobReport late = executor.write_back(world);
    EXPECT_EQ(late.status, JobStatus::timed_out) << late;
    EXPECT_LT(steady_clock::now() - begin, std::chrono::milliseconds(1300)) << name_of(kind);
    EXPECT_EQ(world.written, 0);
    JobReport next = executor.submit(input({1.0}));
    while (next.status == JobStatus::busy) {  // a thread cannot be ended
      EXPECT_EQ(kind, ExecutorKind::thread);
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      next = executor.submit(input({1.0}));
    }
    EXPECT_EQ(executor.write_back(world).job, next.job);
    EXPECT_EQ(world.written, 1);  // and not the result of the one that was given up
    EXPECT_EQ(world.jobs, kind == ExecutorKind::thread ? 2 : 1);
  }
}

TEST_F(ExecutorTest, IsChosenByAWord) {
  EXPECT_EQ(*executor_kind("inline"), ExecutorKind::in_place);
  EXPECT_EQ(*executor_kind("thread"), ExecutorKind::thread);
  EXPECT_EQ(*executor_kind("process"), ExecutorKind::process);
  const auto unknown = executor_kind("gpu");
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().message, "unknown executor 'gpu'; expected one of inline, thread, process");
}

}  // namespace
}  // namespace oriel
