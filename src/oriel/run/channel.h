// Messages over a socket between two processes on one machine.
#pragma once
#include <utility>

#include "oriel/graph/wire.h"

namespace oriel {

class Channel {
 public:
  Channel() = default;
  explicit Channel(int socket) : socket_(socket) {}  // owns it from now on
  Channel(Channel&& other) noexcept { *this = std::move(other); }
  Channel& operator=(Channel&& other) noexcept;
  ~Channel() { abandon(); }

  // Two ends that are connected with each other.
  static Result<std::pair<Channel, Channel>> make_pair();

  bool is_open() const { return socket_ >= 0; }
  // Ends the connection for both, also where another process has inherited this end.
  void close();

  // Forgets this end, which another process goes on using.
  void abandon();

  // Sends whole messages (their bytes). While the other side does not take them, what it sends is taken in and kept,
  // so that two sides that both send never wait for each other.
  Result<void> send(std::span<const std::byte> messages);
  // Waits for the next message. Its payload is good until the next receive. An error of code not_found where the other
  // side has gone, and nothing is left.
  Result<Message> receive();

 private:
  Result<void> take_in();  // what is there, at least one byte

  int socket_ = -1;
  Bytes in_;
  std::size_t begin_ = 0;  // of what is not yet handed out
};

}  // namespace oriel
