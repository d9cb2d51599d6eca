// Packets between two processes, and the memory that large ones go through: kept from one to the next, and never
// written while it may still be read.
#include "oriel/run/packet_socket.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/socket.h>

#include <algorithm>
#include <cstring>
#include <random>

namespace oriel {
namespace {

constexpr std::size_t kLarge = 200'000;  // [bytes]

Bytes pattern(std::size_t size, unsigned seed) {
  Bytes out(size);
  for (std::size_t i = 0; i < size; ++i) out[i] = static_cast<std::byte>((i * 31 + seed * 17 + (i >> 8)) & 0xff);
  return out;
}
bool equal(std::span<const std::byte> a, const Bytes& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin());
}

class Sockets : public ::testing::Test {
 protected:
  Sockets() {
    auto ends = PacketSocket::make_pair();
    asks_ = std::move(ends->first), answers_ = std::move(ends->second);
  }
  // Both parts arrive at the other side; where the first begins there.
  const std::byte* pass(PacketSocket& from, PacketSocket& to, Packet& packet, std::size_t size, unsigned seed) {
    const Bytes a = pattern(size, seed), b = pattern(size / 3 + 1, seed + 1);
    EXPECT_TRUE(from.send({}, {a, b, {}}));
    const auto got = to.receive(packet);
    EXPECT_TRUE(got) << got.error();
    EXPECT_TRUE(equal(packet.parts[0], a)) << size;
    EXPECT_TRUE(equal(packet.parts[1], b)) << size;
    for (const auto& part : packet.parts) EXPECT_EQ(reinterpret_cast<std::uintptr_t>(part.data()) % 16, 0u);
    return packet.parts[0].data();
  }
  // A question, and an answer without parts.
  const std::byte* ask(std::size_t size, unsigned seed) {
    const std::byte* at = pass(asks_, answers_, question_, size, seed);
    Packet answer;
    EXPECT_TRUE(answers_.send({}));
    EXPECT_TRUE(asks_.receive(answer));
    return at;
  }
  // What comes of a head, and of a descriptor beside it, that no PacketSocket would send.
  Result<PacketSocket::Got> receive_raw(const PacketHead& head, std::size_t size, int passed) {
    iovec piece{const_cast<PacketHead*>(&head), size};
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
    msghdr message{};
    message.msg_iov = &piece;
    message.msg_iovlen = 1;
    if (passed >= 0) {
      message.msg_control = control.data();
      message.msg_controllen = control.size();
      cmsghdr* c = CMSG_FIRSTHDR(&message);
      c->cmsg_level = SOL_SOCKET;
      c->cmsg_type = SCM_RIGHTS;
      c->cmsg_len = CMSG_LEN(sizeof(int));
      std::memcpy(CMSG_DATA(c), &passed, sizeof(int));
    }
    EXPECT_EQ(::sendmsg(asks_.fd(), &message, 0), static_cast<ssize_t>(size));
    return answers_.receive(question_);
  }

  PacketSocket asks_, answers_;
  Packet question_;
};

// R4
TEST_F(Sockets, BringPartsOfAnySizeBothWays) {
  Packet answer;
  unsigned seed = 0;
  for (const std::size_t size : {0u, 1u, 1000u, 30'000u, 40'000u, 200'000u, 3'000'000u, 5u, 250'000u}) {
    pass(asks_, answers_, question_, size, ++seed);
    pass(answers_, asks_, answer, size + 7, ++seed);
  }
}

TEST_F(Sockets, KeepTheMemoryOfLargePacketsFromAnswerToAnswer) {
  const std::byte* first = ask(kLarge, 1);
  EXPECT_EQ(ask(kLarge, 2), first);
  ask(100, 3);  // through the socket
  EXPECT_EQ(ask(kLarge + 100, 4), first);
  EXPECT_EQ(ask(kLarge / 2, 5), first);
  ask(2 * kLarge, 6);
}

// R4: what was sent is not written while the other side may look at it.
TEST_F(Sockets, DoNotTouchWhatWasNotAnswered) {
  ask(kLarge, 1);
  const Bytes a = pattern(kLarge, 7), b = pattern(kLarge, 8), c = pattern(kLarge, 9);
  for (const Bytes& bytes : {a, b, c}) ASSERT_TRUE(asks_.send({}, {bytes, {}, {}}));
  for (const Bytes& bytes : {a, b, c}) {
    ASSERT_TRUE(answers_.receive(question_));
    EXPECT_TRUE(equal(question_.parts[0], bytes));
  }
}

TEST_F(Sockets, GiveMemoryBackThatIsNotNeededAnyMore) {
  const auto mapped = [] {
    std::FILE* maps = std::fopen("/proc/self/maps", "r");
    int n = 0;
    for (std::array<char, 4096> line; std::fgets(line.data(), line.size(), maps) != nullptr;)
      n += std::strstr(line.data(), "memfd:oriel") != nullptr ? 1 : 0;
    std::fclose(maps);
    return n;
  };
  const int before = mapped();
  ask(10 * kLarge, 1);
  EXPECT_EQ(mapped(), before + 2) << "one where it is written, one where it is read";
  for (unsigned k = 0; k < 10; ++k) ask(100, k);
  EXPECT_EQ(mapped(), before + 2);
  for (unsigned k = 0; k < 10; ++k) ask(100, k);
  EXPECT_EQ(mapped(), before);
  ask(10 * kLarge, 2);
  answers_.close();
  asks_.close();
  EXPECT_EQ(mapped(), before);
}

// R4
TEST_F(Sockets, NobodyButItsMakerWritesOrResizesTheMemory) {
  SharedMemory mine, theirs;
  const auto fd = mine.make(8192);
  ASSERT_TRUE(fd) << fd.error();
  ASSERT_TRUE(theirs.open(*fd, 8192));
  mine.data()[5000] = std::byte{42};
  EXPECT_EQ(theirs.data()[5000], std::byte{42});
  EXPECT_EQ(::mmap(nullptr, 8192, PROT_READ | PROT_WRITE, MAP_SHARED, fd->get(), 0), MAP_FAILED);
  EXPECT_NE(::ftruncate(fd->get(), 4096), 0);
  EXPECT_NE(::ftruncate(fd->get(), 16384), 0);
  const char byte = 1;
  EXPECT_LT(::pwrite(fd->get(), &byte, 1, 0), 0);
  EXPECT_FALSE(theirs.open(*fd, 8193)) << "it is smaller";
}

TEST_F(Sockets, AnswerWhatIsDamagedWithAnError) {
  PacketHead kept;
  kept.in_memory = 2;
  kept.sizes[0] = 4096;
  EXPECT_FALSE(receive_raw(kept, sizeof(kept), -1)) << "there is no memory yet";
  PacketHead made = kept;
  made.in_memory = 1;
  EXPECT_FALSE(receive_raw(made, sizeof(made), -1)) << "its descriptor is missing";
  const OwnedFd open(::memfd_create("unsealed", MFD_ALLOW_SEALING));
  ASSERT_EQ(::ftruncate(open.get(), 8192), 0);
  EXPECT_FALSE(receive_raw(made, sizeof(made), open.get())) << "anybody may write it";
  SharedMemory memory;
  const OwnedFd sealed = std::move(memory.make(4096).value());
  made.sizes[0] = 4097;
  EXPECT_FALSE(receive_raw(made, sizeof(made), sealed.get())) << "it is too small";
  made.sizes[0] = 4096;
  EXPECT_TRUE(receive_raw(made, sizeof(made), sealed.get()));
  EXPECT_TRUE(receive_raw(kept, sizeof(kept), -1));
  kept.sizes[1] = 1;
  EXPECT_FALSE(receive_raw(kept, sizeof(kept), -1)) << "more than the memory that was kept";
  kept.sizes[1] = 0;
  EXPECT_FALSE(receive_raw(kept, sizeof(kept) - 1, -1)) << "cut short";
  kept.in_memory = 3;
  EXPECT_FALSE(receive_raw(kept, sizeof(kept), -1));
}

// Any bits in a head: a packet or an error, and nothing is read that is not there.
TEST_F(Sockets, SurviveDamageAnywhereInAHead) {
  ask(kLarge, 1);
  std::mt19937 random(3);
  int packets = 0;
  for (int i = 0; i < 4000; ++i) {
    PacketHead head;
    head.in_memory = random() % 2 == 0 ? 0 : 2;
    head.sizes[0] = head.in_memory != 0 ? random() % (2 * kLarge) : 0;
    std::array<std::uint32_t, sizeof(PacketHead) / 4> words;
    std::memcpy(words.data(), &head, sizeof(head));
    if (i % 4 != 0) words[2 + random() % (words.size() - 2)] ^= 1u << (random() % 30);
    std::memcpy(static_cast<void*>(&head), words.data(), sizeof(head));
    if (!receive_raw(head, sizeof(head), -1)) continue;
    ++packets;
    std::byte all{};
    for (const auto& part : question_.parts)
      for (const std::byte b : part) all |= b;
    EXPECT_TRUE(all == std::byte{0} || head.in_memory == 2);
  }
  EXPECT_GT(packets, 500);
  EXPECT_LT(packets, 4000);
}

}  // namespace
}  // namespace oriel
