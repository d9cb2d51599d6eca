#include "oriel/io/problem_text.h"

#include <bzlib.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <utility>

namespace oriel {
namespace {

constexpr std::size_t kLeastGrowth = std::size_t{1} << 16;

struct Closed {
  int fd;
  ~Closed() { ::close(fd); }
};

enum class Step { more, end_of_stream, damaged };

// Both libraries count what is left of their input and output in 32 bits.
unsigned chunk(std::size_t bytes) {
  return static_cast<unsigned>(std::min<std::size_t>(bytes, std::numeric_limits<int>::max()));
}

class Gzip {
 public:
  static constexpr const char* kName = "gzip";
  Gzip() { ok_ = inflateInit2(&z_, 15 + 16) == Z_OK; }  // 15 + 16: the largest window, a gzip header
  ~Gzip() { inflateEnd(&z_); }
  Gzip(const Gzip&) = delete;
  Gzip& operator=(const Gzip&) = delete;
  bool ok() const { return ok_; }
  bool restart() { return inflateReset(&z_) == Z_OK; }
  Step step(std::string_view& in, char* out, std::size_t room, std::size_t& written) {
    z_.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(in.data()));
    z_.avail_in = chunk(in.size());
    z_.next_out = reinterpret_cast<Bytef*>(out);
    z_.avail_out = chunk(room);
    const unsigned had_in = z_.avail_in, had_out = z_.avail_out;
    const int code = inflate(&z_, Z_NO_FLUSH);
    in.remove_prefix(had_in - z_.avail_in);
    written = had_out - z_.avail_out;
    return code == Z_STREAM_END                  ? Step::end_of_stream
           : code == Z_OK || code == Z_BUF_ERROR ? Step::more
                                                 : Step::damaged;
  }

 private:
  z_stream z_{};
  bool ok_ = false;
};

class Bzip2 {
 public:
  static constexpr const char* kName = "bzip2";
  Bzip2() { ok_ = BZ2_bzDecompressInit(&z_, 0, 0) == BZ_OK; }
  ~Bzip2() { BZ2_bzDecompressEnd(&z_); }
  Bzip2(const Bzip2&) = delete;
  Bzip2& operator=(const Bzip2&) = delete;
  bool ok() const { return ok_; }
  bool restart() {
    BZ2_bzDecompressEnd(&z_);
    z_ = {};
    return ok_ = BZ2_bzDecompressInit(&z_, 0, 0) == BZ_OK;
  }
  Step step(std::string_view& in, char* out, std::size_t room, std::size_t& written) {
    z_.next_in = const_cast<char*>(in.data());
    z_.avail_in = chunk(in.size());
    z_.next_out = out;
    z_.avail_out = chunk(room);
    const unsigned had_in = z_.avail_in, had_out = z_.avail_out;
    const int code = BZ2_bzDecompress(&z_);
    in.remove_prefix(had_in - z_.avail_in);
    written = had_out - z_.avail_out;
    return code == BZ_STREAM_END ? Step::end_of_stream : code == BZ_OK ? Step::more : Step::damaged;
  }

 private:
  bz_stream z_{};
  bool ok_ = false;
};

// Files may hold several streams one after the other; what follows the last must be one more.
template <class Codec>
Result<ProblemText> unpack_by(std::string_view in, const std::string& file_name) {
  const auto fault = [&](const char* found) {
    return Error{ErrorCode::bad_input, std::string("expected ") + Codec::kName + " data, found " + found, file_name};
  };
  Codec codec;
  ProblemText out;
  if (!codec.ok()) return Error{ErrorCode::io, std::string(Codec::kName) + " could not begin", file_name};
  out.grow(4 * in.size());
  for (;;) {
    char* to = out.grow(1);
    const std::size_t left = in.size();
    std::size_t written = 0;
    const Step step = codec.step(in, to, out.room(), written);
    out.advance(written);
    if (step == Step::damaged) return fault("damage");
    if (step == Step::end_of_stream) {
      if (in.empty()) return out;
      if (!codec.restart()) return fault("damage");
    } else if (written == 0 && left == in.size()) {
      return fault("an end too early");
    }
  }
}

}  // namespace

char* ProblemText::grow(std::size_t least) {
  if (room() < least) {
    const std::size_t capacity = std::max({size_ + least, 2 * capacity_, kLeastGrowth});
    std::unique_ptr<char[]> larger(new char[capacity]);  // not zeroed
    if (size_ > 0) std::memcpy(larger.get(), data_.get(), size_);
    data_ = std::move(larger);
    capacity_ = capacity;
  }
  return data_.get() + size_;
}

Result<ProblemText> unpack(ProblemText bytes, const std::string& file_name) {
  const std::string_view text = bytes.view();
  if (text.substr(0, 2) == "\x1f\x8b") return unpack_by<Gzip>(text, file_name);
  if (text.size() > 3 && text.substr(0, 3) == "BZh" && text[3] >= '1' && text[3] <= '9')
    return unpack_by<Bzip2>(text, file_name);
  return bytes;
}

Result<ProblemText> read_problem_text(const std::string& path) {
  const auto fault = [&](const char* what) {
    return Error{errno == ENOENT ? ErrorCode::not_found : ErrorCode::io, std::string(what) + std::strerror(errno),
                 path};
  };
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return fault("cannot be opened: ");
  const Closed closed{fd};
  struct stat info;
  if (::fstat(fd, &info) != 0) return fault("cannot be read: ");
  if (S_ISDIR(info.st_mode)) return Error{ErrorCode::io, "expected a file, found a directory", path};
  ProblemText bytes;
  // One byte more than the size, so that a regular file needs no second growth to see its end.
  bytes.grow(S_ISREG(info.st_mode) ? static_cast<std::size_t>(info.st_size) + 1 : kLeastGrowth);
  for (;;) {
    char* to = bytes.grow(1);
    const ssize_t n = ::read(fd, to, bytes.room());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return fault("cannot be read: ");
    if (n == 0) return unpack(std::move(bytes), path);
    bytes.advance(static_cast<std::size_t>(n));
  }
}

}  // namespace oriel
