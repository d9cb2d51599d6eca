// Jobs in place, and in a thread.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <utility>

#include "oriel/base/spin.h"
#include "oriel/run/look.h"
#include "oriel/run/runners.h"

namespace oriel::run_detail {
namespace {

// A context and the jobs that change it.
class Worker {
 public:
  Worker(const TaskOps& task, Bytes config) : task_(task), config_(std::move(config)) {}
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;
  ~Worker() {
    if (context_ != nullptr) task_.destroy_context(context_);
  }
  Result<void> begin() {
    auto made = make_context(task_, config_);
    if (!made) return made.error();
    context_ = *made;
    return {};
  }
  JobReport run(JobId job, const Bytes& input, Bytes& output) {
    output.clear();
    bool out_of_memory = false;
    const auto ok = run_job(task_, context_, input, output, out_of_memory);
    return ok ? JobReport{job, JobStatus::done} : JobReport{job, JobStatus::failed, ok.error().text()};
  }

 private:
  const TaskOps& task_;
  Bytes config_;
  void* context_ = nullptr;
};

class InPlaceRunner final : public JobRunner {
 public:
  InPlaceRunner(const TaskOps& task, Bytes config) : worker_(task, std::move(config)) {}
  Result<void> begin() override { return worker_.begin(); }
  JobReport start(JobId job, Bytes& input) override {
    report_ = worker_.run(job, input, output_);
    return {job, JobStatus::accepted};
  }
  bool is_running() override { return false; }
  JobReport finish(Bytes& output) override {
    output.swap(output_);
    return report_;
  }
  void terminate() override {}
  void expect() override {}

 private:
  Worker worker_;
  JobReport report_;
  Bytes output_;
};

class ThreadRunner final : public JobRunner {
 public:
  ThreadRunner(const TaskOps& task, Bytes config, Duration time_limit, Duration spin)
      : worker_(task, std::move(config)), time_limit_(time_limit), spin_(spin) {}
  ~ThreadRunner() override { terminate(); }

  // The context is made in the thread, where the work runs: a task may mind.
  Result<void> begin() override {
    Result<void> made;
    thread_ = std::thread([&, this] { serve(made); });
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return begun_; });
    return made;
  }
  void expect() override {
    const std::lock_guard lock(mutex_);
    if (state_ == State::running) return;
    expected_ = true;
    changed_.notify_all();
  }
  JobReport start(JobId job, Bytes& input) override {
    const std::lock_guard lock(mutex_);
    if (state_ == State::running)
      return {job, JobStatus::busy, "job " + std::to_string(job_) + " passed its time limit and still runs"};
    input_.swap(input);
    job_ = job;
    began_ = Clock::now();
    state_ = State::running;
    changed_.notify_all();
    return {job, JobStatus::accepted};
  }
  bool is_running() override {
    const std::lock_guard lock(mutex_);
    return state_ == State::running && !is_late();
  }
  JobReport finish(Bytes& output) override {
    std::unique_lock lock(mutex_);
    const auto ready = [&] { return state_ == State::finished; };
    const bool waits = !ready();
    if (waits) look(lock, ready);
    if (time_limit_.ns > 0)
      changed_.wait_until(lock, began_ + std::chrono::nanoseconds(time_limit_.ns), ready);
    else
      changed_.wait(lock, ready);
    if (!ready())
      return {job_, JobStatus::timed_out,
              "not done after " + std::to_string(time_limit_.seconds()) +
                  " s; a thread cannot be ended, its result "
                  "will be dropped"};
    if (waits) usual_.took(so_far());
    output.swap(output_);
    state_ = State::idle;
    return report_;
  }
  void terminate() override {
    {
      const std::lock_guard lock(mutex_);
      ends_ = true;
      changed_.notify_all();
    }
    if (thread_.joinable()) thread_.join();
  }

 private:
  using Clock = std::chrono::steady_clock;
  enum class State { idle, running, finished };
  static constexpr Pace kPace{4, 32};  // whoever is waited for may be on this core

  Duration so_far() const { return {std::chrono::nanoseconds(Clock::now() - began_).count()}; }
  bool is_late() const { return time_limit_.ns > 0 && so_far() >= time_limit_; }
  template <class F>
  void look(std::unique_lock<std::mutex>& lock, F&& ready) {
    Look look = usual_.look(so_far(), spin_);
    if (time_limit_.ns > 0) look = look.within(std::max(time_limit_ - so_far(), Duration{}));
    if (look.time.ns <= 0) return;
    if (changed_.wait_for(lock, std::chrono::nanoseconds(look.after.ns), ready)) return;
    lock.unlock();
    spin_until(std::chrono::nanoseconds(look.time.ns), kPace, ready);
    lock.lock();
  }
  void serve(Result<void>& made) {
    std::unique_lock lock(mutex_);
    made = worker_.begin();
    begun_ = true;
    const bool good = made.ok();  // `made` is the caller's, who goes on now
    changed_.notify_all();
    while (good) {
      changed_.wait(lock, [&] { return ends_ || expected_ || state_ == State::running; });
      if (ends_) return;
      if (std::exchange(expected_, false) && state_ != State::running) {
        lock.unlock();
        spin_until(std::chrono::nanoseconds(kAwake.ns), kPace, [&] { return state_ == State::running; });
        lock.lock();
        continue;
      }
      lock.unlock();
      JobReport report = worker_.run(job_, input_, output_);
      lock.lock();
      report_ = std::move(report);
      state_ = State::finished;
      changed_.notify_all();
    }
  }

  Worker worker_;
  Duration time_limit_, spin_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::thread thread_;
  bool begun_ = false, ends_ = false;
  bool expected_ = false;
  std::atomic<State> state_ = State::idle;  // changed under the lock, and looked at without
  Clock::time_point began_;
  UsualTime usual_;  // that a job takes whose end is waited for
  JobId job_ = 0;
  JobReport report_;
  Bytes input_, output_;  // the thread's while state_ is running
};

}  // namespace

JobRunner* make_in_place_runner(const TaskOps& task, Bytes config) {
  return new InPlaceRunner(task, std::move(config));
}
JobRunner* make_thread_runner(const TaskOps& task, Bytes config, const ExecutorOptions& options) {
  return new ThreadRunner(task, std::move(config), options.time_limit, options.spin);
}

}  // namespace oriel::run_detail
