// A growable column of trivially copyable values of one size that is known at run time.
#pragma once
#include <cstddef>
#include <cstring>
#include <vector>

namespace oriel {

class ByteColumn {
 public:
  explicit ByteColumn(std::size_t stride = 0) : stride_(stride) {}

  std::size_t stride() const { return stride_; }
  std::size_t size() const { return stride_ == 0 ? 0 : bytes_.size() / stride_; }
  std::byte* data() { return bytes_.data(); }
  const std::byte* data() const { return bytes_.data(); }
  std::byte* at(std::size_t i) { return bytes_.data() + i * stride_; }
  const std::byte* at(std::size_t i) const { return bytes_.data() + i * stride_; }
  void push_back(const void* value);
  void set(std::size_t i, const void* value) { std::memcpy(at(i), value, stride_); }
  void move(std::size_t from, std::size_t to) { std::memcpy(at(to), at(from), stride_); }
  void resize(std::size_t n);
  // At least; grows by doubling, so that one by one stays linear.
  std::size_t capacity() const { return stride_ == 0 ? 0 : bytes_.capacity() / stride_; }
  void reserve(std::size_t n);
  void clear() { bytes_.clear(); }

 private:
  std::size_t stride_;
  std::vector<std::byte> bytes_;  // operator new aligns to 16; no stored type asks for more (checked where types enter)
};

}  // namespace oriel
