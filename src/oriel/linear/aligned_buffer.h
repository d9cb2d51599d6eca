// A buffer of doubles that only grows: 64-byte aligned for the vector kernels, and on huge pages where it is large
// (a first factorization would otherwise spend more time in page faults than in arithmetic).
#pragma once
#include <cstdint>

namespace oriel {

class AlignedBuffer {
 public:
  AlignedBuffer() = default;
  AlignedBuffer(AlignedBuffer&& other) noexcept : data_(other.data_), capacity_(other.capacity_) {
    other.data_ = nullptr;
    other.capacity_ = 0;
  }
  AlignedBuffer& operator=(AlignedBuffer&& other) noexcept {
    if (this != &other) {
      release();
      data_ = other.data_, capacity_ = other.capacity_;
      other.data_ = nullptr, other.capacity_ = 0;
    }
    return *this;
  }
  ~AlignedBuffer() { release(); }

  // Makes room for `count` doubles. What was in the buffer is lost where it grows; new memory holds anything.
  void reserve(std::int64_t count);
  double* data() { return data_; }
  const double* data() const { return data_; }
  std::int64_t capacity() const { return capacity_; }

 private:
  void release();
  double* data_ = nullptr;
  std::int64_t capacity_ = 0;  // [doubles]
};

}  // namespace oriel
