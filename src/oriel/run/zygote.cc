#include "oriel/run/zygote.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/signalfd.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <map>
#include <mutex>
#include <new>
#include <set>

#include "oriel/run/runners.h"
#include "oriel/run/thread_count.h"

namespace oriel {
namespace {

// Between the program and its zygote.
enum class ZygotePacket : std::uint16_t {
  spawn = 1,    // parts: number of the task, limits; passes the worker's end. Answered by
  spawned = 2,  // value: pid, or -errno
  end = 3,      // value: pid. Answered by
  ended = 4,    // value: wait status
  drop = 5,     // value: pid. No answer
};

PacketHead head_of(ZygotePacket kind, std::int64_t value = 0) {
  PacketHead head;
  head.kind = static_cast<std::uint16_t>(kind);
  head.value = value;
  return head;
}
std::int64_t now_ns() { return std::chrono::steady_clock::now().time_since_epoch().count(); }
template <class T>
std::span<const std::byte> bytes_of(const T& x) {
  return std::as_bytes(std::span(&x, 1));
}

void set_limit(__rlimit_resource which, std::uint64_t value) {
  const rlimit limit{value, value};
  static_cast<void>(::setrlimit(which, &limit));  // refused only where it is lower already
}

// What a child of this program is like, zygote or worker.
void become_child(const std::string& name) {
  ::prctl(PR_SET_NAME, name.c_str());  // the first 15 letters
  std::signal(SIGINT, SIG_IGN);
  std::signal(SIGQUIT, SIG_IGN);
}
void die_with(pid_t parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(0);  // it died before that was heard
}

// Readable when that process has ended. The signal above is sent when the thread that forked ends, which need not be
// the end of its process.
OwnedFd watch(pid_t process) { return OwnedFd(static_cast<int>(::syscall(SYS_pidfd_open, process, 0))); }

// How a worker says that it had no memory left where nobody could catch that: in a solve, for example, which throws
// nothing.
constexpr int kOutOfMemoryExit = 112;
constexpr int kUnreadableExit = 113;
std::terminate_handler usual_end = nullptr;  // of this program

[[noreturn]] void end_of_worker() noexcept {
  try {
    if (const std::exception_ptr thrown = std::current_exception()) std::rethrow_exception(thrown);
  } catch (const std::bad_alloc&) {
    ::_exit(kOutOfMemoryExit);
  } catch (...) {  // said by the usual end
  }
  usual_end();
  std::abort();
}

[[noreturn]] void run_worker(PacketSocket socket, const TaskOps& task, const WorkerLimits& limits, pid_t zygote) {
  sigset_t none;
  ::sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  die_with(zygote);
  ::setpgid(0, 0);  // whom it forks goes with it
  become_child(std::string("oriel:") + task.name);
  if (const OwnedFd f(::open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC)); f)
    static_cast<void>(!::write(f.get(), "500", 3));  // where the system runs out of memory, this is what can be spared
  if (!limits.core_dumps) set_limit(RLIMIT_CORE, 0);
  if (limits.memory_bytes > 0) set_limit(RLIMIT_AS, limits.memory_bytes);
  if (limits.cpu_seconds > 0) set_limit(RLIMIT_CPU, limits.cpu_seconds);
  usual_end = std::set_terminate(&end_of_worker);
  try {
    serve_worker(socket, task);
  } catch (const std::bad_alloc&) {  // outside a job: the caller sees that the socket ends
    ::_exit(kOutOfMemoryExit);
  } catch (...) {
    ::_exit(1);
  }
  ::_exit(0);
}

class ZygoteServer {
 public:
  ZygoteServer(PacketSocket control, OwnedFd program, std::vector<const TaskOps*> tasks)
      : control_(std::move(control)), program_(std::move(program)), tasks_(std::move(tasks)) {}

  [[noreturn]] void serve() {
    sigset_t child;
    ::sigemptyset(&child);
    ::sigaddset(&child, SIGCHLD);
    std::signal(SIGCHLD, SIG_DFL);  // one that a program ignores is inherited, and nobody's end would be heard
    ::sigprocmask(SIG_BLOCK, &child, nullptr);
    const OwnedFd deaths(::signalfd(-1, &child, SFD_CLOEXEC | SFD_NONBLOCK));
    for (Packet packet;;) {
      std::array<pollfd, 3> p{pollfd{control_.fd(), POLLIN, 0}, pollfd{deaths.get(), POLLIN, 0},
                              pollfd{program_.get(), POLLIN, 0}};
      if (::poll(p.data(), p.size(), -1) < 0) continue;
      if (p[2].revents != 0) end_all();
      if (p[1].revents != 0) reap(deaths.get());
      if (p[0].revents == 0) continue;
      const auto got = control_.receive(packet);
      if (!got || *got == PacketSocket::Got::gone) end_all();
      if (*got == PacketSocket::Got::packet) answer(packet);
    }
  }

 private:
  void reap(int deaths) {
    std::array<signalfd_siginfo, 8> told;
    while (::read(deaths, told.data(), sizeof(told)) > 0) {
    }
    int status = 0;
    for (pid_t pid; (pid = ::waitpid(-1, &status, WNOHANG)) > 0;) {
      ::kill(-pid, SIGKILL);  // whom it has forked holds its socket open
      workers_.erase(pid);
      if (dropped_.erase(pid) == 0) ended_[pid] = status;
    }
  }
  [[noreturn]] void end_all() {
    for (const pid_t pid : workers_) ::kill(-pid, SIGKILL), ::kill(pid, SIGKILL);
    ::_exit(0);
  }
  void reply(const Packet& to, ZygotePacket kind, std::int64_t value) {
    PacketHead head = head_of(kind, value);
    head.job = to.head.job;
    static_cast<void>(control_.send(head));
  }
  void answer(Packet& packet) {
    if (packet.head.kind == static_cast<std::uint16_t>(ZygotePacket::spawn))
      reply(packet, ZygotePacket::spawned, spawn(packet));
    else if (packet.head.kind == static_cast<std::uint16_t>(ZygotePacket::end))
      reply(packet, ZygotePacket::ended, end(static_cast<pid_t>(packet.head.value)));
    else if (packet.head.kind == static_cast<std::uint16_t>(ZygotePacket::drop))
      drop(static_cast<pid_t>(packet.head.value));
  }
  void drop(pid_t pid) {
    if (ended_.erase(pid) > 0 || workers_.count(pid) == 0) return;
    ::kill(pid, SIGKILL);
    dropped_.insert(pid);
  }
  std::int64_t spawn(Packet& packet) {
    std::uint32_t task = 0;
    WorkerLimits limits;
    if (packet.parts[0].size() != sizeof(task) || packet.parts[1].size() != sizeof(limits) || !packet.passed)
      return -EINVAL;
    std::memcpy(&task, packet.parts[0].data(), sizeof(task));
    std::memcpy(&limits, packet.parts[1].data(), sizeof(limits));
    if (task >= tasks_.size()) return -EINVAL;
    PacketSocket socket(std::move(packet.passed));
    const pid_t self = ::getpid(), pid = ::fork();
    if (pid < 0) return -errno;
    if (pid > 0) {
      ended_.erase(pid), dropped_.erase(pid);  // of one that had the number before
      workers_.insert(pid);
      return pid;
    }
    control_.close();
    program_.reset();
    run_worker(std::move(socket), *tasks_[task], limits, self);
  }
  // A pid stays a zombie, and so nobody else's, until it is asked for here or seen in reap.
  int end(pid_t pid) {
    if (const auto it = ended_.find(pid); it != ended_.end()) {
      const int status = it->second;
      ended_.erase(it);
      return status;
    }
    int status = 0;
    if (workers_.erase(pid) == 0) return status;  // nobody's, or somebody else's by now
    ::kill(pid, SIGKILL);
    while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
    }
    ::kill(-pid, SIGKILL);
    return status;
  }

  PacketSocket control_;
  OwnedFd program_;
  std::vector<const TaskOps*> tasks_;
  std::map<pid_t, int> ended_;
  std::set<pid_t> workers_;  // that have not been reaped
  std::set<pid_t> dropped_;  // killed, and how they ended is nobody's business
};

std::string text_of_status(int status) {
  if (WIFSIGNALED(status)) {
    const int signal = WTERMSIG(status);
    return "killed by signal " + std::to_string(signal) + " (" + ::strsignal(signal) + ")";
  }
  if (WEXITSTATUS(status) == kOutOfMemoryExit) return "ended: out of memory";
  if (WEXITSTATUS(status) == kUnreadableExit) return "ended: it had no memory, or no descriptors, for its input";
  return "ended with exit code " + std::to_string(WEXITSTATUS(status));
}

}  // namespace

struct Zygote::State {
  std::mutex mutex;
  pid_t pid = -1;
  PacketSocket control;
  std::vector<const TaskOps*> tasks;
  std::uint64_t asked = 0;

  // What it answers. What it answers late, to a question that nobody waits for any more, is dropped: a worker that it
  // made then finds that its socket has ended.
  Result<std::int64_t> ask(PacketHead head, std::array<std::span<const std::byte>, 3> parts, int passed,
                           Duration limit) {
    const Error gone{ErrorCode::not_found, "the zygote has gone: no worker can be started"};
    head.job = ++asked;
    const std::int64_t end = now_ns() + limit.ns;
    if (!control.send(head, parts, passed)) return gone;
    for (Packet packet;;) {
      const std::int64_t left = end - now_ns();
      const auto got = left > 0 ? control.receive(packet, Duration{left}) : PacketSocket::Got::timeout;
      if (!got || *got == PacketSocket::Got::gone) return gone;
      if (*got == PacketSocket::Got::timeout)
        return Error{ErrorCode::io, "the zygote does not answer: somebody has stopped it"};
      if (packet.head.job == head.job) return packet.head.value;
    }
  }
  ~State() {
    control.close();
    int status = 0;
    while (pid > 0 && ::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
    }
  }
};

Zygote::Zygote(Owned<State> state) : state_(std::move(state)) {}
Zygote::Zygote(Zygote&&) noexcept = default;
Zygote& Zygote::operator=(Zygote&&) noexcept = default;
Zygote::~Zygote() = default;
pid_t Zygote::pid() const { return state_->pid; }

Result<Zygote> Zygote::start(std::vector<const TaskOps*> tasks) {
  for (std::size_t i = 0; i < tasks.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (std::string_view(tasks[i]->name) == tasks[j]->name)
        return Error{ErrorCode::duplicate, std::string("two tasks are named '") + tasks[i]->name + "'"};
#ifndef __SANITIZE_THREAD__  // which keeps a thread of its own
  if (thread_count() > 1)
    return Error{ErrorCode::conflict, "a zygote must be started before the program makes threads"};
#endif
  auto ends = PacketSocket::make_pair();
  if (!ends) return ends.error();
  const pid_t parent = ::getpid(), pid = ::fork();
  if (pid < 0) return Error{ErrorCode::io, std::string("fork: ") + std::strerror(errno)};
  if (pid == 0) {
    ends->first.close();
    become_child("oriel:zygote");
    OwnedFd program = watch(parent);
    if (program)
      ::prctl(PR_SET_PDEATHSIG, SIGCONT);  // one that was stopped has to see it, too
    else
      die_with(parent);                     // Linux before 5.3
    if (::getppid() != parent) ::_exit(0);  // it died before that was heard
    try {
      ZygoteServer(std::move(ends->second), std::move(program), std::move(tasks)).serve();
    } catch (...) {
      ::_exit(1);
    }
  }
  Owned<State> state(new State);
  state->pid = pid;
  state->control = std::move(ends->first);
  state->control.limit_sending(Duration{100'000'000});  // one that was stopped reads nothing
  state->tasks = std::move(tasks);
  return Zygote(std::move(state));
}

Result<Zygote::Worker> Zygote::spawn(const TaskOps& task, const WorkerLimits& limits, Duration limit) {
  std::uint32_t number = 0;
  while (number < state_->tasks.size() && state_->tasks[number] != &task) ++number;
  if (number == state_->tasks.size())
    return Error{ErrorCode::not_found, std::string("the zygote was not told of task '") + task.name + "'"};
  auto ends = PacketSocket::make_pair();
  if (!ends) return ends.error();
  const std::lock_guard lock(state_->mutex);
  PacketHead head = head_of(ZygotePacket::spawn);
  auto answer = state_->ask(head, {bytes_of(number), bytes_of(limits), {}}, ends->second.fd(), limit);
  if (!answer) return answer.error();
  if (*answer <= 0) return Error{ErrorCode::io, std::string("fork: ") + std::strerror(static_cast<int>(-*answer))};
  return Worker{static_cast<pid_t>(*answer), std::move(ends->first)};
}

std::string Zygote::end(pid_t worker, Duration limit) {
  const std::lock_guard lock(state_->mutex);
  const auto status = state_->ask(head_of(ZygotePacket::end, worker), {}, -1, limit);
  return status ? text_of_status(static_cast<int>(*status)) : "lost: " + status.error().message;
}

void Zygote::drop(pid_t worker) {
  const std::lock_guard lock(state_->mutex);
  static_cast<void>(state_->control.send(head_of(ZygotePacket::drop, worker)));  // a zygote that has gone took it along
}

void serve_worker(PacketSocket& socket, const TaskOps& task) {
  Packet packet;
  void* context = nullptr;
  std::string why, why_none;  // of an error; of there being no context
  Bytes output, travels;
  Look look;
  for (;;) {
    const auto got = socket.receive(packet, {}, look);
    if (!got) ::_exit(kUnreadableExit);  // its memory could not be mapped, for example
    if (*got != PacketSocket::Got::packet) break;
    look = {};
    if (packet.head.kind == static_cast<std::uint16_t>(WorkerPacket::wake)) {
      look.time = kAwake;
      continue;
    }
    PacketHead head;
    head.kind = static_cast<std::uint16_t>(WorkerPacket::answer);
    head.job = packet.head.job;
    output.clear(), travels.clear();
    Result<void> done;
    bool out_of_memory = false;
    bool no_context = false;
    if (packet.head.kind == static_cast<std::uint16_t>(WorkerPacket::begin)) {
      if (context != nullptr) task.destroy_context(context);
      context = nullptr;
      auto made = packet.parts[1].empty() ? run_detail::make_context(task, packet.parts[0])
                                          : task.receive_context(packet.parts[1]);
      if (made)
        context = *made;
      else
        done = made.error(), why_none = made.error().text();
    } else if (context == nullptr) {
      no_context = true;
      done = Error{ErrorCode::bad_input, "a worker has no context: " + why_none};
    } else {
      done = run_detail::run_job(task, context, packet.parts[0], output, out_of_memory);
      const bool travel = packet.head.value == kContextTravels && task.context_travels && !out_of_memory;
      if (travel) task.send_context(context, travels);
    }
    if (packet.head.value == kNoAnswer || packet.head.value == kReady) {
      if (!done && context != nullptr) {  // one that was done before: what comes after it would have other bits
        task.destroy_context(context);
        context = nullptr;
        why_none = "a job that had been done failed when it was done again: " + done.error().text();
      }
      head.job = 0;
      if (packet.head.value == kReady && !socket.send(head)) break;
      continue;
    }
    head.value = done            ? kAnswerDone
                 : out_of_memory ? kAnswerOutOfMemory
                 : no_context    ? kAnswerNoContext
                                 : kAnswerFailed;
    if (!done) why = done.error().text();
    const auto text = done ? std::span<const std::byte>() : std::as_bytes(std::span(why));
    if (!socket.send(head, {output, travels, text})) break;
  }
  if (context != nullptr) task.destroy_context(context);
}

}  // namespace oriel
