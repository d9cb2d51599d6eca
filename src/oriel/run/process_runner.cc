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
    if (alive_ && socket_.has_news()) end_worker();  // nothing was asked of it: it can only have gone
    if (auto ok = send_job(); !ok) return lost(JobStatus::died, ok.error().text());
    return {job, JobStatus::accepted};
  }
  // One that has gone or is late is no reason to wait.
  bool is_running() override { return !socket_.has_news() && left().ns > 0; }
  JobReport finish(Bytes& output) override {
    for (;;) {
      JobReport r = await(output);
      const bool again = r.worker_lost && (r.status != JobStatus::timed_out || options_.retry_late);
      if (!again || retries_-- <= 0) return r;
      if (options_.retry_late) began_ = Clock::now();
      if (left().ns <= 0) return r;
      if (auto ok = send_job(); !ok) return lost(JobStatus::died, ok.error().text());
    }
  }
  void terminate() override { end_worker(); }

 private:
  using Clock = std::chrono::steady_clock;

  // For ever where there is no limit.
  Duration left() const {
    if (options_.time_limit.ns <= 0) return {INT64_MAX};
    const std::int64_t so_far = std::chrono::nanoseconds(Clock::now() - began_).count();
    return {options_.time_limit.ns - so_far};
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
    socket_.limit_sending(options_.time_limit);
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
    auto sent = socket_.send(head(WorkerPacket::begin, kNoAnswer), {config_, checkpoint_, {}});
    for (std::size_t i = 0; i < since_.size() && sent; ++i)
      sent = socket_.send(head(WorkerPacket::job, kNoAnswer), {since_[i], {}, {}});
    return sent;
  }
  Result<void> send_job() {
    if (!alive_)
      if (auto ok = start_again(); !ok && !has_gone(ok)) return ok;
    const bool travels = task_.context_travels && static_cast<int>(since_.size()) + 1 >= options_.checkpoint_every;
    // Where the worker has gone meanwhile, finish sees it.
    auto sent = socket_.send(head(WorkerPacket::job, travels ? kContextTravels : 0), {input_, {}, {}});
    if (sent || has_gone(sent)) return {};
    end_worker();
    return sent;
  }
  bool has_gone(const Result<void>& sent) const { return alive_ && sent.error().code == ErrorCode::not_found; }
  JobReport await(Bytes& output) {
    for (;;) {
      const Duration rest = left();
      const auto got = rest.ns > 0 ? socket_.receive(packet_, rest.ns == INT64_MAX ? Duration{} : rest, options_.spin)
                                   : late_answer();
      if (got && *got == PacketSocket::Got::packet) {
        if (packet_.head.job != job_) continue;  // of another
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
  std::uint64_t jobs_done_ = 0;
  bool restarted_ = false, anew_ = false;
  Clock::time_point began_;
  JobId job_ = 0;
  Bytes input_;
  Packet packet_;
};

}  // namespace

JobRunner* make_process_runner(const TaskOps& task, Bytes config, const ExecutorOptions& options) {
  return new ProcessRunner(task, std::move(config), options);
}

}  // namespace oriel::run_detail
