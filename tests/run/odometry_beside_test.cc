// Visual-inertial odometry whose solves go on beside its caller: predicted at once, solved by the next update. What is
// solved has the bits of the odometry that waits, wherever it is solved, and through workers that are killed.
#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <iostream>
#include <random>

#include "oriel/graph/fingerprint.h"
#include "oriel/run/window_solver.h"
#include "oriel/window/inertial_odometry.h"
#include "run/same_bits.h"
#include "run/worker_of.h"
#include "window/simulated_flight.h"

namespace oriel {
namespace {

using Status = UpdateReport::Status;

// What it is told, and when; solves where it is finished, so that all memory that is asked for is the odometry's.
class Script final : public DeferredSolver {
 public:
  struct Log {
    int begun = 0, finished = 0;
    bool refuses = false, fails = false;
  };
  Script(Graph& graph, Log& log) : engine_(graph), log_(&log) {}
  std::string_view name() const override { return "script"; }
  Result<void> begin(const SolveOptions& options) noexcept override {
    EXPECT_EQ(log_->begun, log_->finished) << "one is under way";
    if (log_->refuses) return Error{ErrorCode::io, "no worker"};
    options_ = options;
    ++log_->begun;
    return {};
  }
  bool is_running() noexcept override { return true; }
  Summary finish() noexcept override {
    ++log_->finished;
    return log_->fails ? refused(options_, Error{ErrorCode::io, "lost"}) : engine_.solve(options_);
  }

 private:
  NativeEngine engine_;
  SolveOptions options_;
  Log* log_;
};

// A flight frame by frame, its samples up to each frame before it.
class Flyer {
 public:
  explicit Flyer(const SimulatedFlight& flight, const OdometryOptions& options = {})
      : odometry(flight.rig, true, flight.noise, options), flight_(flight) {}
  UpdateReport frame(std::size_t k) {
    feed_to(flight_.frames[k].time);
    return odometry.update({flight_.frames[k].time, flight_.frames[k].features});
  }
  void feed_to(Time time) {
    for (; next_ < flight_.imu.size() && flight_.imu[next_].time <= time; ++next_)
      EXPECT_TRUE(odometry.add_imu(flight_.imu[next_]));
  }
  void defer(Script::Log& log) {
    WindowCore& window = odometry.window();
    ASSERT_TRUE(window.defer_to(std::make_unique<Script>(window.followed(), log)));
  }
  void defer(ExecutorKind kind, Zygote& zygote) {
    ExecutorOptions options;
    options.zygote = &zygote;
    auto solver = WindowSolver::make(odometry.window().followed(), kind, options, 8);
    ASSERT_TRUE(solver) << solver.error();
    ASSERT_TRUE(odometry.window().defer_to(std::move(*solver)));
  }

  InertialOdometry odometry;

 private:
  const SimulatedFlight& flight_;
  std::size_t next_ = 0;
};

bool long_run() { return std::getenv("ORIEL_KILLS") != nullptr; }

void cut_imu(SimulatedFlight& flight, double from_s, double to_s) {
  const Time a = SimulatedFlight::time_of(from_s), b = SimulatedFlight::time_of(to_s);
  std::erase_if(flight.imu, [&](const ImuSample& s) { return s.time > a && s.time < b; });
}

class OdometryBeside : public ::testing::Test {
 protected:
  OdometryBeside() : flight_({.rest_s = 1.5, .duration_s = long_run() ? 60.0 : 6.0}) {}

  struct Flown {
    std::vector<std::uint64_t> fingerprints;  // after each update, with what is predicted
    Trajectory causal, final;
    int killed = 0;
  };
  // `kill`: before or while so many of a hundred solves run, their worker is killed.
  Flown fly(ExecutorKind kind, int kill = 0) {
    Flyer f(flight_);
    f.defer(kind, zygote_);
    Flown out;
    std::mt19937 random(7);
    for (std::size_t k = 0; k < flight_.frames.size(); ++k) {
      f.frame(k);
      out.fingerprints.push_back(fingerprint(f.odometry.window().graph()));
      if (static_cast<int>(random() % 100) >= kill) continue;
      std::this_thread::sleep_for(std::chrono::microseconds(random() % 3000));
      if (const pid_t pid = worker_of(zygote_); pid > 0 && ::kill(pid, SIGKILL) == 0) ++out.killed;
    }
    EXPECT_EQ(f.odometry.settle().status, Status::tracking);
    out.fingerprints.push_back(fingerprint(f.odometry.window().graph()));
    out.causal = f.odometry.causal();
    out.final = f.odometry.final();
    return out;
  }

  Zygote zygote_ = Zygote::start({&WindowSolver::kTask}).value();
  SimulatedFlight flight_;
};

// R1, R4
TEST_F(OdometryBeside, FliesTheSameWayInAllExecutors) {
  const Flown in_place = fly(ExecutorKind::in_place);
  for (const ExecutorKind kind : {ExecutorKind::thread, ExecutorKind::process}) {
    const Flown other = fly(kind);
    EXPECT_TRUE(other.fingerprints == in_place.fingerprints) << name_of(kind);
    EXPECT_TRUE(same_bits(other.causal, in_place.causal)) << name_of(kind);
  }
}

// R6
TEST_F(OdometryBeside, FliesTheSameWayWhileItsWorkersAreKilled) {
  const Flown in_place = fly(ExecutorKind::in_place);
  const Flown stormy = fly(ExecutorKind::process, 50);
  EXPECT_GT(stormy.killed, 5);
  EXPECT_TRUE(stormy.fingerprints == in_place.fingerprints);
  EXPECT_TRUE(same_bits(stormy.causal, in_place.causal));
  if (long_run()) std::cout << stormy.killed << " workers killed in " << flight_.frames.size() << " frames\n";
}

// R1: what is merged is what an odometry that waits says of that frame: from rest, in motion, with outliers, and across
// gaps of the IMU where frames are missed.
TEST_F(OdometryBeside, MergesTheBitsOfAnOdometryThatWaits) {
  std::vector<SimulatedFlight> flights = {flight_, SimulatedFlight({.duration_s = 5.0, .seed = 5}),
                                          SimulatedFlight({.rest_s = 1.5, .duration_s = 6.0, .gross_errors = 0.1}),
                                          SimulatedFlight({.rest_s = 1.5, .duration_s = 6.0})};
  cut_imu(flights[3], 3.02, 3.13);
  cut_imu(flights[3], 4.52, 5.03);
  for (const std::size_t k : {33u, 47u}) flights[3].frames[k].features.clear();
  for (const SimulatedFlight& flight : flights) {
    Flyer waits(flight), beside(flight);
    beside.defer(ExecutorKind::thread, zygote_);
    std::optional<UpdateReport> before;  // of the frame whose solve is under way
    int merged = 0, missed = 0;
    for (std::size_t k = 0; k < flight.frames.size(); ++k) {
      const UpdateReport now = waits.frame(k), ahead = beside.frame(k);
      ASSERT_EQ(ahead.status, now.status) << k;
      ASSERT_EQ(ahead.predicted, now.status == Status::tracking);
      ASSERT_EQ(ahead.solved.has_value(), before.has_value());
      if (before) {
        ++merged;
        EXPECT_EQ(ahead.solved->time, before->time);
        EXPECT_STREQ(ahead.solved->failure, "");
        EXPECT_TRUE(same_bits(ahead.solved->values, before->values)) << k;
        EXPECT_EQ(ahead.solved->keyframe, before->keyframe);
        EXPECT_EQ(ahead.solved->iterations, before->iterations);
      }
      missed += ahead.status == Status::failed ? 1 : 0;
      before = ahead.predicted ? std::optional(now) : std::nullopt;
    }
    EXPECT_GT(merged, 25);
    EXPECT_EQ(missed > 0, &flight == &flights[3]);
    EXPECT_EQ(beside.odometry.settle().status, Status::tracking);
    EXPECT_EQ(fingerprint(beside.odometry.window().graph()), fingerprint(waits.odometry.window().graph()));
    EXPECT_TRUE(same_bits(beside.odometry.final(), waits.odometry.final()));
    EXPECT_EQ(beside.odometry.dropped(), waits.odometry.dropped());
  }
}

// The prediction is of the frame that the update was given, and close to what its solve finds: the IMU's error over a
// tenth of a second from a state that was solved, or what 4 px at some metres are, which is as far as it is not
// refined.
TEST_F(OdometryBeside, SaysOfEachFrameWhereTheImuAndTheKnownPointsPutIt) {
  Flyer f(flight_);
  Script::Log log;
  f.defer(log);
  UpdateReport before;
  int compared = 0, moved = 0;
  for (std::size_t k = 0; k < flight_.frames.size(); ++k) {
    const UpdateReport r = f.frame(k);
    EXPECT_EQ(r.time, flight_.frames[k].time);
    if (r.solved && before.predicted) {
      const Vec6d off = r.solved->values.T_world_body.minus(before.values.T_world_body);
      EXPECT_LT(off.norm(), 0.05) << k;
      moved += off.norm() > 0.0 ? 1 : 0;
      ++compared;
    }
    before = r;
  }
  EXPECT_GT(compared, 30);
  EXPECT_GT(moved, 30) << "it was a prediction";
}

TEST_F(OdometryBeside, BeginsAtTheEndOfAnUpdateAndMergesAtTheBeginningOfTheNext) {
  Flyer f(flight_);
  Script::Log log;
  f.defer(log);
  std::size_t k = 0;
  while (f.frame(k++).status == Status::initialising) ASSERT_LT(k, 30u);
  EXPECT_EQ(log.begun, log.finished) << "a start is waited for";
  const int begun = log.begun;
  EXPECT_TRUE(f.frame(k++).predicted);
  EXPECT_EQ(log.begun, begun + 1);
  EXPECT_EQ(log.finished, begun);
  const auto under_way = fingerprint(f.odometry.window().graph());
  EXPECT_EQ(f.frame(k - 1).status, Status::failed) << "a frame of that time was there";
  EXPECT_EQ(log.finished, begun) << "a frame that is refused merges nothing";
  EXPECT_EQ(fingerprint(f.odometry.window().graph()), under_way);
  EXPECT_FALSE(f.odometry.window().defer_to(nullptr)) << "one is under way";
  const UpdateReport settled = f.odometry.settle();
  EXPECT_EQ(settled.status, Status::tracking);
  EXPECT_FALSE(settled.predicted);
  EXPECT_EQ(settled.time, flight_.frames[k - 1].time);
  EXPECT_TRUE(same_bits(settled.values, f.odometry.values(*f.odometry.timeline().latest())));
  EXPECT_STREQ(f.odometry.settle().reason, "no solve was begun");
  EXPECT_FALSE(f.frame(k++).solved) << "it was merged before";
}

// W15, W17: what fails beside the caller is a failed solve as any other.
TEST_F(OdometryBeside, GoesOnThroughAFailedSolveAndBeginsAnewAfterMany) {
  Flyer f(flight_);
  Script::Log log;
  f.defer(log);
  std::size_t k = 0;
  for (; k < 25; ++k) f.frame(k);
  log.fails = true;
  const UpdateReport once = f.frame(k++);
  ASSERT_TRUE(once.solved);
  EXPECT_STREQ(once.solved->failure, "the solve was refused: its worker is lost, or its engine cannot");
  EXPECT_TRUE(once.predicted) << "the next frame is predicted from the one that was";
  log.fails = false;
  EXPECT_STREQ(f.frame(k++).solved->failure, "");
  log.refuses = true;
  const UpdateReport refused = f.frame(k++);
  EXPECT_EQ(refused.status, Status::failed);
  EXPECT_STREQ(refused.reason, "no solve could be begun");
  EXPECT_STREQ(refused.solved->failure, "");
  EXPECT_EQ(f.frame(k++).status, Status::failed);
  const UpdateReport anew = f.frame(k++);
  EXPECT_EQ(anew.status, Status::initialising);
  EXPECT_STREQ(anew.reset, "so many solves have failed, one after the other");
  log.refuses = false;
  while (f.frame(k++).status == Status::initialising) ASSERT_LT(k, flight_.frames.size());
  log.fails = true;
  for (int n = 0; n < 3; ++n) EXPECT_STREQ(f.frame(k++).reset, "");
  const UpdateReport lost = f.frame(k++);
  EXPECT_STREQ(lost.reset, "so many solves have failed, one after the other");
  EXPECT_TRUE(lost.solved->begins_anew);
  EXPECT_EQ(log.begun, log.finished) << "nothing is under way in a window that begins anew";
}

// W17
TEST_F(OdometryBeside, BeginsAnewWhereWhatWasSolvedIsBeyondBelief) {
  OdometryOptions options;
  options.greatest_speed = 0.1;
  Flyer f(flight_, options);
  Script::Log log;
  f.defer(log);
  int resets = 0;
  for (std::size_t k = 0; k < flight_.frames.size(); ++k) {
    const UpdateReport r = f.frame(k);
    if (r.reset[0] == '\0') continue;
    ++resets;
    EXPECT_STREQ(r.reset, "the estimated speed is beyond belief");
    EXPECT_NE(r.status, Status::tracking);
    EXPECT_EQ(log.begun, log.finished);
    EXPECT_STREQ(r.solved ? r.solved->failure : r.reset, r.reset);
  }
  EXPECT_GT(resets, 0);
}

TEST_F(OdometryBeside, StartsWhereItIsToldWhileASolveIsUnderWay) {
  const SimulatedFlight flight({.rest_s = 1.5, .duration_s = 6.0});
  Flyer f(flight);
  Script::Log log;
  f.defer(log);
  for (std::size_t k = 0; k < 30; ++k) f.frame(k);
  EXPECT_EQ(log.begun, log.finished + 1);
  f.feed_to(flight.frames[30].time);
  const double t = 3.0;
  const Vec3d v = (flight.pose(t + 1e-3).t - flight.pose(t - 1e-3).t) / 2e-3;
  const InertialValues known{flight.pose(t), {v}, flight.bias};
  ASSERT_EQ(f.odometry
                .start_at({flight.frames[30].time, flight.frames[30].features}, known,
                          {Vec6d::constant(0.01), 0.1, 0.01, 0.1})
                .status,
            Status::initialised);
  EXPECT_EQ(log.begun, log.finished);
  EXPECT_EQ(f.odometry.timeline().size(), 1u);
  for (std::size_t k = 31; k < flight.frames.size(); ++k) ASSERT_EQ(f.frame(k).status, Status::tracking);
  EXPECT_EQ(f.odometry.settle().status, Status::tracking);
  EXPECT_LT((f.odometry.values(*f.odometry.timeline().latest()).T_world_body.t - flight.pose(6.0).t).norm(), 0.05);
}

}  // namespace
}  // namespace oriel
