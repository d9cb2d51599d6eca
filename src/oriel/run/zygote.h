// The process that worker processes are forked from: made while the program is single-threaded, on the first line of
// main, and small for ever (decision 16). A worker forked from it inherits no lock that a thread holds, no memory of
// the caller's, and takes well below a millisecond.
//
// It and its workers die with the program, however that ends; the terminal's interrupt is the program's business, they
// ignore it. `ps` names them oriel:zygote and oriel:<task>.
#pragma once
#include <sys/types.h>

#include <vector>

#include "oriel/base/owned.h"
#include "oriel/run/packet_socket.h"
#include "oriel/run/task.h"

namespace oriel {

// What a worker's process may use.
struct WorkerLimits {
  std::uint64_t memory_bytes = 0;  // of address space; 0: no limit. Beyond it allocations fail, in the task
  std::uint64_t cpu_seconds = 0;   // of CPU time in all; 0: no limit. Beyond it the process is ended
  bool core_dumps = false;         // writing one takes longer than starting anew
};

class Zygote {
 public:
  // Forks. `tasks` are those that workers can be made for, by name: {&kTaskOps<A>, &kTaskOps<B>}. Refused once the
  // program has more than one thread, and where two tasks have one name.
  static Result<Zygote> start(std::vector<const TaskOps*> tasks);

  Zygote(Zygote&&) noexcept;
  Zygote& operator=(Zygote&&) noexcept;
  ~Zygote();  // its workers end with it

  // A worker of that task, at the other end of the socket. Any thread may ask.
  struct Worker {
    pid_t pid = -1;
    PacketSocket socket;
  };
  // `limit`: that a zygote which does not answer is waited for.
  Result<Worker> spawn(const TaskOps& task, const WorkerLimits& limits, Duration limit = kPatience);
  // Ends a worker, with what it has forked, and waits until it is gone; how it ended, as text: "killed by signal 11
  // (Segmentation fault)".
  std::string end(pid_t worker, Duration limit = kPatience);
  // Ends one that nobody waits for any more: back at once, however long the system takes to have its memory again.
  void drop(pid_t worker);

  pid_t pid() const;
  // That it is waited for at most: it answers at once, unless somebody has stopped it.
  static constexpr Duration kPatience{1'000'000'000};  // [ns]

 private:
  struct State;
  explicit Zygote(Owned<State> state);
  Owned<State> state_;
};

// The worker's side: makes a context and does jobs until the socket ends.
void serve_worker(PacketSocket& socket, const TaskOps& task);

// Kinds of packets between an executor and its worker.
enum class WorkerPacket : std::uint16_t {
  begin = 1,   // parts: config, context (empty: make it of the config); value: how to answer
  job = 2,     // parts: input; value: how to answer
  answer = 3,  // parts: output, context, text of an error; value: what came of it
  wake = 4,    // a job comes soon. No answer
};
inline constexpr std::int64_t kContextTravels = 1, kNoAnswer = 2, kReady = 3;  // how to answer
inline constexpr std::int64_t kAnswerDone = 0, kAnswerFailed = 1, kAnswerOutOfMemory = 2,
                              kAnswerNoContext = 3;  // what came of it
inline constexpr Duration kAwake{1'000'000};         // that a worker then looks for it before it sleeps again [ns]

}  // namespace oriel
