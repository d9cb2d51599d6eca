#include "oriel/run/packet_socket.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <utility>

#include "oriel/base/spin.h"

namespace oriel {
namespace {

constexpr std::size_t kMostInline = 4096;  // [bytes] of parts that go through the socket,
constexpr std::size_t kMostInARow = 1024;  // and of one that follows others
constexpr std::uint32_t kPassesDescriptor = 1u << 31, kForgetsMemory = 1u << 30;  // flags
constexpr std::uint32_t kNewMemory = 1, kKeptMemory = 2;                          // where the parts are, if not inline
#ifndef F_SEAL_FUTURE_WRITE                                                       // Linux 5.1
#define F_SEAL_FUTURE_WRITE 0x0010
#endif
constexpr int kSeals = F_SEAL_SEAL | F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_FUTURE_WRITE;
// Memory of which no packet of so many used more than a share is given back.
constexpr std::size_t kLeastUsed = 8;
constexpr int kPatience = 16;

Error refused(const char* what) { return {ErrorCode::io, std::string(what) + ": " + std::strerror(errno)}; }
Error gone() { return {ErrorCode::not_found, "the other side of a socket has gone"}; }
Error damaged(const char* what) { return {ErrorCode::bad_input, std::string("a packet: ") + what}; }

constexpr std::size_t padded(std::size_t size) { return (size + 15) / 16 * 16; }

class Deadline {
 public:
  explicit Deadline(Duration limit) : limited_(limit.ns > 0), end_(now() + limit.ns) {}
  // For poll: milliseconds rounded up, -1 for ever.
  int left_ms() const {
    if (!limited_) return -1;
    const std::int64_t left = end_ - now();
    return left <= 0 ? 0 : static_cast<int>(std::min<std::int64_t>((left + 999999) / 1000000, 1 << 30));
  }

 private:
  static std::int64_t now() { return std::chrono::steady_clock::now().time_since_epoch().count(); }
  bool limited_;
  std::int64_t end_;
};

}  // namespace

void OwnedFd::reset(int fd) {
  if (fd_ >= 0) ::close(fd_);
  fd_ = fd;
}

SharedMemory& SharedMemory::operator=(SharedMemory&& other) noexcept {
  if (this == &other) return *this;
  reset();
  data_ = std::exchange(other.data_, nullptr);
  size_ = std::exchange(other.size_, 0);
  return *this;
}

void SharedMemory::reset() {
  if (data_ != nullptr) ::munmap(data_, size_);
  data_ = nullptr;
  size_ = 0;
}

// Sealed while it is mapped: this mapping goes on being written, and no other can be.
Result<OwnedFd> SharedMemory::make(std::size_t size) {
  reset();
  OwnedFd fd(::memfd_create("oriel", MFD_CLOEXEC | MFD_ALLOW_SEALING));
  if (!fd) return refused("memfd_create");
  if (::ftruncate(fd.get(), static_cast<off_t>(size)) != 0) return refused("ftruncate");
  void* at = ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, fd.get(), 0);
  if (at == MAP_FAILED) return refused("mmap");
  data_ = static_cast<std::byte*>(at);
  size_ = size;
  if (::fcntl(fd.get(), F_ADD_SEALS, kSeals) == 0) return fd;
  const Error e = refused("fcntl(F_ADD_SEALS)");
  reset();
  return e;
}

Result<void> SharedMemory::open(const OwnedFd& fd, std::size_t least) {
  reset();
  struct stat s {};
  if (::fstat(fd.get(), &s) != 0 || static_cast<std::uint64_t>(s.st_size) < least) return damaged("too little memory");
  if ((::fcntl(fd.get(), F_GET_SEALS) & kSeals) != kSeals) return damaged("memory that is not sealed");
  const auto size = static_cast<std::size_t>(s.st_size);
  void* at = ::mmap(nullptr, size, PROT_READ, MAP_SHARED, fd.get(), 0);
  if (at == MAP_FAILED) return refused("mmap");
  data_ = static_cast<std::byte*>(at);
  size_ = size;
  return {};
}

Result<std::pair<PacketSocket, PacketSocket>> PacketSocket::make_pair() {
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0) return refused("socketpair");
  return std::pair(PacketSocket(OwnedFd(ends[0])), PacketSocket(OwnedFd(ends[1])));
}

// Into memory that the other side has, or into new; then with its descriptor. A quarter more than is needed: messages
// of about one size, one after the other, find room.
Result<OwnedFd> PacketSocket::write_parts(const std::array<std::span<const std::byte>, 3>& parts, std::size_t size) {
  OwnedFd fd;
  if (!answered_ || written_.size() < size) {
    auto made = written_.make((size + size / 4 + 4095) / 4096 * 4096);
    if (!made) return made;
    fd = std::move(*made);
  }
  std::byte* at = written_.data();
  for (const auto& part : parts) {
    if (!part.empty()) std::memcpy(at, part.data(), part.size());
    at += padded(part.size());
  }
  return fd;
}

Result<const std::byte*> PacketSocket::find_parts(const PacketHead& head, const OwnedFd& fd, std::size_t size) {
  if (head.in_memory == kNewMemory)
    if (auto ok = read_.open(fd, size); !ok) return ok.error();
  if (size == 0 || read_.size() < size) return damaged("memory that was not sent");
  return read_.data();
}

Result<void> PacketSocket::send(PacketHead head, std::array<std::span<const std::byte>, 3> parts, int passed) {
  if (!fd_) return gone();
  std::size_t size = 0;
  for (std::size_t i = 0; i < 3; ++i) head.sizes[i] = parts[i].size(), size += padded(parts[i].size());
  OwnedFd memory;
  too_large_ = size <= written_.size() / kLeastUsed ? too_large_ + 1 : 0;
  if (written_.size() > 0 && too_large_ >= kPatience) {
    written_.reset();
    too_large_ = 0;
    head.flags |= kForgetsMemory;
  }
  // A socket holds hundreds of small packets, and few of this size.
  const bool crowds = ++in_a_row_ > 2 && size > kMostInARow;
  if (size > kMostInline || crowds) {
    auto made = write_parts(parts, size);
    if (!made) return made.error();
    memory = std::move(*made);
    head.in_memory = memory ? kNewMemory : kKeptMemory;
    answered_ = false;
  }
  if (passed >= 0) head.flags |= kPassesDescriptor;

  static constexpr std::array<std::byte, 16> kPadding{};
  std::array<iovec, 7> pieces{};
  std::size_t n = 0;
  pieces[n++] = {&head, sizeof(head)};
  for (std::size_t i = 0; i < 3 && head.in_memory == 0; ++i) {
    pieces[n++] = {const_cast<std::byte*>(parts[i].data()), parts[i].size()};
    pieces[n++] = {const_cast<std::byte*>(kPadding.data()), padded(parts[i].size()) - parts[i].size()};
  }
  alignas(cmsghdr) std::array<char, CMSG_SPACE(2 * sizeof(int))> control{};
  msghdr message{};
  message.msg_iov = pieces.data();
  message.msg_iovlen = n;
  std::array<int, 2> fds{};
  std::size_t fd_count = 0;
  if (memory) fds[fd_count++] = memory.get();
  if (passed >= 0) fds[fd_count++] = passed;
  if (fd_count > 0) {
    message.msg_control = control.data();
    message.msg_controllen = CMSG_SPACE(fd_count * sizeof(int));
    cmsghdr* c = CMSG_FIRSTHDR(&message);
    c->cmsg_level = SOL_SOCKET;
    c->cmsg_type = SCM_RIGHTS;
    c->cmsg_len = CMSG_LEN(fd_count * sizeof(int));
    std::memcpy(CMSG_DATA(c), fds.data(), fd_count * sizeof(int));
  }
  for (;;) {
    if (::sendmsg(fd_.get(), &message, MSG_NOSIGNAL) >= 0) return {};
    if (errno == EINTR) continue;
    if (errno == EPIPE || errno == ECONNRESET) return gone();
    return refused("sendmsg");
  }
}

void PacketSocket::limit_sending(Duration limit) {
  const timeval t{limit.ns / 1'000'000'000, limit.ns % 1'000'000'000 / 1000};
  ::setsockopt(fd_.get(), SOL_SOCKET, SO_SNDTIMEO, &t, sizeof(t));
}

bool PacketSocket::has_news() const {
  pollfd p{fd_.get(), POLLIN, 0};
  return !fd_ || ::poll(&p, 1, 0) != 0;
}

void PacketSocket::look_for_news(const Look& look) const {
  if (look.after.ns > 0) {
    const timespec time{look.after.ns / 1'000'000'000, look.after.ns % 1'000'000'000};
    pollfd p{fd_.get(), POLLIN, 0};
    if (::ppoll(&p, 1, &time, nullptr) > 0) return;
  }
  constexpr Pace kPace{4, 32};  // a look is a system call, and whoever is waited for may be on this core
  if (look.time.ns > 0) spin_until(std::chrono::nanoseconds(look.time.ns), kPace, [this] { return has_news(); });
}

Result<PacketSocket::Got> PacketSocket::receive(Packet& out, Duration limit, const Look& look) {
  out.passed.reset();
  out.parts = {};
  if (!fd_) return Got::gone;
  const Deadline deadline(limit);
  look_for_news(limit.ns > 0 ? look.within(limit) : look);
  out.inline_.resize(sizeof(PacketHead) + kMostInline);
  alignas(cmsghdr) std::array<char, CMSG_SPACE(2 * sizeof(int))> control{};
  msghdr message{};
  iovec piece{out.inline_.data(), out.inline_.size()};
  ssize_t n = 0;
  for (bool again = true; again;) {
    pollfd p{fd_.get(), POLLIN, 0};
    const int ready = ::poll(&p, 1, deadline.left_ms());
    if (ready == 0) return Got::timeout;
    if (ready < 0 && errno != EINTR) return refused("poll");
    if (ready < 0) continue;
    message = {};
    message.msg_iov = &piece;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    n = ::recvmsg(fd_.get(), &message, MSG_CMSG_CLOEXEC | MSG_DONTWAIT);
    // Where the other side went without reading what it was sent, that is said once, before what it had sent itself.
    again = n < 0 && (errno == EINTR || errno == EAGAIN || errno == ECONNRESET);
  }
  if (n == 0) return Got::gone;
  if (n < 0) return refused("recvmsg");

  std::array<OwnedFd, 2> fds;
  std::size_t fd_count = 0;
  for (cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr; c = CMSG_NXTHDR(&message, c)) {
    if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_RIGHTS) continue;
    const std::size_t count = (c->cmsg_len - CMSG_LEN(0)) / sizeof(int);
    for (std::size_t i = 0; i < count && fd_count < fds.size(); ++i) {
      int fd = -1;
      std::memcpy(&fd, CMSG_DATA(c) + i * sizeof(int), sizeof(int));
      fds[fd_count++].reset(fd);
    }
  }
  const auto got = static_cast<std::size_t>(n);
  if (got < sizeof(PacketHead)) return damaged("cut short");
  std::memcpy(&out.head, out.inline_.data(), sizeof(PacketHead));
  const PacketHead& head = out.head;
  if (head.magic != PacketHead::kMagic || head.version != PacketHead::kVersion) return damaged("of another version");
  std::size_t size = 0;
  for (const std::uint64_t s : head.sizes) {
    if (s > (std::uint64_t{1} << 46)) return damaged("a size that cannot be");
    size += padded(s);
  }
  const std::size_t expected_fds =
      (head.in_memory == kNewMemory ? 1 : 0) + ((head.flags & kPassesDescriptor) != 0 ? 1 : 0);
  if (fd_count != expected_fds || head.in_memory > kKeptMemory) return damaged("a descriptor is missing");
  answered_ = true;
  in_a_row_ = 0;
  if ((head.flags & kForgetsMemory) != 0) read_.reset();
  const std::byte* begin = out.inline_.data() + sizeof(PacketHead);
  if (head.in_memory != 0) {
    const auto found = find_parts(head, fds[0], size);
    if (!found) return found.error();
    begin = *found;
  } else if (got != sizeof(PacketHead) + size) {
    return damaged("of another size than it says");
  }
  for (std::size_t i = 0; i < 3; ++i) {
    out.parts[i] = {begin, head.sizes[i]};
    begin += padded(head.sizes[i]);
  }
  if ((head.flags & kPassesDescriptor) != 0) out.passed = std::move(fds[fd_count - 1]);
  return Got::packet;
}

}  // namespace oriel
