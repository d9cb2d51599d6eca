// A replica: a graph and an engine in a process of their own, kept equal to an origin's graph by its net edits
// (decisions 5 to 8). Asked for the same solves it comes to the same bits, whenever it was last told something, and
// whatever it has forgotten in between.
#pragma once
#include <sys/types.h>

#include "oriel/run/channel.h"
#include "oriel/run/message.h"

namespace oriel {

class Replica {
 public:
  // Forks. Refused once the program has more than one thread: a child would hold their locks for ever. What has to be
  // known of types is in the list; it is copied.
  static Result<Replica> start(const TypeList& types);

  Replica(Replica&& other) noexcept { *this = std::move(other); }
  Replica& operator=(Replica&& other) noexcept;
  ~Replica() { stop(); }

  // Everything below sends and returns; what the replica refuses is the answer to the next outcome() or solution().

  // What the subscription of the origin has not seen yet. An engine's solution is no edit (C5): a replica that is to
  // have the values as well is told of each solve, or of what was adopted, in the order in which it happened.
  Result<void> follow(Graph& origin, Subscription subscription);
  Result<void> send(const GraphEdit& edit);
  Result<void> solve(const SolveRequest& request);
  Result<void> adopt(const Solution& solution);
  Result<void> drop_caches();
  // Asks how things stand: answered by an outcome with nothing but state and fingerprint.
  Result<void> look();

  // Waits for the outcome of the earliest solve, adopt or look that was not taken yet.
  Result<SolveOutcome> outcome();

  pid_t pid() const { return pid_; }
  // Ends the process, after the message that it is at; its wait status.
  int stop();

 private:
  Replica(pid_t pid, Channel channel) : pid_(pid), channel_(std::move(channel)) {}
  Result<void> flush();
  Error gone();

  pid_t pid_ = -1;
  Channel channel_;
  GraphEdit edit_;  // scratch of follow
  Bytes out_;
};

// The other side: does what the messages say, until the channel ends. What a replica's process runs.
void serve_replica(Channel& channel, const TypeList& types);

}  // namespace oriel
