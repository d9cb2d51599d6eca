// Packets between two processes of one machine: a head and up to three parts, small ones through the socket, large ones
// in a memfd that one side writes and the other reads. It travels with the first large packet and is kept for those
// that follow, once an answer says that the other side has done with what was sent; what comes before an answer has
// memory of its own. Its seals forbid that it changes its size, and that anybody but its maker writes. A received part
// is aligned to 16 bytes.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <utility>

#include "oriel/base/bytes.h"
#include "oriel/base/result.h"
#include "oriel/base/time.h"
#include "oriel/run/look.h"

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

// A mapping of memory that two processes share.
class SharedMemory {
 public:
  SharedMemory() = default;
  SharedMemory(SharedMemory&& other) noexcept { *this = std::move(other); }
  SharedMemory& operator=(SharedMemory&& other) noexcept;
  ~SharedMemory() { reset(); }

  // To be written here and nowhere else; the descriptor is for the other side.
  Result<OwnedFd> make(std::size_t size);
  // Of the other side's, to be read. An error where it is not sealed, or smaller than that.
  Result<void> open(const OwnedFd& fd, std::size_t least);
  void reset();
  std::byte* data() { return data_; }
  std::size_t size() const { return size_; }

 private:
  std::byte* data_ = nullptr;
  std::size_t size_ = 0;
};

// What was received; its parts are good until its socket receives or sends again, or is closed.
class Packet {
 public:
  PacketHead head;
  std::array<std::span<const std::byte>, 3> parts;
  OwnedFd passed;  // a descriptor that came along

 private:
  friend class PacketSocket;
  Bytes inline_;
};

class PacketSocket {
 public:
  enum class Got { packet, gone, timeout };

  PacketSocket() = default;
  explicit PacketSocket(OwnedFd fd) : fd_(std::move(fd)) {}
  static Result<std::pair<PacketSocket, PacketSocket>> make_pair();

  bool is_open() const { return static_cast<bool>(fd_); }
  void close() {
    fd_.reset();
    written_.reset();
    read_.reset();
  }
  OwnedFd take() { return std::move(fd_); }
  // A send that waits for room is refused after so long. 0: never.
  void limit_sending(Duration limit);

  // ErrorCode::not_found where the other side has gone. `passed` is a descriptor to send along.
  Result<void> send(PacketHead head, std::array<std::span<const std::byte>, 3> parts = {}, int passed = -1);
  // Waits for a packet: for as long as it takes (limit 0), or so long. An error is a packet that is damaged.
  Result<Got> receive(Packet& out, Duration limit = {}, const Look& look = {});
  // Whether receive would return at once.
  bool has_news() const;
  int fd() const { return fd_.get(); }

 private:
  Result<OwnedFd> write_parts(const std::array<std::span<const std::byte>, 3>& parts, std::size_t size);
  void look_for_news(const Look& look) const;
  Result<const std::byte*> find_parts(const PacketHead& head, const OwnedFd& fd, std::size_t size);

  OwnedFd fd_;
  SharedMemory written_, read_;  // of the last large packet each way
  bool answered_ = true;         // something came since the last large packet was sent
  int in_a_row_ = 0;             // packets sent since something came
  int too_large_ = 0;            // packets one after the other that left most of the memory unused
};

}  // namespace oriel
