// Writing and reading plain values one after the other, as messages and journals hold them: little-endian, no padding.
// A reader never goes past its end: from the first thing that is not there it answers zeros and says so in ok().
#pragma once
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <type_traits>
#include <vector>

namespace oriel {

static_assert(std::endian::native == std::endian::little, "messages and journals are little-endian");

using Bytes = std::vector<std::byte>;

class ByteWriter {
 public:
  explicit ByteWriter(Bytes& out) : out_(out) {}

  template <class T>
  requires(std::is_arithmetic_v<T> || std::is_enum_v<T>) void put(T x) { put_bytes(&x, sizeof(T)); }
  void put_bytes(const void* data, std::size_t size);
  void put_text(std::string_view text) {
    put(static_cast<std::uint32_t>(text.size()));
    put_bytes(text.data(), text.size());
  }
  template <class Container>
  void put_count(const Container& c) {
    put(static_cast<std::uint32_t>(c.size()));
  }

 private:
  Bytes& out_;
};

class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> in) : in_(in) {}

  bool ok() const { return ok_; }
  bool at_end() const { return ok_ && at_ == in_.size(); }
  std::size_t position() const { return at_; }
  std::size_t left() const { return in_.size() - at_; }

  template <class T>
  requires(std::is_arithmetic_v<T>) T get() {
    T x{};
    if (const std::byte* p = get_bytes(sizeof(T))) std::memcpy(&x, p, sizeof(T));
    return x;
  }
  // Null where so many are not left.
  const std::byte* get_bytes(std::size_t size) {
    if (!ok_ || size > left()) {
      ok_ = false;
      return nullptr;
    }
    const std::byte* p = in_.data() + at_;
    at_ += size;
    return p;
  }
  std::string_view get_text() {
    const std::uint32_t size = get<std::uint32_t>();
    const std::byte* p = get_bytes(size);
    return p == nullptr ? std::string_view() : std::string_view(reinterpret_cast<const char*>(p), size);
  }
  // A number of items of at least `least_bytes` each: never more than what is left could hold, so that a damaged count
  // asks for no memory.
  std::uint32_t get_count(std::size_t least_bytes) {
    const std::uint32_t n = get<std::uint32_t>();
    if (ok_ && n <= left() / (least_bytes == 0 ? 1 : least_bytes)) return n;
    ok_ = false;
    return 0;
  }

 private:
  std::span<const std::byte> in_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

}  // namespace oriel
