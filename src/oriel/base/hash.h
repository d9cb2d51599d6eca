// A 64-bit hash of bytes, the same in every program and on every run: fingerprints of graphs, checksums of records.
// It finds damage and differences; it is no defence against someone who looks for collisions.
#pragma once
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace oriel {

class Hash {
 public:
  // Words are mixed with the finalizer of splitmix64 (G. Steele, D. Lea, C. Flood, "Fast splittable pseudorandom number
  // generators", OOPSLA 2014), each after the one before, so that order counts.
  void word(std::uint64_t w) {
    std::uint64_t z = (state_ ^ w) + 0x9e3779b97f4a7c15ull;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    state_ = z ^ (z >> 31);
  }
  // The bytes and how many they are.
  void bytes(const void* data, std::size_t size) {
    const auto* p = static_cast<const unsigned char*>(data);
    word(size);
    for (; size >= 8; p += 8, size -= 8) {
      std::uint64_t w;
      std::memcpy(&w, p, 8);
      word(w);
    }
    if (size == 0) return;
    std::uint64_t rest = 0;
    std::memcpy(&rest, p, size);
    word(rest);
  }
  std::uint64_t value() const { return state_; }

 private:
  std::uint64_t state_ = 0x6f7269656c000001ull;
};

inline std::uint64_t hash_of(const void* data, std::size_t size) {
  Hash h;
  h.bytes(data, size);
  return h.value();
}

}  // namespace oriel
