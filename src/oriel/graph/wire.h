// Edits and solutions as bytes: what a child process is sent, and what a journal holds.
//
// Types travel by name, sizes beside it; a reader takes a list of the types that it knows (TypeList). A message that is
// damaged, cut short, of another version or about unknown types is answered with an error: it never reads past its end,
// and never asks for memory that its own length does not justify.
#pragma once
#include <span>

#include "oriel/base/bytes.h"
#include "oriel/graph/graph.h"

namespace oriel {

// What a message is about. Those of the graph are below; rooms to the right add theirs (run/message.h).
using MessageKind = std::uint16_t;
inline constexpr MessageKind kEditMessage = 1, kSolutionMessage = 2;
// An edit that is the whole of a graph, and replaces what the reader has.
inline constexpr MessageKind kWholeMessage = 9;

// One message; of version 2, which knew no freedoms (freedom.h), as well as of this one: 24 bytes of header (magic,
// version, kind, size, checksum), then the payload.
struct Message {
  static constexpr std::uint32_t kMagic = 0x314c524f;               // "ORL1"
  static constexpr std::uint16_t kVersion = 3, kOldestVersion = 2;  // that are read
  static constexpr std::size_t kHeaderBytes = 24;

  MessageKind kind = 0;
  std::span<const std::byte> payload;
  std::uint16_t version = kVersion;
};
struct MessageHeader {
  MessageKind kind = 0;
  std::uint16_t version = Message::kVersion;
  std::uint64_t size = 0, checksum = 0;  // of the payload
};

// Appends a message whose payload is what write(ByteWriter&) puts.
template <class Write>
void append_message(Bytes& out, MessageKind kind, Write&& write);
// An error if these are not the 24 bytes that begin a message of this version.
Result<MessageHeader> read_header(std::span<const std::byte> bytes);
// An error if the payload is not what the header says.
Result<Message> read_payload(const MessageHeader& header, std::span<const std::byte> payload);
// Both, from bytes that hold exactly one message.
Result<Message> read_message(std::span<const std::byte> bytes);

// An edit: its ids, serials, values, everything but who lent them.
void append_edit(Bytes& out, const GraphEdit& edit);
// `target` is the graph that the edit is for: its ids bound those that the message may name. `edit` is cleared first,
// and empty after an error. What the message says is checked as far as memory is concerned, the rest by apply.
Result<void> read_edit(const Message& message, const TypeList& types, const Graph& target, GraphEdit& edit);

void append_solution(Bytes& out, const Solution& solution);
Result<void> read_solution(const Message& message, const TypeList& types, Solution& solution);

namespace detail {
void finish_message(Bytes& out, std::size_t begin, MessageKind kind);
}

template <class Write>
void append_message(Bytes& out, MessageKind kind, Write&& write) {
  const std::size_t begin = out.size();
  out.resize(begin + Message::kHeaderBytes);
  ByteWriter writer(out);
  write(writer);
  detail::finish_message(out, begin, kind);
}

}  // namespace oriel
