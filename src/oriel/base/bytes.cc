#include "oriel/base/bytes.h"

namespace oriel {

void ByteWriter::put_bytes(const void* data, std::size_t size) {
  const auto* p = static_cast<const std::byte*>(data);
  out_.insert(out_.end(), p, p + size);
}

}  // namespace oriel
