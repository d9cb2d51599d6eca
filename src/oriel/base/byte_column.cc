#include "oriel/base/byte_column.h"

namespace oriel {

void ByteColumn::push_back(const void* value) {
  const auto* p = static_cast<const std::byte*>(value);
  bytes_.insert(bytes_.end(), p, p + stride_);
}

// The first time with room for an eighth more, so that what grows a little does not move at once.
void ByteColumn::resize(std::size_t n) {
  const std::size_t bytes = n * stride_, more = bytes + bytes / 8;
  if (bytes > bytes_.capacity()) bytes_.reserve(more > 2 * bytes_.size() ? more : 2 * bytes_.size());
  bytes_.resize(bytes);
}

void ByteColumn::reserve(std::size_t n) {
  if (n * stride_ > bytes_.capacity())
    bytes_.reserve(n * stride_ > 2 * bytes_.capacity() ? n * stride_ : 2 * bytes_.capacity());
}

}  // namespace oriel
