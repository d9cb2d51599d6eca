#include "oriel/io/text.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>

namespace oriel {
namespace {

std::string system_error() { return std::strerror(errno); }

// Closes on every way out.
struct Descriptor {
  int fd;
  explicit Descriptor(int f) : fd(f) {}
  ~Descriptor() {
    if (fd >= 0) ::close(fd);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
};

bool is_word_start(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }

std::string_view trimmed(std::string_view s) {
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!s.empty() && blank(s.front())) s.remove_prefix(1);
  while (!s.empty() && blank(s.back())) s.remove_suffix(1);
  return s;
}

// std::from_chars answers "out of range" for 1e-400 as for 1e400; the first is zero, as strtod has it.
bool underflows(std::string_view token) {
  const std::size_t e = token.find_first_of("eE");
  if (e != std::string_view::npos) return e + 1 < token.size() && token[e + 1] == '-';
  return token.find_first_not_of("+-0") < token.size() && token[token.find_first_not_of("+-0")] == '.';
}

template <class T>
NumberFault classify(std::errc code, bool whole, std::string_view token, T& out) {
  if (token.empty()) return NumberFault::missing;
  if (code == std::errc::invalid_argument || !whole) return NumberFault::not_a_number;
  if (code != std::errc::result_out_of_range) return NumberFault::none;
  if constexpr (std::is_floating_point_v<T>) {
    if (underflows(token)) {
      out = token.front() == '-' ? -0.0 : 0.0;
      return NumberFault::none;
    }
  }
  return NumberFault::overflow;
}

template <class T>
NumberFault parse_token(std::string_view token, T& out) {
  const char* first = token.data();
  const char* last = first + token.size();
  if (token.size() > 1 && *first == '+' && first[1] != '-') ++first;
  const auto [end, code] = std::from_chars(first, last, out);
  const NumberFault fault = classify(code, end == last, token, out);
  if constexpr (std::is_floating_point_v<T>)
    if (fault == NumberFault::none && !std::isfinite(out)) return NumberFault::not_finite;
  return fault;
}

Result<void> write_all(int fd, const std::string& path, std::string_view text) {
  while (!text.empty()) {
    const ssize_t n = ::write(fd, text.data(), text.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return Error{ErrorCode::io, "cannot be written: " + system_error(), path};
    text.remove_prefix(static_cast<std::size_t>(n));
  }
  return {};
}

}  // namespace

Result<std::string> read_text_file(const std::string& path) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (file.fd < 0) {
    const ErrorCode code = errno == ENOENT ? ErrorCode::not_found : ErrorCode::io;
    return Error{code, "cannot be opened: " + system_error(), path};
  }
  struct stat info;
  if (::fstat(file.fd, &info) != 0) return Error{ErrorCode::io, "cannot be read: " + system_error(), path};
  if (S_ISDIR(info.st_mode)) return Error{ErrorCode::io, "expected a file, found a directory", path};
  std::string data;
  // One byte more than the size, so that a regular file needs no second growth to see its end.
  data.resize(S_ISREG(info.st_mode) ? static_cast<std::size_t>(info.st_size) + 1 : 65536);
  std::size_t size = 0;
  for (;;) {
    if (size == data.size()) data.resize(2 * size);
    const ssize_t n = ::read(file.fd, data.data() + size, data.size() - size);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return Error{ErrorCode::io, "cannot be read: " + system_error(), path};
    if (n == 0) break;
    size += static_cast<std::size_t>(n);
  }
  data.resize(size);
  return data;
}

Result<void> write_text_file(const std::string& path, std::string_view text) {
  struct stat info;
  const bool exists = ::stat(path.c_str(), &info) == 0;
  if (exists && S_ISDIR(info.st_mode)) return Error{ErrorCode::io, "expected a file to write, found a directory", path};
  const bool in_place = exists && !S_ISREG(info.st_mode);
  const std::string target = in_place ? path : path + ".partial-" + std::to_string(::getpid());
  const int flags = O_WRONLY | O_CLOEXEC | (in_place ? 0 : O_CREAT | O_TRUNC);
  Result<void> done;
  {
    const Descriptor file(::open(target.c_str(), flags, 0644));
    if (file.fd < 0) return Error{ErrorCode::io, "cannot be written: " + system_error(), path};
    done = write_all(file.fd, path, text);
  }
  if (done && !in_place && std::rename(target.c_str(), path.c_str()) != 0)
    done = Error{ErrorCode::io, "cannot be written: " + system_error(), path};
  if (!done && !in_place) ::unlink(target.c_str());
  return done;
}

std::string quote_token(std::string_view token) {
  constexpr std::size_t kMost = 24;
  std::string text = "'";
  for (char c : token.substr(0, kMost)) text += c >= ' ' && c <= '~' ? c : '?';
  return text + (token.size() > kMost ? "...'" : "'");
}

NumberFault parse_number(std::string_view token, double& out) { return parse_token(token, out); }
NumberFault parse_integer(std::string_view token, std::int64_t& out) { return parse_token(token, out); }

std::string describe_number(NumberFault fault, std::string_view kind, std::string_view field, std::string_view token) {
  std::string text = "expected " + std::string(kind) + " for " + std::string(field) + ", found ";
  if (fault == NumberFault::missing) return text + "the end of the line";
  if (fault == NumberFault::overflow) return text + quote_token(token) + ", which is out of range";
  return text + quote_token(token);
}

void append_number(std::string& out, double value) {
  char buffer[32];
  const auto [end, code] = std::to_chars(buffer, buffer + sizeof buffer, value);
  out.append(buffer, end);
}

void append_number(std::string& out, std::int64_t value) {
  char buffer[24];
  const auto [end, code] = std::to_chars(buffer, buffer + sizeof buffer, value);
  out.append(buffer, end);
}

TextScanner::TextScanner(std::string_view text)
    : p_(text.data()), line_end_(text.data()), end_(text.data() + text.size()) {
  if (text.substr(0, 3) == "\xEF\xBB\xBF") p_ += 3, line_end_ += 3;  // the mark that some editors put before UTF-8
}

bool TextScanner::next_line() {
  while (line_ == 0 || line_end_ < end_) {
    p_ = line_ == 0 ? p_ : line_end_ + 1;
    if (p_ == end_) {
      line_end_ = end_;
      return false;
    }
    const void* newline = std::memchr(p_, '\n', static_cast<std::size_t>(end_ - p_));
    line_end_ = newline != nullptr ? static_cast<const char*>(newline) : end_;
    ++line_;
    if (!at_end_of_line()) return true;
  }
  return false;
}

bool TextScanner::at_end_of_line() {
  skip_blanks();
  return p_ == line_end_ || *p_ == '#';
}

std::string_view TextScanner::token() {
  if (at_end_of_line()) return {};
  const char* first = p_;
  while (!ends_token(p_)) ++p_;
  return {first, static_cast<std::size_t>(p_ - first)};
}

// At the 'e' of a number; adds what follows to `power` and steps over it. Two digits at least stand there in every
// file.
bool TextScanner::scan_exponent(const char*& p, int& power) const {
  if (line_end_ - p < 4 || (p[1] != '+' && p[1] != '-')) return false;
  const bool down = p[1] == '-';
  int exponent = 0, count = 0;
  for (p += 2; p != line_end_ && *p >= '0' && *p <= '9' && count < 4; ++p, ++count)
    exponent = 10 * exponent + (*p - '0');
  power += down ? -exponent : exponent;
  return count > 0;
}

// Up to 15 digits and a power of ten up to 22 are exact doubles, so that one division or product of them is the nearest
// double (Clinger, How to read floating point numbers accurately, PLDI 1990). Anything else is left to from_chars.
bool TextScanner::scan_short(double& out) {
  static constexpr double kPower[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                                      1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
  const char* p = p_;
  const bool negative = p != line_end_ && *p == '-';
  p += negative;
  std::uint64_t digits = 0;
  const auto take = [&] {
    const char* first = p;
    for (; p != line_end_ && *p >= '0' && *p <= '9'; ++p) digits = 10 * digits + static_cast<std::uint64_t>(*p - '0');
    return static_cast<int>(p - first < 100 ? p - first : 100);
  };
  const int whole = take();
  int decimals = 0;
  if (p != line_end_ && *p == '.') ++p, decimals = take();
  if (whole + decimals == 0 || whole + decimals > 15) return false;
  int power = -decimals;
  if (p != line_end_ && (*p == 'e' || *p == 'E') && !scan_exponent(p, power)) return false;
  if (power < -22 || power > 22 || !ends_token(p)) return false;
  const auto exact = static_cast<double>(digits);
  const double value = power < 0 ? exact / kPower[-power] : exact * kPower[power];
  out = negative ? -value : value;
  p_ = p;
  return true;
}

template <class T>
NumberFault TextScanner::scan(T& out) {
  skip_blanks();
  if constexpr (std::is_floating_point_v<T>)
    if (scan_short(out)) return NumberFault::none;
  const auto [end, code] = std::from_chars(p_, line_end_, out);
  if (code == std::errc() && ends_token(end)) [[likely]] {
    if constexpr (std::is_floating_point_v<T>)
      if (!std::isfinite(out)) return NumberFault::not_finite;
    p_ = end;
    return NumberFault::none;
  }
  const char* first = p_;  // the slow way knows '+', what is too small, and what is wrong
  const std::string_view text = token();
  const NumberFault fault = parse_token(text, out);
  if (fault != NumberFault::none) p_ = first;
  return fault;
}

NumberFault TextScanner::number(double& out) { return scan(out); }
NumberFault TextScanner::integer(std::int64_t& out) { return scan(out); }

int TextScanner::numbers(double* out, int count, NumberFault& fault) {
  fault = NumberFault::none;
  for (int i = 0; i < count; ++i)
    if (fault = scan(out[i]); fault != NumberFault::none) return i;
  return count;
}

int split_fields(std::string_view line, std::string_view* fields, int capacity) {
  int count = 0;
  for (;;) {
    const std::size_t comma = line.find(',');
    if (count < capacity) fields[count] = trimmed(line.substr(0, comma));
    ++count;
    if (comma == std::string_view::npos) return count;
    line.remove_prefix(comma + 1);
  }
}

TableScanner::TableScanner(std::string_view text) : rest_(text) {
  if (text.substr(0, 3) == "\xEF\xBB\xBF") rest_.remove_prefix(3);
}

bool TableScanner::next_row(std::string_view& row) {
  while (!rest_.empty()) {
    const std::size_t newline = rest_.find('\n');
    row = trimmed(rest_.substr(0, newline));
    rest_.remove_prefix(newline == std::string_view::npos ? rest_.size() : newline + 1);
    ++line_;
    if (row.empty() || row.front() == '#') continue;
    const bool header =
        header_allowed_ && is_word_start(row.front()) && row.substr(0, 3) != "nan" && row.substr(0, 3) != "inf";
    header_allowed_ = false;
    if (!header) return true;
  }
  return false;
}

}  // namespace oriel
