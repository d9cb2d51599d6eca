#include "oriel/linear/aligned_buffer.h"

#include <algorithm>
#include <cstddef>
#include <new>
#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace oriel {
namespace {
constexpr std::size_t kHugePage = std::size_t{1} << 21;

std::size_t alignment_of(std::size_t bytes) { return bytes >= kHugePage ? kHugePage : 64; }
}  // namespace

void AlignedBuffer::reserve(std::int64_t count) {
  if (count <= capacity_) return;
  // What has grown once will grow again: a window whose rows come to a new maximum now and then asks for memory seldom.
  if (capacity_ > 0) count = std::max(count, capacity_ + capacity_ / 4);
  release();
  const std::size_t bytes = (static_cast<std::size_t>(count) * sizeof(double) + 63) / 64 * 64;
  data_ = static_cast<double*>(::operator new(bytes, std::align_val_t(alignment_of(bytes))));
  capacity_ = count;
#if defined(__linux__)
  // Advice alone: where the kernel refuses, the memory is as good, its first touch slower.
  if (bytes >= kHugePage) (void)madvise(data_, bytes, MADV_HUGEPAGE);
#endif
}

void AlignedBuffer::release() {
  if (data_ == nullptr) return;
  const std::size_t bytes = (static_cast<std::size_t>(capacity_) * sizeof(double) + 63) / 64 * 64;
  ::operator delete(data_, std::align_val_t(alignment_of(bytes)));
  data_ = nullptr;
  capacity_ = 0;
}

}  // namespace oriel
