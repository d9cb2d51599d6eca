// Packets between two processes of one machine: a head and up to three parts, small ones through the socket, large ones
// in a sealed memfd that travels with it. A received part is aligned to 16 bytes and shares nothing with the sender:
// the seals forbid that anybody changes it.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "oriel/base/bytes.h"
#include "oriel/base/result.h"
#include "oriel/base/time.h"

namespace oriel {

struct PacketHead {
  static constexpr std::uint32_t kMagic = 0x3150524f;  // "ORP1"
  static constexpr std::uint16_t kVersion = 1;
  std::uint32_t magic = kMagic;
  std::uint16_t version = kVersion, kind = 0;
  std::uint64_t job = 0;
  std::int64_t value = 0;  // what the kind says
  std::uint32_t flags = 0, in_memory = 0;
  std::array<std::uint64_t, 3> sizes{};  // of the parts [bytes]
  std::uint64_t reserved = 0;
};
static_assert(sizeof(PacketHead) == 64);

// A file descriptor that is closed with its owner.
class OwnedFd {
 public:
  OwnedFd() = default;
  explicit OwnedFd(int fd) : fd_(fd) {}
  OwnedFd(OwnedFd&& other) noexcept : fd_(other.release()) {}
  OwnedFd& operator=(OwnedFd&& other) noexcept {
    if (this != &other) reset(other.release());
    return *this;
  }
  ~OwnedFd() { reset(); }
  int get() const { return fd_; }
  explicit operator bool() const { return fd_ >= 0; }
  int release() {
    const int fd = fd_;
    fd_ = -1;
    return fd;
  }
  void reset(int fd = -1);

 private:
  int fd_ = -1;
};

// What was received; its parts are good until it receives again.
class Packet {
 public:
  Packet() = default;
  Packet(const Packet&) = delete;
  Packet& operator=(const Packet&) = delete;
  ~Packet() { unmap(); }

  PacketHead head;
  std::array<std::span<const std::byte>, 3> parts;
  OwnedFd passed;  // a descriptor that came along

 private:
  friend class PacketSocket;
  void unmap();
  Bytes inline_;
  void* mapping_ = nullptr;
  std::size_t mapped_ = 0;
};

class PacketSocket {
 public:
  enum class Got { packet, gone, timeout };

  PacketSocket() = default;
  explicit PacketSocket(OwnedFd fd) : fd_(std::move(fd)) {}
  static Result<std::pair<PacketSocket, PacketSocket>> make_pair();

  bool is_open() const { return static_cast<bool>(fd_); }
  void close() { fd_.reset(); }
  OwnedFd take() { return std::move(fd_); }

  // ErrorCode::not_found where the other side has gone. `passed` is a descriptor to send along.
  Result<void> send(PacketHead head, std::array<std::span<const std::byte>, 3> parts = {}, int passed = -1);
  // Waits for a packet: for as long as it takes (limit 0), or so long. An error is a packet that is damaged.
  Result<Got> receive(Packet& out, Duration limit = {});
  // Whether receive would return at once.
  bool has_news() const;
  int fd() const { return fd_.get(); }

 private:
  OwnedFd fd_;
};

}  // namespace oriel
