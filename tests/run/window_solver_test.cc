// A window whose solves go on beside its caller: begun by one update, merged by the next. The same bits wherever they
// run, and through workers that are killed; and a front end that never waits for one. docs/executors.md shows lines of
// this file.
#include "oriel/run/window_solver.h"

#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <iostream>
#include <random>
#include <thread>

#include "oriel/graph/fingerprint.h"
#include "oriel/run/snapshot.h"
#include "run/worker_of.h"
#include "window/fixed_flight.h"

namespace oriel {
namespace {

// Of which eight states stay.
FixedFlight eight_states(const SimulatedFlight& flight) {
  WindowOptions options;
  options.solve.max_iterations = 5;
  return {flight, 8, options};
}

bool long_run() { return std::getenv("ORIEL_KILLS") != nullptr; }

class WindowSolverTest : public ::testing::Test {
 protected:
  WindowSolverTest() : flight_({.rest_s = 0.3, .duration_s = long_run() ? 120.0 : 8.0, .points = 0}) {}
  int fixes() const { return long_run() ? 595 : 38; }

  struct Flown {
    std::vector<std::uint64_t> fingerprints;
    std::vector<Pose3d> newest;
    int killed = 0, marginalized = 0;
  };
  // `kill`: before or while so many of a hundred solves run, their worker is killed.
  Flown fly(ExecutorKind kind, int kill = 0) {
    FixedFlight f = eight_states(flight_);
    ExecutorOptions options;
    options.zygote = &zygote_;
    auto solver = WindowSolver::make(f.window.core().followed(), kind, options, 8);
    EXPECT_TRUE(solver) << solver.error();
    EXPECT_TRUE(f.window.core().defer_to(std::move(*solver)));
    Flown out;
    std::mt19937 random(7);
    auto note = [&](const WindowUpdate& u) {
      EXPECT_TRUE(u.status == WindowUpdate::Status::updated || u.status == WindowUpdate::Status::begun)
          << u.solve << u.error;
      out.marginalized += u.states_marginalized;
      out.fingerprints.push_back(fingerprint(f.window.graph()));
    };
    for (int k = 0; k < fixes(); ++k) {
      note(f.fix(flight_, k));
      if (static_cast<int>(random() % 100) >= kill) continue;
      std::this_thread::sleep_for(std::chrono::microseconds(random() % 300));
      if (const pid_t pid = worker_of(zygote_); pid > 0 && ::kill(pid, SIGKILL) == 0) ++out.killed;
    }
    note(f.window.settle());
    for (const State& s : f.window.states().timeline(f.body))
      out.newest.push_back(f.window.graph().value(VariableId<Pose3d>{s.variables[0].key}));
    return out;
  }

  Zygote zygote_ = Zygote::start({&WindowSolver::kTask}).value();
  SimulatedFlight flight_;
};

// R1, R4
TEST_F(WindowSolverTest, FliesTheSameWayInAllExecutors) {
  const Flown in_place = fly(ExecutorKind::in_place);
  EXPECT_GT(in_place.marginalized, fixes() - 12);
  EXPECT_TRUE(fly(ExecutorKind::thread).fingerprints == in_place.fingerprints);
  EXPECT_TRUE(fly(ExecutorKind::process).fingerprints == in_place.fingerprints);
}

// R6
TEST_F(WindowSolverTest, FliesTheSameWayWhileItsWorkersAreKilled) {
  const Flown in_place = fly(ExecutorKind::in_place);
  const Flown stormy = fly(ExecutorKind::process, 50);
  EXPECT_GT(stormy.killed, 5);
  EXPECT_TRUE(stormy.fingerprints == in_place.fingerprints);
  if (long_run()) std::cout << stormy.killed << " workers killed in " << fixes() << " updates\n";
}

// A state is solved one update later, and leaves one update later; where it ends is the same but for where priors were
// linearized: a tenth of what a fix is uncertain by is a generous bound.
TEST_F(WindowSolverTest, EndsWhereAWindowThatWaitsEnds) {
  FixedFlight waits = eight_states(flight_);
  for (int k = 0; k < fixes(); ++k) ASSERT_EQ(waits.fix(flight_, k).status, WindowUpdate::Status::updated);
  const Flown beside = fly(ExecutorKind::thread);
  const auto& timeline = waits.window.states().timeline(waits.body);
  ASSERT_EQ(beside.newest.size(), timeline.size());
  for (std::size_t i = 0; i < timeline.size(); ++i) {
    const Pose3d& pose = waits.window.graph().value(VariableId<Pose3d>{timeline[i].variables[0].key});
    EXPECT_LT(beside.newest[i].minus(pose).norm(), 2e-3);
  }
}

// What it is told, and when.
class Script final : public DeferredSolver {
 public:
  struct Log {
    int begun = 0, finished = 0;
    bool refuses = false, fails = false;
  };
  explicit Script(Log& log) : log_(&log) {}
  std::string_view name() const override { return "script"; }
  Result<void> begin(const SolveOptions&) noexcept override {
    EXPECT_EQ(log_->begun, log_->finished) << "one is under way";
    if (log_->refuses) return Error{ErrorCode::io, "no worker"};
    ++log_->begun;
    return {};
  }
  bool is_running() noexcept override { return true; }
  Summary finish() noexcept override {
    ++log_->finished;
    return log_->fails ? refused({}, Error{ErrorCode::io, "lost"}) : Summary{};
  }

 private:
  Log* log_;
};

TEST_F(WindowSolverTest, BeginsAtTheEndOfAnUpdateAndMergesAtTheBeginningOfTheNext) {
  using Status = WindowUpdate::Status;
  FixedFlight f = eight_states(flight_);
  Script::Log log;
  ASSERT_TRUE(f.window.core().defer_to(std::make_unique<Script>(log)));
  EXPECT_EQ(f.fix(flight_, 0).status, Status::begun);
  EXPECT_EQ(log.begun, 1);
  EXPECT_EQ(log.finished, 0);
  EXPECT_FALSE(f.window.core().defer_to(nullptr)) << "one is under way";
  EXPECT_EQ(f.fix(flight_, 1).status, Status::updated);
  EXPECT_EQ(log.finished, 1);
  EXPECT_EQ(log.begun, 2);
  EXPECT_TRUE(f.window.states().timeline(f.body)[0].solved);
  EXPECT_FALSE(f.window.states().timeline(f.body)[1].solved) << "it came after the solve had begun";
  EXPECT_EQ(f.window.update().status, Status::updated);  // nothing came: it merges, and begins none
  EXPECT_EQ(log.begun, 2);
  EXPECT_EQ(f.window.update().status, Status::nothing_new);
  EXPECT_EQ(f.window.settle().status, Status::nothing_new);
  log.fails = true;
  f.fix(flight_, 2);
  const auto before = fingerprint(f.window.graph());
  EXPECT_EQ(f.window.settle().status, Status::solve_failed);
  EXPECT_EQ(f.window.last_update().solve.refusal.empty(), false);
  EXPECT_EQ(fingerprint(f.window.graph()), before);
  log.fails = false, log.refuses = true;
  EXPECT_EQ(f.fix(flight_, 3).status, Status::solve_failed);
  EXPECT_NE(f.window.last_update().error.message.find("no worker"), std::string::npos);
  log.refuses = false;
  EXPECT_EQ(f.window.update().status, Status::begun) << "what could not be begun is tried again";
  EXPECT_EQ(f.window.settle().status, Status::updated);
  f.fix(flight_, 4);
  EXPECT_EQ(f.window.settle().status, Status::updated);
}

TEST_F(WindowSolverTest, SettlesBeforeAStateIsBegunByHand) {
  FixedFlight f = eight_states(flight_);
  Script::Log log;
  ASSERT_TRUE(f.window.core().defer_to(std::make_unique<Script>(log)));
  f.fix(flight_, 0);
  ASSERT_TRUE(f.window.begin(f.body, SimulatedFlight::time_of(0.1)));
  EXPECT_EQ(log.finished, 1);
  f.window.update();
  EXPECT_FALSE(f.window.states().timeline(f.body).latest()->solved);
  f.window.settle();
  EXPECT_TRUE(f.window.states().timeline(f.body).latest()->solved);
}

TEST(Snapshots, ShowReadersOneWholeValueThatStaysWhileTheyLook) {
  Snapshots<std::vector<std::uint64_t>> board(4);
  EXPECT_FALSE(board.read());
  std::atomic<bool> done{false}, torn{false};
  std::atomic<std::int64_t> reads{0};
  std::vector<std::thread> readers;
  for (int i = 0; i < 3; ++i)
    readers.emplace_back([&] {
      std::uint64_t last = 0;
      while (!done) {
        const auto now = board.read();
        if (!now) continue;
        const std::uint64_t first = now->front();
        for (const std::uint64_t x : *now) torn = torn || x != first;
        torn = torn || first != now.number() || first < last;
        last = first;
        ++reads;
      }
    });
  std::uint64_t published = 0;
  for (int i = 0; i < 20000 || reads < 1000; ++i)
    published += board.publish([&](std::vector<std::uint64_t>& v) { v.assign(64, published + 1); });
  done = true;
  for (std::thread& t : readers) t.join();
  EXPECT_FALSE(torn);
  EXPECT_GT(published, 1000u);
  EXPECT_EQ(board.read()->front(), published);
}

TEST(Snapshots, AreNotOverwrittenWhileTheyAreHeld) {
  Snapshots<int> board(2);
  ASSERT_TRUE(board.publish([](int& x) { x = 1; }));
  const auto one = board.read();
  ASSERT_TRUE(board.publish([](int& x) { x = 2; }));
  EXPECT_FALSE(board.publish([](int& x) { x = 3; })) << "one slot is held, the other the newest";
  EXPECT_EQ(*one, 1);
  EXPECT_EQ(*board.read(), 2);
}

TEST_F(WindowSolverTest, PublishesItsPosesForOtherThreads) {
  FixedFlight f = eight_states(flight_);
  WindowPosesBoard board(f.body);
  f.window.listen(&board);
  for (int k = 0; k < 3; ++k) f.fix(flight_, k);
  const auto now = board.board().read();
  ASSERT_TRUE(now);
  EXPECT_EQ(now.number(), 3u);
  ASSERT_EQ(now->poses.size(), 3u);
  EXPECT_EQ(now->version, f.window.graph().version());
  EXPECT_EQ(now->poses[2].time, SimulatedFlight::time_of(0.4));
  EXPECT_TRUE(now->poses[2].solved);
}

}  // namespace
}  // namespace oriel
