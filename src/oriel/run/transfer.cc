#include "oriel/run/transfer.h"

namespace oriel {

void TransferWriter::put_plain(const void* data, std::size_t size, std::size_t alignment) {
  out_.resize((out_.size() + alignment - 1) / alignment * alignment);
  const auto* const first = static_cast<const std::byte*>(data);
  out_.insert(out_.end(), first, first + size);  // resize would write zeros first
}

const std::byte* TransferReader::get_plain(std::uint64_t n, std::size_t size, std::size_t alignment) {
  const std::size_t at = (at_ + alignment - 1) / alignment * alignment;
  if (!ok_ || at > in_.size() || n > (in_.size() - at) / size) {
    ok_ = false;
    return nullptr;
  }
  at_ = at + n * size;
  return in_.data() + at;
}

namespace transfer_detail {

void finish(Bytes& out, std::uint64_t layout) {
  TransferHeader header;
  header.layout = layout;
  header.size = out.size() - sizeof(header);
  std::memcpy(out.data(), &header, sizeof(header));
}

Result<void> read_transfer_header(std::span<const std::byte> message, std::uint64_t layout) {
  TransferHeader header;
  if (message.size() < sizeof(header))
    return Error{ErrorCode::size_mismatch,
                 "a transferred value: expected 32 bytes of header, found " + std::to_string(message.size())};
  std::memcpy(&header, message.data(), sizeof(header));
  if (header.magic != TransferHeader::kMagic)
    return Error{ErrorCode::bad_input, "a transferred value: expected 'ORT1' at its beginning"};
  if (header.version != TransferHeader::kVersion)
    return Error{ErrorCode::bad_input, "a transferred value: expected version " +
                                           std::to_string(TransferHeader::kVersion) + ", found " +
                                           std::to_string(header.version)};
  if (header.layout != layout)
    return Error{ErrorCode::bad_input, "a transferred value: of another type than is expected here"};
  if (header.size != message.size() - sizeof(header))
    return Error{ErrorCode::size_mismatch, "a transferred value: expected " + std::to_string(header.size) +
                                               " bytes, found " + std::to_string(message.size() - sizeof(header))};
  if (reinterpret_cast<std::uintptr_t>(message.data()) % 16 != 0)
    return Error{ErrorCode::bad_input, "a transferred value: expected to be aligned to 16 bytes"};
  return {};
}

Error wrong_contents() {
  return {ErrorCode::size_mismatch, "a transferred value: its counts and its size do not fit each other"};
}

}  // namespace transfer_detail
}  // namespace oriel
