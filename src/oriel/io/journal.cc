#include "oriel/io/journal.h"

#include <cerrno>
#include <cstring>

namespace oriel {
namespace {

constexpr std::string_view kFirstLine = "oriel journal 2\n", kFirstLineOf1 = "oriel journal 1\n";

Error refused(const std::string& path) { return {ErrorCode::io, std::strerror(errno), path}; }

}  // namespace

std::string_view build_name() {
#if defined(__AVX512F__)
  return "avx512";
#elif defined(__AVX2__)
  return "avx2";
#elif defined(__AVX__)
  return "avx";
#else
  return "baseline";
#endif
}

JournalWriter::JournalWriter(detail::File file, std::string path, Graph& graph)
    : file_(std::move(file)), path_(std::move(path)), graph_(&graph), subscription_(graph.subscribe()) {}

JournalWriter::JournalWriter(JournalWriter&& other) noexcept
    : file_(std::move(other.file_)),
      path_(std::move(other.path_)),
      graph_(std::exchange(other.graph_, nullptr)),
      subscription_(other.subscription_),
      seen_(other.seen_),
      status_(std::move(other.status_)),
      count_(other.count_),
      edit_(std::move(other.edit_)),
      out_(std::move(other.out_)) {}

JournalWriter::~JournalWriter() { static_cast<void>(close()); }

Result<JournalWriter> JournalWriter::create(const std::string& path, Graph& graph) {
  detail::File file(std::fopen(path.c_str(), "wb"));
  if (!file) return refused(path);
  JournalWriter w(std::move(file), path, graph);
  ByteWriter(w.out_).put_bytes(kFirstLine.data(), kFirstLine.size());
  append_message(w.out_, kBuildMessage, [](ByteWriter& b) { b.put_text(build_name()); });
  w.count_ = 1;
  w.write();
  w.edited();
  if (!w.status_) return w.status_.error();
  return w;
}

void JournalWriter::edited() {
  if (!status_ || graph_ == nullptr) return;
  graph_->collect(subscription_, edit_);
  seen_ = graph_->version();
  if (edit_.empty()) return;
  append_edit(out_, edit_);
  ++count_;
  write();
}

void JournalWriter::solved(const SolveOptions& options, const SolverState& before, const Summary& summary,
                           const NativeEngine& engine) {
  if (!status_ || graph_ == nullptr) return;
  const bool adopted = !summary.failed() && summary.accepted > 0;
  if (adopted && engine.solution().version != seen_) {
    status_ = Error{ErrorCode::conflict, "an edit was solved before the journal was told of it", path_};
    return;
  }
  append_solve(out_, request_of(options, before, summary));
  if (adopted) append_solution(out_, engine.solution());
  append_outcome(out_, outcome_of(summary, engine.state(), *graph_));
  count_ += adopted ? 3 : 2;
  seen_ = graph_->version();
  write();
}

void JournalWriter::write() {
  if (status_ && std::fwrite(out_.data(), 1, out_.size(), file_.get()) != out_.size()) status_ = refused(path_);
  out_.clear();
}

Result<void> JournalWriter::close() {
  if (graph_ == nullptr) return status_;
  edited();
  append_message(out_, kEndMessage, [this](ByteWriter& b) { b.put(count_); });
  write();
  graph_->unsubscribe(subscription_);
  graph_ = nullptr;
  if (std::fclose(file_.release()) != 0 && status_) status_ = refused(path_);
  return status_;
}

Result<JournalReader> JournalReader::open(const std::string& path) {
  detail::File file(std::fopen(path.c_str(), "rb"));
  if (!file) return Error{ErrorCode::not_found, std::strerror(errno), path};
  if (std::fseek(file.get(), 0, SEEK_END) != 0) return refused(path);
  const long size = std::ftell(file.get());
  if (size < 0 || std::fseek(file.get(), 0, SEEK_SET) != 0) return refused(path);
  JournalReader r(std::move(file), path, static_cast<std::uint64_t>(size));
  if (auto ok = r.read_first_line(); !ok) return ok.error();
  auto first = r.next();
  if (!first) return first.error();
  if (!*first || (*first)->kind != kBuildMessage) return r.damage("the name of the build expected");
  ByteReader in((*first)->payload);
  r.build_ = in.get_text();
  return r;
}

Result<void> JournalReader::read_first_line() {
  std::string line(kFirstLine.size(), '\0');
  const bool whole = left_ >= line.size() && std::fread(line.data(), 1, line.size(), file_.get()) == line.size();
  if (!whole || (line != kFirstLine && line != kFirstLineOf1))
    return Error{ErrorCode::bad_input,
                 "it is no journal of a version that is known (\"oriel journal 1\" or \"oriel journal 2\" expected)",
                 path_, 1};
  version_ = line == kFirstLine ? 2 : 1;
  left_ -= line.size();
  at_ = static_cast<std::int64_t>(line.size());
  return {};
}

Error JournalReader::damage(const std::string& what) {
  over_ = true;
  return {ErrorCode::bad_input,
          "message " + std::to_string(count_ + 1) + ", at byte " + std::to_string(at_) + ": " + what + "; the " +
              std::to_string(count_) + " before it are whole",
          path_};
}

Result<std::optional<Message>> JournalReader::next() {
  if (over_) return std::optional<Message>();
  if (left_ == 0) return end();
  if (left_ < Message::kHeaderBytes) return damage("it is cut short");
  in_.resize(Message::kHeaderBytes);
  if (std::fread(in_.data(), 1, in_.size(), file_.get()) != in_.size()) return damage("it cannot be read");
  left_ -= in_.size();
  auto header = read_header(in_);
  if (!header) return damage(header.error().message);
  if (header->size > left_) return damage("it is cut short");
  in_.resize(header->size);
  if (std::fread(in_.data(), 1, in_.size(), file_.get()) != in_.size()) return damage("it cannot be read");
  auto message = read_payload(*header, in_);
  if (!message) return damage(message.error().message);
  left_ -= in_.size();
  if (message->kind == kEndMessage) return end(*message);
  at_ += static_cast<std::int64_t>(Message::kHeaderBytes + in_.size());
  ++count_;
  return std::optional<Message>(*message);
}

// Of the file's bytes.
Result<std::optional<Message>> JournalReader::end() {
  if (version_ > 1) return damage("it is cut short, its end is missing");
  over_ = true;
  return std::optional<Message>();
}

// Of what was written.
Result<std::optional<Message>> JournalReader::end(const Message& message) {
  ByteReader in(message.payload);
  const auto count = in.get<std::uint64_t>();
  if (!in.at_end() || count != static_cast<std::uint64_t>(count_))
    return damage("an end after " + std::to_string(count) + " messages");
  if (left_ > 0) return damage("something follows its end");
  over_ = true;
  return std::optional<Message>();
}

}  // namespace oriel
