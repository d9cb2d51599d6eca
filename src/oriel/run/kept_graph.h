// A graph as a worker was told it, kept by whoever told: its whole as of some job, and what came since. From it another
// worker is told the same. To keep it costs no work but a copy of each message, and now and then of the whole; to make
// it again does all.
#pragma once
#include <vector>

#include "oriel/graph/wire.h"

namespace oriel::run_detail {

class KeptGraph {
 public:
  // Beside the whole as much is kept as that is itself, or `least` [bytes] if that is more, before it is taken anew.
  explicit KeptGraph(std::size_t least = 1 << 20) : least_(least) {}

  // The worker was told an edit (a message of graph/wire.h), of everything or on top of what it had. `now` is the graph
  // that it was told of.
  void told(std::span<const std::byte> message, bool whole, Graph& now);
  // What it was told is not what is kept: until the next whole one there is nothing.
  void forget() { knows_ = false; }
  // It found this (a message of a Solution).
  void solved(std::span<const std::byte> solution);
  // What a worker that knows nothing is to be told, into `message`: all of it, as one edit.
  Result<void> tell(const TypeList& types, Bytes& message);
  bool knows() const { return knows_; }

 private:
  struct Sizes {
    std::size_t edit = 0, solution = 0;  // which was found after it; 0: none was
  };
  void take_whole(Graph& graph);
  Result<void> make(const TypeList& types, Graph& graph) const;

  std::size_t least_;
  bool knows_ = false;
  Bytes whole_, since_;  // one message after the other
  std::vector<Sizes> sizes_;
  GraphEdit edit_;
};

}  // namespace oriel::run_detail
