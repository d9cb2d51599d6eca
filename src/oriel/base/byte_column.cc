#include "oriel/base/byte_column.h"

namespace oriel {

void ByteColumn::push_back(const void* value) {
  const auto* p = static_cast<const std::byte*>(value);
  bytes_.insert(bytes_.end(), p, p + stride_);
}

void ByteColumn::resize(std::size_t n) { bytes_.resize(n * stride_); }

void ByteColumn::reserve(std::size_t n) {
  if (n * stride_ > bytes_.capacity())
    bytes_.reserve(n * stride_ > 2 * bytes_.capacity() ? n * stride_ : 2 * bytes_.capacity());
}

}  // namespace oriel
