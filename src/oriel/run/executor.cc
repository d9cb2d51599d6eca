#include "oriel/run/executor.h"

#include <new>
#include <ostream>
#include <utility>

#include "oriel/run/runners.h"

namespace oriel {

const char* name_of(JobStatus status) {
  switch (status) {
    case JobStatus::none:
      return "none";
    case JobStatus::accepted:
      return "accepted";
    case JobStatus::waiting:
      return "waiting";
    case JobStatus::busy:
      return "busy";
    case JobStatus::done:
      return "done";
    case JobStatus::failed:
      return "failed";
    case JobStatus::died:
      return "died";
    case JobStatus::timed_out:
      return "timed out";
    case JobStatus::terminated:
      return "terminated";
  }
  return "";
}

std::ostream& operator<<(std::ostream& out, const JobReport& report) {
  out << "job " << report.job << ": " << name_of(report.status);
  if (!report.message.empty()) out << ": " << report.message;
  if (report.restarted) out << " (worker started anew" << (report.context_anew ? ", context made anew)" : ")");
  return out;
}

namespace task_detail {

Error error_of_exception(const char* what) {
  const std::string name = what;
  try {
    throw;
  } catch (const std::exception& e) {
    return {ErrorCode::bad_input, name + ": " + e.what()};
  } catch (...) {
    return {ErrorCode::bad_input, name + ": threw something that is no std::exception"};
  }
}

}  // namespace task_detail

namespace run_detail {
namespace {

Error no_memory() { return {ErrorCode::io, "the task: out of memory"}; }

}  // namespace

Result<void*> make_context(const TaskOps& task, std::span<const std::byte> config) {
  try {
    return task.make_context(config);
  } catch (const std::bad_alloc&) {
    return no_memory();
  } catch (...) {
    return task_detail::error_of_exception("the task");
  }
}

Result<void> run_job(const TaskOps& task, void* context, std::span<const std::byte> input, Bytes& output,
                     bool& out_of_memory) {
  out_of_memory = false;
  try {
    return task.optimize(context, input, output);
  } catch (const std::bad_alloc&) {
    output = {};
    out_of_memory = true;
    return no_memory();
  } catch (...) {  // a copy of the context, for example
    output.clear();
    return task_detail::error_of_exception("the task");
  }
}

ExecutorCore::ExecutorCore(ExecutorKind kind, const TaskOps& task, bool coalesce, Owned<JobRunner> runner)
    : kind_(kind), task_(&task), coalesce_(coalesce), runner_(std::move(runner)) {}
ExecutorCore::ExecutorCore(ExecutorCore&&) noexcept = default;
ExecutorCore& ExecutorCore::operator=(ExecutorCore&&) noexcept = default;
ExecutorCore::~ExecutorCore() = default;

Result<ExecutorCore> ExecutorCore::start(ExecutorKind kind, const TaskOps& task, Bytes config,
                                         const ExecutorOptions& options) {
  if (kind == ExecutorKind::process && options.zygote == nullptr)
    return Error{ErrorCode::bad_input, "executor process: expected a zygote in its options"};
  if (options.checkpoint_every < 1 || options.retries < 0 || options.time_limit.ns < 0 || options.spin.ns < 0)
    return Error{ErrorCode::bad_input,
                 "executor: expected checkpoint_every >= 1, retries >= 0, time_limit >= 0 and spin >= 0"};
  Owned<JobRunner> runner(kind == ExecutorKind::in_place ? make_in_place_runner(task, std::move(config))
                          : kind == ExecutorKind::thread ? make_thread_runner(task, std::move(config), options)
                                                         : make_process_runner(task, std::move(config), options));
  if (auto ok = runner->begin(); !ok) return ok.error();
  return ExecutorCore(kind, task, options.coalesce, std::move(runner));
}

void ExecutorCore::expect() {
  if (!terminated_ && state_ == State::idle) runner_->expect();
}

JobReport ExecutorCore::submit() {
  if (terminated_) return {0, JobStatus::terminated, "the executor was terminated"};
  if (state_ == State::idle) return begin(++last_, input_);
  if (!coalesce_)
    return {0, JobStatus::busy, "job " + std::to_string(report_.job) + " is in flight: write it back first"};
  if (waiting_ == 0) {
    waiting_input_.swap(input_);
  } else if (auto ok = task_->merge(waiting_input_, input_); !ok) {
    return {waiting_, JobStatus::failed, ok.error().text()};
  }
  waiting_ = ++last_;
  return {waiting_, JobStatus::waiting};
}

JobReport ExecutorCore::begin(JobId job, Bytes& input) {
  report_ = {job, JobStatus::accepted};
  JobReport started = runner_->start(job, input);
  state_ = started.status == JobStatus::accepted ? State::running : State::idle;
  return started;
}

bool ExecutorCore::is_running() { return state_ == State::running && runner_->is_running(); }

const JobReport* ExecutorCore::report() {
  if (state_ == State::idle || is_running()) return nullptr;
  if (state_ == State::running) {
    const JobReport now = runner_->finish_or_retry(output_);
    if (now.status == JobStatus::accepted) return nullptr;
    report_ = now;
    state_ = State::finished;
  }
  return &report_;
}

const JobReport* ExecutorCore::wait() {
  if (state_ == State::idle) return nullptr;
  if (state_ == State::running) {
    report_ = runner_->finish(output_);
    state_ = State::finished;
  }
  return &report_;
}

void ExecutorCore::forget() {
  state_ = State::idle;
  if (waiting_ == 0) return;
  const JobId job = std::exchange(waiting_, 0);
  const JobReport started =
      terminated_ ? JobReport{job, JobStatus::terminated, "the executor was terminated before the job began"}
                  : begin(job, waiting_input_);
  if (started.status == JobStatus::accepted) return;
  report_ = started;  // told by the next write_back
  state_ = State::finished;
}

void ExecutorCore::terminate() {
  if (terminated_) return;
  terminated_ = true;
  static_cast<void>(report());  // it may have arrived
  const bool cut = state_ == State::running;
  runner_->terminate();
  if (!cut) return;
  report_ = {report_.job, JobStatus::terminated, "the executor was terminated while the job ran"};
  state_ = State::finished;
}

}  // namespace run_detail
}  // namespace oriel
