// Where a task runs: in place, in a thread, or in a child process, by a word; with the same results in all three.
//
//     Zygote zygote = Zygote::start({&kTaskOps<Doubling>}).value();   // first line of main; for ExecutorKind::process
//     ExecutorOptions options;
//     options.zygote = &zygote;
//     auto executor = Executor<Doubling>::start(ExecutorKind::process, config, options).value();
//     executor.submit(task.collect(map));     // returns at once
//     ...                                     // the caller goes on
//     executor.write_back(map);               // waits, and applies the result once
//
// One job is in flight, from submit until its result is written back (or forgotten). One caller: an executor is no more
// than a value of its owner, and needs no locks of his.
#pragma once
#include <string>
#include <string_view>

#include "oriel/base/owned.h"
#include "oriel/base/time.h"
#include "oriel/run/job.h"
#include "oriel/run/task.h"
#include "oriel/run/zygote.h"

namespace oriel {

enum class ExecutorKind { in_place, thread, process };

// By the words of a config (run_names.h): "inline", "thread", "process". An unknown one is an error that lists these.
Result<ExecutorKind> executor_kind(std::string_view word);
std::string name_of(ExecutorKind kind);

struct ExecutorOptions {
  // What a submit does while another job is in flight: refused as busy; or it waits until that one is written back, and
  // of several that wait the newest stays (or what Task::merge makes of them).
  bool coalesce = false;
  // A job that takes longer is given up: a process is ended, the result of a thread is dropped. Not in place. 0: none.
  Duration time_limit{0};
  // How long whoever waits for a result looks for it, from shortly before the last ones would have been there (look.h):
  // a core that sleeps is some 100 us late. It is left to others that want it meanwhile. 0: sleeps at once.
  Duration spin{1'000'000};  // [ns]
  // ---- of processes ----
  Zygote* zygote = nullptr;  // must outlive the executor
  WorkerLimits limits;
  // How often a context that can travel does: with each so many-th result. A new worker gets the last one and the
  // inputs since; those have time limits of their own, before that of the next job.
  int checkpoint_every = 1;
  // How often a job whose process died or ran out of memory is begun again by a new one, before it is given up.
  int retries = 0;
  // Also one that was late: whoever waits for it then waits for (retries + 1) time limits at most.
  bool retry_late = false;
};

namespace run_detail {

// Runs one job after the other.
class JobRunner {
 public:
  virtual ~JobRunner() = default;
  // Makes the context; the error of init_context.
  virtual Result<void> begin() = 0;
  // A job comes soon.
  virtual void expect() = 0;
  // accepted, or died, or busy where one that was given up still runs. The input may be taken.
  virtual JobReport start(JobId job, Bytes& input) = 0;
  virtual bool is_running() = 0;
  // Waits for the job: done, failed, died or timed_out.
  virtual JobReport finish(Bytes& output) = 0;
  // The same where is_running is false, and it does not wait: accepted where the job is begun again.
  virtual JobReport finish_or_retry(Bytes& output) { return finish(output); }
  virtual void terminate() = 0;
};

// An executor as far as it needs not know what a job is about.
class ExecutorCore {
 public:
  static Result<ExecutorCore> start(ExecutorKind kind, const TaskOps& task, Bytes config,
                                    const ExecutorOptions& options);
  ExecutorCore(ExecutorCore&&) noexcept;
  ExecutorCore& operator=(ExecutorCore&&) noexcept;
  ~ExecutorCore();

  void expect();
  Bytes& input() { return input_; }  // to be encoded into
  JobReport submit();
  bool is_running();
  // The job's report once it is there; none before. Never waits.
  const JobReport* report();
  // Waits for the report; null without a job.
  const JobReport* wait();
  const Bytes& output() const { return output_; }
  void forget();  // the job; what waits begins
  void terminate();
  ExecutorKind kind() const { return kind_; }

 private:
  ExecutorCore(ExecutorKind kind, const TaskOps& task, bool coalesce, Owned<JobRunner> runner);
  JobReport begin(JobId job, Bytes& input);

  ExecutorKind kind_;
  const TaskOps* task_;
  bool coalesce_ = false, terminated_ = false;
  Owned<JobRunner> runner_;
  JobId last_ = 0, waiting_ = 0;  // 0: none
  enum class State { idle, running, finished } state_ = State::idle;
  JobReport report_;
  Bytes input_, waiting_input_, output_;
};

}  // namespace run_detail

template <Task T>
class Executor {
 public:
  using Config = TaskConfig<T>;
  using Input = TaskInput<T>;
  using Output = TaskOutput<T>;
  using Map = TaskMap<T>;

  // Makes the worker and its context. An error: that of init_context; a process without a zygote, or that could not be
  // started.
  static Result<Executor> start(ExecutorKind kind, const Config& config, const ExecutorOptions& options = {}) {
    Bytes bytes;
    encode(config, bytes);
    auto core = run_detail::ExecutorCore::start(kind, kTaskOps<T>, std::move(bytes), options);
    if (!core) return core.error();
    return Executor(std::move(*core));
  }

  // A job comes within a millisecond: a worker that sleeps wakes up while its input is collected. Nothing in place.
  void expect() { core_.expect(); }
  // Hands a copy of the input over. accepted (in place: the job has run), waiting, busy, died or terminated.
  JobReport submit(const Input& input) {
    encode(input, core_.input());
    return core_.submit();
  }
  // Whether a job runs whose result is not there yet. Never waits; false in place and without a job.
  bool is_running() { return core_.is_running(); }
  // What the job in flight came to, if its result is there and not yet written back; null otherwise. Never waits. It is
  // good until the job is written back.
  const Output* result() {
    const JobReport* r = core_.report();
    if (r == nullptr || r->status != JobStatus::done) return nullptr;
    return read_output() ? &output_ : nullptr;
  }
  // Waits for the job in flight and applies its result once. done; or failed, died, timed_out, and the map is
  // untouched; none where there is no job, and nothing is done. What waited begins now.
  JobReport write_back(Map& map) {
    const JobReport* r = core_.wait();
    if (r == nullptr) return {};
    JobReport report = *r;
    const Forgetter once{*this};  // also where write throws
    if (report.status == JobStatus::done) {
      if (auto ok = read_output(); ok)
        T::write(output_, map);
      else
        report.status = JobStatus::failed, report.message = ok.error().text();
    }
    return report;
  }
  // Waits for the job in flight and forgets its result.
  JobReport discard() {
    const JobReport* r = core_.wait();
    if (r == nullptr) return {};
    const Forgetter once{*this};
    return *r;
  }
  // Ends the worker: a process at once, a thread after the job that it is at. As often as one likes; a submit
  // afterwards is refused. What had arrived can still be written back.
  void terminate() { core_.terminate(); }
  ExecutorKind kind() const { return core_.kind(); }

 private:
  struct Forgetter {
    Executor& executor;
    ~Forgetter() {
      executor.core_.forget();
      executor.read_ = false;
    }
  };
  explicit Executor(run_detail::ExecutorCore core) : core_(std::move(core)) {}
  Result<void> read_output() {
    if (read_) return {};
    auto ok = decode(std::span<const std::byte>(core_.output()), output_);
    read_ = ok.ok();
    return ok;
  }
  run_detail::ExecutorCore core_;
  Output output_;
  bool read_ = false;
};

}  // namespace oriel
