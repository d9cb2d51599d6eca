#include "oriel/run/channel.h"

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

namespace oriel {
namespace {

Error refused(const char* what) { return {ErrorCode::io, std::string(what) + ": " + std::strerror(errno)}; }

}  // namespace

Channel& Channel::operator=(Channel&& other) noexcept {
  if (this != &other) {
    abandon();
    socket_ = std::exchange(other.socket_, -1);
    in_ = std::move(other.in_);
    begin_ = std::exchange(other.begin_, 0);
  }
  return *this;
}

Result<std::pair<Channel, Channel>> Channel::make_pair() {
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) return refused("socketpair");
  return std::pair<Channel, Channel>(Channel(ends[0]), Channel(ends[1]));
}

void Channel::close() {
  if (socket_ < 0) return;
  ::shutdown(socket_, SHUT_RDWR);
  ::close(socket_);
  socket_ = -1;
}

void Channel::abandon() {
  if (socket_ >= 0) ::close(socket_);
  socket_ = -1;
}

Result<void> Channel::send(std::span<const std::byte> messages) {
  // poll() would wait for ever on a socket that is not there.
  if (socket_ < 0) return Error{ErrorCode::io, "send: the channel is closed"};
  while (!messages.empty()) {
    pollfd p{socket_, POLLIN | POLLOUT, 0};
    if (::poll(&p, 1, -1) < 0) {
      if (errno == EINTR) continue;
      return refused("poll");
    }
    if (p.revents & POLLOUT) {
      const ssize_t n = ::send(socket_, messages.data(), messages.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
      if (n > 0) messages = messages.subspan(static_cast<std::size_t>(n));
      if (n < 0 && errno != EAGAIN && errno != EINTR) return refused("send");
    } else if (p.revents & (POLLIN | POLLHUP | POLLERR)) {
      if (auto ok = take_in(); !ok) return ok;
    } else {
      return Error{ErrorCode::io, "send: the channel is closed"};
    }
  }
  return {};
}

Result<void> Channel::take_in() {
  std::array<std::byte, 65536> chunk;
  for (;;) {
    const ssize_t n = ::recv(socket_, chunk.data(), chunk.size(), 0);
    if (n > 0) {
      in_.insert(in_.end(), chunk.data(), chunk.data() + n);
      return {};
    }
    if (n == 0 || errno == ECONNRESET) return Error{ErrorCode::not_found, "the other side of a channel has gone"};
    if (errno != EINTR) return refused("recv");
  }
}

Result<Message> Channel::receive() {
  in_.erase(in_.begin(), in_.begin() + static_cast<std::ptrdiff_t>(begin_));
  begin_ = 0;
  while (in_.size() < Message::kHeaderBytes)
    if (auto ok = take_in(); !ok) return ok.error();
  auto header = read_header(std::span(in_).first(Message::kHeaderBytes));
  if (!header) return header.error();
  while (in_.size() - Message::kHeaderBytes < header->size)  // memory grows with what arrives, not with what is said
    if (auto ok = take_in(); !ok) return ok.error();
  begin_ = Message::kHeaderBytes + header->size;
  return read_payload(*header, std::span(in_).subspan(Message::kHeaderBytes, header->size));
}

}  // namespace oriel
