// The text of a problem's file, unpacked where it is gzip or bzip2 (told by its first bytes, not by its name).
#pragma once
#include <cstddef>
#include <memory>
#include <string>
#include <string_view>

#include "oriel/base/result.h"

namespace oriel {

// Bytes that are written before they are read: a std::string would first fill a file's size with zeros.
class ProblemText {
 public:
  std::string_view view() const { return {data_.get(), size_}; }
  char* grow(std::size_t least);  // room for that many more bytes; room() of them are free
  std::size_t room() const { return capacity_ - size_; }
  void advance(std::size_t written) { size_ += written; }

 private:
  std::unique_ptr<char[]> data_;
  std::size_t size_ = 0, capacity_ = 0;
};

// A directory, an absent file, a refused read, packed data that are damaged or end too early: an Error that names the
// file.
Result<ProblemText> read_problem_text(const std::string& path);

// The text itself where it is not packed. Errors name `file_name`.
Result<ProblemText> unpack(ProblemText bytes, const std::string& file_name);

}  // namespace oriel
