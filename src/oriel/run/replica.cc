#include "oriel/run/replica.h"

#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <exception>

#include "oriel/graph/fingerprint.h"
#include "oriel/run/thread_count.h"

namespace oriel {
namespace {

// A graph that follows, the engine that solves it, and the answers.
class ReplicaServer {
 public:
  ReplicaServer(Channel& channel, const TypeList& types) : channel_(channel), types_(types), engine_(graph_) {}

  Result<void> handle(const Message& message) {
    switch (message.kind) {
      case kEditMessage:
      case kWholeMessage:
        return edit(message);
      case kSolutionMessage:
        return adopt(message);
      case kSolveMessage:
        return solve(message);
      case kDropCachesMessage:
        engine_.drop_caches();
        return {};
      case kLookMessage:
        return answer(Summary{});
      default:
        return Error{ErrorCode::bad_input, "a replica does not know messages of kind " + std::to_string(message.kind)};
    }
  }
  void complain(const Error& error) {
    out_.clear();
    append_error(out_, error);
    static_cast<void>(channel_.send(out_));  // nobody is left to be told if this fails too
  }

 private:
  Result<void> edit(const Message& message) {
    if (auto ok = read_edit(message, types_, graph_, edit_); !ok) return ok;
    return graph_.apply(edit_);
  }
  Result<void> adopt(const Message& message) {
    if (auto ok = read_solution(message, types_, solution_); !ok) return ok;
    solution_.version = graph_.version();  // the origin's versions are its own; here it came after all that was sent
    if (auto ok = graph_.adopt(solution_); !ok) return ok;
    return answer(Summary{});
  }
  Result<void> solve(const Message& message) {
    auto request = read_solve(message);
    if (!request) return request.error();
    request->state.solved_version = engine_.state().solved_version;
    request->state.order = engine_.state().order;
    engine_.restore(request->state);
    return answer(engine_.solve(request->options));
  }
  Result<void> answer(const Summary& summary) {
    out_.clear();
    append_outcome(out_, outcome_of(summary, engine_.state(), graph_));
    return channel_.send(out_);
  }

  Channel& channel_;
  const TypeList& types_;
  Graph graph_;
  NativeEngine engine_;
  GraphEdit edit_;
  Solution solution_;
  Bytes out_;
};

}  // namespace

void serve_replica(Channel& channel, const TypeList& types) {
  ReplicaServer server(channel, types);
  for (;;) {
    auto message = channel.receive();
    const auto ok = message ? server.handle(*message) : Result<void>(message.error());
    if (ok) continue;
    server.complain(ok.error());  // goes nowhere where the origin has gone
    return;
  }
}

Result<Replica> Replica::start(const TypeList& types) {
#ifndef __SANITIZE_THREAD__  // which keeps a thread of its own
  if (thread_count() > 1)
    return Error{ErrorCode::conflict, "a replica must be started before the program makes threads"};
#endif
  auto ends = Channel::make_pair();
  if (!ends) return ends.error();
  const pid_t pid = ::fork();
  if (pid < 0) return Error{ErrorCode::io, std::string("fork: ") + std::strerror(errno)};
  if (pid > 0) return Replica(pid, std::move(ends->first));
  try {
    ends->first.abandon();
    serve_replica(ends->second, types);
  } catch (const std::exception&) {  // out of memory: the origin sees that the channel ends
    ::_exit(1);
  }
  ::_exit(0);  // nothing of the parent's is to be flushed or destroyed here
}

Replica& Replica::operator=(Replica&& other) noexcept {
  stop();
  pid_ = std::exchange(other.pid_, -1);
  channel_ = std::move(other.channel_);
  edit_ = std::move(other.edit_);
  out_ = std::move(other.out_);
  return *this;
}

Result<void> Replica::follow(Graph& origin, Subscription subscription) {
  origin.collect(subscription, edit_);
  return edit_.empty() ? Result<void>() : send(edit_);
}

Result<void> Replica::send(const GraphEdit& edit) {
  append_edit(out_, edit);
  return flush();
}

Result<void> Replica::solve(const SolveRequest& request) {
  append_solve(out_, request);
  return flush();
}

Result<void> Replica::adopt(const Solution& solution) {
  append_solution(out_, solution);
  return flush();
}

Result<void> Replica::drop_caches() {
  append_message(out_, kDropCachesMessage, [](ByteWriter&) {});
  return flush();
}

Result<void> Replica::look() {
  append_message(out_, kLookMessage, [](ByteWriter&) {});
  return flush();
}

Result<void> Replica::flush() {
  auto ok = channel_.send(out_);
  out_.clear();
  return ok;
}

Result<SolveOutcome> Replica::outcome() {
  auto message = channel_.receive();
  if (!message) return message.error().code == ErrorCode::not_found ? gone() : message.error();
  if (message->kind != kErrorMessage) return read_outcome(*message);
  Error told = read_error(*message);
  told.message = "replica: " + told.message;
  return told;
}

Error Replica::gone() {
  const int status = stop();
  std::string how = "ended";
  if (WIFSIGNALED(status)) how = "was ended by signal " + std::to_string(WTERMSIG(status));
  if (WIFEXITED(status) && WEXITSTATUS(status) != 0) how = "ran out of memory or met a broken contract";
  return {ErrorCode::not_found, "the process of the replica " + how};
}

int Replica::stop() {
  if (pid_ <= 0) return 0;
  channel_.close();
  int status = 0;
  while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
  return status;
}

}  // namespace oriel
