// Jobs in a child process (executor.h, zygote.h). What a new worker has to be told when one has died is kept here: the
// config, the last context that travelled, and the inputs of the jobs done since.
#include <algorithm>
#include <chrono>
#include <utility>

#include "oriel/run/runners.h"

namespace oriel::run_detail {
namespace {

class ProcessRunner final : public JobRunner {
 public:
  ProcessRunner(const TaskOps& task, Bytes config, const ExecutorOptions& options)
      : task_(task), config_(std::move(config)), options_(options) {}
  ~ProcessRunner() override { terminate(); }

  Result<void> begin() override {
    began_ = Clock::now();
    if (auto ok = fork_worker(); !ok) return ok;
    const auto sent = socket_.send(head(WorkerPacket::begin), {config_, {}, {}});
    const auto got =
        sent ? socket_.receive(packet_, options_.time_limit) : Result<PacketSocket::Got>(PacketSocket::Got::gone);
    if (got && *got == PacketSocket::Got::timeout) {
      drop_worker();
      return Error{ErrorCode::io, std::string("a worker of task '") + task_.name + "' did not begin in time"};
    }
    if (!got || *got != PacketSocket::Got::packet)
      return Error{ErrorCode::io, std::string("a worker of task '") + task_.name + "' " + end_worker()};
    if (packet_.head.value == kAnswerDone) return {};
    Error e{ErrorCode::bad_input, text_of_answer()};
    end_worker();
    return e;
  }
  // Once for each job: those that nobody reads would fill the socket.
  void expect() override {
    if (!alive_ || std::exchange(expected_, true)) return;
    static_cast<void>(socket_.send(head(WorkerPacket::wake)));  // where the worker has gone, start sees it
  }
  JobReport start(JobId job, Bytes& input) override {
    expected_ = false;
    job_ = job;
    input_.swap(input);
    retries_ = options_.retries;
    restarted_ = anew_ = false;
    began_ = Clock::now();
    replayed_ = 0;
    if (alive_ && socket_.has_news()) end_worker();  // nothing was asked of it: it can only have gone
    if (auto ok = send_job(); !ok) return lost(JobStatus::died, ok.error().text());
    return {job, JobStatus::accepted};
  }
  // One that has gone or is late is no reason to wait.
  bool is_running() override {
    take_ready();
    return !socket_.has_news() && left().ns > 0;
  }
  JobReport finish(Bytes& output) override {
    for (;;) {
      const JobReport r = finish_or_retry(output);
      if (r.status != JobStatus::accepted) return r;
    }
  }
  JobReport finish_or_retry(Bytes& output) override {
    const JobReport r = await(output);
    const bool again = r.worker_lost && (r.status != JobStatus::timed_out || options_.retry_late);
    if (!again || retries_-- <= 0) return r;
    if (options_.retry_late) began_ = Clock::now();
    if (left().ns <= 0) return r;
    // Where there is no worker to be had another try would wait for the zygote again, and have none either.
    if (auto ok = send_job(); !ok) return lost(JobStatus::died, ok.error().text());
    return report(JobStatus::accepted);
  }
  void terminate() override { end_worker(); }

 private:
  using Clock = std::chrono::steady_clock;

  // The new worker has done again what was done before: the job's own time begins. Nothing else can come before that.
  void take_ready() {
    if (replayed_ == 0 || !socket_.has_news()) return;
    const auto got = socket_.receive(packet_, Duration{1});
    if (got && *got == PacketSocket::Got::packet && packet_.head.job == 0) begin_own_time();
  }
  void begin_own_time() {
    began_ = Clock::now();
    replayed_ = 0;
  }
  Duration so_far() const { return {std::chrono::nanoseconds(Clock::now() - began_).count()}; }
  // For ever where there is no limit. Jobs that are done again first have theirs as well.
  Duration left() const {
    if (options_.time_limit.ns <= 0) return {INT64_MAX};
    return Duration{options_.time_limit.ns * std::max<std::int64_t>(1, replayed_)} - so_far();
  }
  JobReport report(JobStatus status, std::string message = {}) const {
    return {job_, status, std::move(message), restarted_, anew_};
  }
  JobReport lost(JobStatus status, std::string message) const {
    JobReport r = report(status, std::move(message));
    r.worker_lost = true;
    return r;
  }
  PacketHead head(WorkerPacket kind, std::int64_t value = 0) const {
    PacketHead h;
    h.kind = static_cast<std::uint16_t>(kind);
    h.job = job_;
    h.value = value;
    return h;
  }

  Result<void> fork_worker() {
    auto worker = options_.zygote->spawn(task_, options_.limits, std::min(left(), Zygote::kPatience));
    if (!worker) return worker.error();
    socket_ = std::move(worker->socket);
    pid_ = worker->pid;
    alive_ = true;
    return {};
  }
  // A worker that is to come to the context of the last job that was done. It is told everything and not waited for: a
  // submit returns at once. Where it cannot begin, the answer to the job says so.
  Result<void> start_again() {
    if (auto ok = fork_worker(); !ok) return ok;
    restarted_ = true;
    anew_ = anew_ || (jobs_done_ > 0 && !task_.context_travels);
    replayed_ = static_cast<std::int64_t>(since_.size());
    auto sent = send_in_time(head(WorkerPacket::begin, kNoAnswer), {config_, checkpoint_, {}});
    for (std::size_t i = 0; i < since_.size() && sent; ++i)
      sent = send_in_time(head(WorkerPacket::job, i + 1 < since_.size() ? kNoAnswer : kReady), {since_[i], {}, {}});
    return sent;
  }
  Result<void> send_in_time(const PacketHead& h, std::array<std::span<const std::byte>, 3> parts) {
    const Duration rest = left();
    socket_.limit_sending(rest.ns == INT64_MAX ? Duration{} : std::max(rest, Duration{1'000'000}));
    return socket_.send(h, parts);
  }
  // One that was told half of it is of no use.
  Result<void> send_job() {
    Result<void> sent;
    if (!alive_) sent = start_again();
    const bool travels = task_.context_travels && static_cast<int>(since_.size()) + 1 >= options_.checkpoint_every;
    if (sent) sent = send_in_time(head(WorkerPacket::job, travels ? kContextTravels : 0), {input_, {}, {}});
    if (sent || has_gone(sent)) return {};  // where the worker has gone meanwhile, finish sees it
    end_worker();
    return sent;
  }
  bool has_gone(const Result<void>& sent) const { return alive_ && sent.error().code == ErrorCode::not_found; }
  JobReport await(Bytes& output) {
    for (;;) {
      const Duration rest = left();
      const bool waits = !socket_.has_news();
      const auto got = rest.ns > 0 ? socket_.receive(packet_, rest.ns == INT64_MAX ? Duration{} : rest,
                                                     usual_.look(so_far(), options_.spin))
                                   : late_answer();
      if (got && *got == PacketSocket::Got::packet) {
        if (packet_.head.job == 0) begin_own_time();
        if (packet_.head.job != job_) continue;
        if (waits) usual_.took(so_far());
        return arrived(output);
      }
      if (got && *got == PacketSocket::Got::timeout) {
        drop_worker();
        return lost(JobStatus::timed_out,
                    "not done after " + std::to_string(options_.time_limit.seconds()) + " s; its process was ended");
      }
      return lost(JobStatus::died, std::string("a worker of task '") + task_.name + "' " + end_worker());
    }
  }
  // What arrived in time is not lost because nobody looked.
  Result<PacketSocket::Got> late_answer() {
    return socket_.has_news() ? socket_.receive(packet_, Duration{1}) : PacketSocket::Got::timeout;
  }
  JobReport arrived(Bytes& output) {
    const bool done = packet_.head.value == kAnswerDone;
    // What it had left may be little, and its own fault; and one without a context will never do anything.
    if (packet_.head.value == kAnswerOutOfMemory || packet_.head.value == kAnswerNoContext) {
      JobReport r = lost(JobStatus::failed, text_of_answer());
      drop_worker();
      return r;
    }
    if (done) {
      output.assign(packet_.parts[0].begin(), packet_.parts[0].end());
      ++jobs_done_;
    }
    if (!packet_.parts[1].empty()) {
      checkpoint_.assign(packet_.parts[1].begin(), packet_.parts[1].end());
      since_.clear();
    } else if (task_.context_travels && done) {
      since_.push_back(input_);  // it changed the context
    }
    return done ? report(JobStatus::done) : report(JobStatus::failed, text_of_answer());
  }
  std::string text_of_answer() const {
    return {reinterpret_cast<const char*>(packet_.parts[2].data()), packet_.parts[2].size()};
  }
  void drop_worker() {
    alive_ = false;
    socket_.close();
    options_.zygote->drop(pid_);
  }
  std::string end_worker() {
    if (!alive_) return "has gone";
    alive_ = false;
    socket_.close();
    return "was " + options_.zygote->end(pid_, std::clamp(left(), Duration{20'000'000}, Zygote::kPatience));
  }

  const TaskOps& task_;
  Bytes config_, checkpoint_;
  std::vector<Bytes> since_;  // inputs
  ExecutorOptions options_;
  PacketSocket socket_;
  pid_t pid_ = -1;
  bool alive_ = false, expected_ = false;
  int retries_ = 0;
  std::int64_t replayed_ = 0;  // jobs that are done again before this one
  std::uint64_t jobs_done_ = 0;
  bool restarted_ = false, anew_ = false;
  Clock::time_point began_;
  UsualTime usual_;  // that an answer takes
  JobId job_ = 0;
  Bytes input_;
  Packet packet_;
};

}  // namespace

JobRunner* make_process_runner(const TaskOps& task, Bytes config, const ExecutorOptions& options) {
  return new ProcessRunner(task, std::move(config), options);
}

}  // namespace oriel::run_detail
