#include "oriel/io/bal.h"

#include <limits>
#include <utility>

#include "oriel/io/problem_text.h"
#include "oriel/io/text.h"

namespace oriel {
namespace {

constexpr const char* kCameraFields[] = {"r1", "r2", "r3", "t1", "t2", "t3", "f", "k1", "k2"};
constexpr const char* kPointFields[] = {"x", "y", "z"};

class Parser {
 public:
  Parser(std::string_view text, std::string file_name) : scanner_(text), bytes_(text.size()) {
    problem_.file_name = std::move(file_name);
  }

  Result<BalFile> parse() {
    if (!header() || !observations() || !parameters() || !end_of_file()) return error_;
    return std::move(problem_);
  }

 private:
  bool header() {
    constexpr const char* kNames[] = {"cameras", "points", "observations"};
    if (!scanner_.next_line()) return fail("expected the counts of cameras, points and observations, found no line");
    for (int i = 0; i < 3; ++i) {
      const NumberFault fault = scanner_.integer(counts_[i]);
      if (fault != NumberFault::none)
        return fail(describe_number(fault, "a count", std::string("the number of ") + kNames[i], scanner_.token()));
      if (counts_[i] <= 0 || counts_[i] > std::numeric_limits<std::int32_t>::max())
        return fail(std::string("expected a number of ") + kNames[i] + " from 1 to 2147483647, found " +
                    std::to_string(counts_[i]));
    }
    return end_of_line("the three counts") && counts_fit();
  }

  // An observation takes at least "0 0 0 0\n", a parameter "0\n": a false count must not become an allocation.
  bool counts_fit() {
    const std::int64_t least = counts_[2] * 8 + 2 * (counts_[0] * 9 + counts_[1] * 3);
    if (least <= static_cast<std::int64_t>(bytes_) + 1) return true;
    return fail("expected " + std::to_string(counts_[0]) + " cameras, " + std::to_string(counts_[1]) + " points and " +
                std::to_string(counts_[2]) + " observations, which a file of " + std::to_string(bytes_) +
                " bytes cannot hold");
  }

  bool observations() {
    problem_.observations.reserve(static_cast<std::size_t>(counts_[2]));
    for (std::int64_t k = 0; k < counts_[2]; ++k) {
      BalFile::Observation o;
      if (!scanner_.next_line())
        return fail("expected " + std::to_string(counts_[2]) + " observations, found the end of the file after " +
                    std::to_string(k));
      if (!index("camera", counts_[0], o.camera) || !index("point", counts_[1], o.point)) return false;
      if (!number("u", o.u) || !number("v", o.v)) return false;
      if (!end_of_line("camera, point, u, v")) return false;
      o.line = scanner_.line();
      problem_.observations.push_back(o);
    }
    return true;
  }

  bool index(const char* what, std::int64_t count, std::int32_t& out) {
    std::int64_t value;
    const NumberFault fault = scanner_.integer(value);
    if (fault != NumberFault::none)
      return fail(describe_number(fault, "an index", std::string("the ") + what, scanner_.token()));
    if (value < 0 || value >= count)
      return fail(std::string("expected a ") + what + " from 0 to " + std::to_string(count - 1) + ", found " +
                  std::to_string(value));
    out = static_cast<std::int32_t>(value);
    return true;
  }

  bool number(const char* field, double& out) {
    const NumberFault fault = scanner_.number(out);
    return fault == NumberFault::none || fail_number(fault, field);
  }

  bool fail_number(NumberFault fault, const std::string& field) {
    return fail(describe_number(fault, "a finite number", field, scanner_.token()),
                fault == NumberFault::not_finite ? ErrorCode::not_finite : ErrorCode::bad_input);
  }

  // The parameters stand one a line in some files and nine a line in others.
  bool parameters() {
    problem_.cameras.resize(static_cast<std::size_t>(counts_[0]));
    for (std::size_t i = 0; i < problem_.cameras.size(); ++i)
      if (!block(problem_.cameras[i].data(), kCameraFields, 9, "camera ", i)) return false;
    problem_.points.resize(static_cast<std::size_t>(counts_[1]));
    for (std::size_t i = 0; i < problem_.points.size(); ++i)
      if (!block(problem_.points[i].data(), kPointFields, 3, "point ", i)) return false;
    return true;
  }

  bool block(double* out, const char* const* fields, int count, const char* item, std::size_t i) {
    for (int k = 0; k < count; ++k) {
      if (scanner_.at_end_of_line() && !scanner_.next_line())
        return fail(std::string("expected a number for ") + fields[k] + " of " + item + std::to_string(i) +
                    ", found the end of the file");
      const NumberFault fault = scanner_.number(out[k]);
      if (fault != NumberFault::none)
        return fail_number(fault, std::string(fields[k]) + " of " + item + std::to_string(i));
    }
    return true;
  }

  bool end_of_line(const char* what) {
    if (scanner_.at_end_of_line()) return true;
    return fail(std::string("expected the end of the line after ") + what + ", found " + quote_token(scanner_.token()));
  }

  bool end_of_file() {
    if (scanner_.at_end_of_line() && !scanner_.next_line()) return true;
    return fail("expected the end of the file after the last point, found " + quote_token(scanner_.token()));
  }

  bool fail(std::string message, ErrorCode code = ErrorCode::bad_input) {
    error_ = {code, std::move(message), problem_.file_name, scanner_.line()};
    return false;
  }

  TextScanner scanner_;
  std::size_t bytes_;
  std::int64_t counts_[3] = {};
  BalFile problem_;
  Error error_;
};

}  // namespace

Result<BalFile> parse_bal(std::string_view text, std::string file_name) {
  return Parser(text, std::move(file_name)).parse();
}

Result<BalFile> read_bal(const std::string& path) {
  const Result<ProblemText> text = read_problem_text(path);
  if (!text) return text.error();
  return parse_bal(text->view(), path);
}

std::string format_bal(const BalFile& problem) {
  std::string out;
  const auto integer = [&](std::size_t value, char after) {
    append_number(out, static_cast<std::int64_t>(value));
    out += after;
  };
  const auto number = [&](double value, char after) {
    append_number(out, value);
    out += after;
  };
  integer(problem.cameras.size(), ' ');
  integer(problem.points.size(), ' ');
  integer(problem.observations.size(), '\n');
  for (const BalFile::Observation& o : problem.observations) {
    integer(static_cast<std::size_t>(o.camera), ' ');
    integer(static_cast<std::size_t>(o.point), ' ');
    number(o.u, ' ');
    number(o.v, '\n');
  }
  for (const auto& camera : problem.cameras)
    for (double value : camera) number(value, '\n');
  for (const Vec3d& point : problem.points)
    for (double value : point.m) number(value, '\n');
  return out;
}

Result<void> write_bal(const std::string& path, const BalFile& problem) {
  return write_text_file(path, format_bal(problem));
}

}  // namespace oriel
