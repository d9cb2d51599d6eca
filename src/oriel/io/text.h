// Text files: read whole, walked by line and token, numbers by std::from_chars (no locale, no allocation, exact).
// Every reader of this room stands on it, so that all of them say the same about the same fault.
#pragma once
#include <cstdint>
#include <string>
#include <string_view>

#include "oriel/base/result.h"

namespace oriel {

// The bytes of a file (or pipe). A directory, an absent file, a refused read: ErrorCode::io or not_found.
Result<std::string> read_text_file(const std::string& path);

// Writes beside the target and renames, so that a failure leaves no half file. A target which exists and is no regular
// file (a pipe, /dev/stdout) is written directly.
Result<void> write_text_file(const std::string& path, std::string_view text);

// A token for a message: printable ASCII, at most 24 characters, in quotes.
std::string quote_token(std::string_view token);

enum class NumberFault { none, missing, not_a_number, not_finite, overflow };

// The whole token must be one finite number. A leading '+' and exponents of any length are fine; what is too small for
// a double is zero.
NumberFault parse_number(std::string_view token, double& out);
NumberFault parse_integer(std::string_view token, std::int64_t& out);

// "a finite number for dx, found 'abc'": what goes after "expected ".
std::string describe_number(NumberFault fault, std::string_view kind, std::string_view field, std::string_view token);

// The shortest decimal that reads back to the same bits.
void append_number(std::string& out, double value);
void append_number(std::string& out, std::int64_t value);

// Walks over lines that hold something, and over the tokens (separated by blanks) of such a line. A token that starts
// with '#' ends its line. Carriage returns are blanks.
class TextScanner {
 public:
  explicit TextScanner(std::string_view text);

  bool next_line();                            // to the next line that holds a token; false at the end
  std::int64_t line() const { return line_; }  // from 1; the last line after the end
  bool at_end_of_line();                       // no token is left in this line
  std::string_view token();                    // the next one, empty where none is left
  NumberFault number(double& out);             // on a fault the token is not consumed
  NumberFault integer(std::int64_t& out);
  // As many numbers one after the other: most of a large file goes through here. Returns how many there were; on a
  // fault it is that of out[returned].
  int numbers(double* out, int count, NumberFault& fault);
  std::size_t bytes_left() const { return static_cast<std::size_t>(end_ - p_); }  // so that lists can be sized

 private:
  void skip_blanks() {
    while (p_ < line_end_ && (*p_ == ' ' || *p_ == '\t' || *p_ == '\r')) ++p_;
  }
  bool ends_token(const char* p) const { return p == line_end_ || *p == ' ' || *p == '\t' || *p == '\r'; }
  bool scan_short(double& out);
  bool scan_exponent(const char*& p, int& power) const;
  template <class T>
  NumberFault scan(T& out);

  const char* p_;         // the next character to look at
  const char* line_end_;  // of the current line, its newline excluded
  const char* end_;
  std::int64_t line_ = 0;
};

// Splits a line of comma-separated values; blanks around a field do not count. Returns how many fields there are, of
// which the first `capacity` are stored.
int split_fields(std::string_view line, std::string_view* fields, int capacity);

// Walks over the data lines of a table: blank lines, comments and one header line of words are passed over.
class TableScanner {
 public:
  explicit TableScanner(std::string_view text);
  bool next_row(std::string_view& row);
  std::int64_t line() const { return line_; }

 private:
  std::string_view rest_;
  std::int64_t line_ = 0;
  bool header_allowed_ = true;
};

}  // namespace oriel
