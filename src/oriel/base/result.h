// Result<T>: a value, or an Error that says which file, which line, which item, and what was expected.
// Bad input is answered with it; nothing in the library throws for bad input.
#pragma once
#include <cstdint>
#include <optional>
#include <ostream>
#include <string>
#include <utility>

namespace oriel {

enum class ErrorCode {
  bad_input,      // a file, a line, a setting is not what was expected
  not_found,      // a file or a name that does not exist
  stale_id,       // an id that was erased, or that never was
  duplicate,      // the same id twice in one edit
  not_finite,     // a NaN or an infinity in a value or a measurement
  indefinite,     // information or covariance with a negative eigenvalue
  size_mismatch,  // a vector, matrix or message of the wrong size
  singular,       // a block that has no inverse where one is needed
  conflict,       // an edit that names another version of the graph than the one it meets
  io,             // the operating system refused to read or write
};

struct Error {
  ErrorCode code = ErrorCode::bad_input;
  std::string message;    // what was expected and what was there, one line
  std::string file = {};  // empty where the input is not a file
  std::int64_t line = 0;  // from 1; 0 where there is none

  std::string text() const;  // "file:line: message"
};

std::ostream& operator<<(std::ostream& out, const Error& e);

namespace detail {
[[noreturn]] void value_of_error(const Error& error);
[[noreturn]] void error_of_value();
}  // namespace detail

template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : value_(std::move(value)) {}      // NOLINT(google-explicit-constructor): `return value;`
  Result(Error error) : error_(std::move(error)) {}  // NOLINT(google-explicit-constructor): `return Error{...};`

  bool ok() const { return value_.has_value(); }
  explicit operator bool() const { return ok(); }
  const Error& error() const {
    if (ok()) [[unlikely]]
      detail::error_of_value();
    return error_;
  }
  T& value() & { return get(); }
  const T& value() const& { return const_cast<Result*>(this)->get(); }
  T&& value() && { return std::move(get()); }
  T& operator*() & { return get(); }
  const T& operator*() const& { return value(); }
  T&& operator*() && { return std::move(get()); }
  T* operator->() { return &get(); }
  const T* operator->() const { return &value(); }

 private:
  T& get() {
    if (!ok()) [[unlikely]]
      detail::value_of_error(error_);
    return *value_;
  }
  // Not a std::variant: its visitors would be compiled in every program that includes this.
  std::optional<T> value_;
  Error error_;
};

// The value, or the error: for printing what came back.
template <class T>
std::ostream& operator<<(std::ostream& out, const Result<T>& r) {
  if (r.ok()) return out << r.value();
  return out << r.error();
}

template <>
class [[nodiscard]] Result<void> {
 public:
  Result() = default;
  Result(Error error) : error_(std::move(error)), ok_(false) {}  // NOLINT(google-explicit-constructor)
  bool ok() const { return ok_; }
  explicit operator bool() const { return ok_; }
  const Error& error() const {
    if (ok_) [[unlikely]]
      detail::error_of_value();
    return error_;
  }

 private:
  Error error_;
  bool ok_ = true;
};

}  // namespace oriel
