// The journal of a run: every edit, every solve with the state that it began with, what it found, in the order in which
// they happened. Replayed, it gives the same graph and the same bits (io/replay.h).
//
// A file is a line of text, then messages (graph/wire.h, run/message.h), each with its checksum, the last of which says
// that it is the last: one that is cut short or damaged is good up to there, and says so. Edits are written as a
// follower is sent them, with ids and serials, so that a journal needs nothing of what the program did besides. It is
// read by a build of the same version; the same bits are promised for the same instruction set (the first message names
// it).
#pragma once
#include <cstdio>
#include <memory>
#include <optional>
#include <string>

#include "oriel/run/message.h"

namespace oriel {

inline constexpr MessageKind kBuildMessage = 8;  // the first: what wrote the journal
inline constexpr MessageKind kEndMessage = 10;   // the last: how many are before it (9: graph/wire.h)

namespace detail {
struct CloseFile {
  void operator()(std::FILE* f) const { std::fclose(f); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;
}  // namespace detail

class JournalWriter {
 public:
  // Makes the file, and writes the graph as it is. The graph must live as long as the journal is open.
  static Result<JournalWriter> create(const std::string& path, Graph& graph);
  JournalWriter(JournalWriter&& other) noexcept;
  JournalWriter& operator=(JournalWriter&&) = delete;
  ~JournalWriter();  // closes

  // To be called after every edit, at the latest before the next solve: writes what is new, if anything is.
  void edited();
  // To be called after every solve, with the options and the engine's state that it began with.
  void solved(const SolveOptions& options, const SolverState& before, const Summary& summary,
              const NativeEngine& engine);

  // The first error of all that was written so far; nothing more is written after one.
  const Result<void>& status() const { return status_; }
  // Writes out what is pending and the end, and closes.
  Result<void> close();

 private:
  JournalWriter(detail::File file, std::string path, Graph& graph);
  void write();

  detail::File file_;
  std::string path_;
  Graph* graph_;
  Subscription subscription_;
  std::uint64_t seen_ = 0;  // version of the graph up to which edits are written
  Result<void> status_;
  std::uint64_t count_ = 0;  // messages written
  GraphEdit edit_;           // scratch
  Bytes out_;
};

class JournalReader {
 public:
  static Result<JournalReader> open(const std::string& path);

  // The next message; nothing at the end, which is not handed out. Its payload is good until the next call. An error
  // names the place of the damage; after it there is nothing more to read.
  Result<std::optional<Message>> next();
  std::int64_t count() const { return count_; }  // messages read so far
  // What was told of the build that wrote it, e.g. "oriel 0.1 avx512".
  const std::string& build() const { return build_; }
  int version() const { return version_; }  // of the file; 1 knew no end

 private:
  JournalReader(detail::File file, std::string path, std::uint64_t left)
      : file_(std::move(file)), path_(std::move(path)), left_(left) {}
  Result<void> read_first_line();
  Result<std::optional<Message>> end();
  Result<std::optional<Message>> end(const Message& message);
  Error damage(const std::string& what);

  detail::File file_;
  std::string path_, build_;
  std::uint64_t left_ = 0;  // bytes of the file that were not read yet
  std::int64_t count_ = 0, at_ = 0;
  int version_ = 0;
  bool over_ = false;  // at the end, or at the damage
  Bytes in_;
};

// The instruction set that this build of the library is for.
std::string_view build_name();

}  // namespace oriel
