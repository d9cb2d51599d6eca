#include "oriel/io/tum.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "oriel/io/text.h"

namespace oriel {
namespace {

constexpr const char* kTumFields[] = {"t", "x", "y", "z", "qx", "qy", "qz", "qw"};
constexpr const char* kKittiFields[] = {"r11", "r12", "r13", "x", "r21", "r22", "r23", "y", "r31", "r32", "r33", "z"};

// A decimal number, whole.fraction · 10^exponent, not yet evaluated.
struct Decimal {
  bool negative = false;
  std::string_view whole, fraction;
  std::int64_t exponent = 0;
};

bool is_digit(char c) { return c >= '0' && c <= '9'; }

std::string_view take_digits(std::string_view& s) {
  std::size_t n = 0;
  while (n < s.size() && is_digit(s[n])) ++n;
  const std::string_view digits = s.substr(0, n);
  s.remove_prefix(n);
  return digits;
}

bool parse_decimal(std::string_view s, Decimal& d) {
  if (!s.empty() && (s.front() == '+' || s.front() == '-')) {
    d.negative = s.front() == '-';
    s.remove_prefix(1);
  }
  d.whole = take_digits(s);
  if (!s.empty() && s.front() == '.') {
    s.remove_prefix(1);
    d.fraction = take_digits(s);
  }
  if (d.whole.empty() && d.fraction.empty()) return false;
  if (s.empty()) return true;
  if (s.front() != 'e' && s.front() != 'E') return false;
  s.remove_prefix(1);
  const NumberFault fault = parse_integer(s, d.exponent);
  d.exponent = std::clamp<std::int64_t>(d.exponent, -1000000, 1000000);
  return fault == NumberFault::none;
}

// Hamilton quaternion of a rotation matrix, from the largest of its four components (Shepperd 1978).
void quaternion_of(const Mat3d& R, TumPose& pose) {
  const double trace = R(0, 0) + R(1, 1) + R(2, 2);
  double q[4];  // x y z w
  int i = 0;
  for (int k = 1; k < 3; ++k)
    if (R(k, k) > R(i, i)) i = k;
  if (trace >= R(i, i)) {
    q[3] = 1 + trace;
    for (int k = 0; k < 3; ++k) q[k] = R((k + 2) % 3, (k + 1) % 3) - R((k + 1) % 3, (k + 2) % 3);
  } else {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    q[i] = 1 + R(i, i) - R(j, j) - R(k, k);
    q[j] = R(j, i) + R(i, j);
    q[k] = R(k, i) + R(i, k);
    q[3] = R(k, j) - R(j, k);
  }
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  pose.qx = q[0] / norm, pose.qy = q[1] / norm, pose.qz = q[2] / norm, pose.qw = q[3] / norm;
}

class Parser {
 public:
  Parser(std::string_view text, std::string file_name, StampOrder order)
      : scanner_(text), columns_(text), order_(order) {
    file_.file_name = std::move(file_name);
  }

  Result<TrajectoryFile> parse() {
    file_.stamped = count_columns() != 12;
    while (scanner_.next_line()) {
      TumPose pose{};
      if (!(file_.stamped ? tum_line(pose) : kitti_line(pose))) return error_;
      if (!scanner_.at_end_of_line()) {
        fail("expected the end of the line, found " + quote_token(scanner_.token()));
        return error_;
      }
      file_.poses.push_back(pose);
    }
    if (file_.poses.empty())
      return Error{ErrorCode::bad_input, "expected poses `t x y z qx qy qz qw`, found none", file_.file_name};
    return std::move(file_);
  }

 private:
  int count_columns() {
    int n = 0;
    if (!columns_.next_line()) return 0;
    while (!columns_.token().empty()) ++n;
    return n;
  }

  bool tum_line(TumPose& pose) {
    const std::string_view stamp = scanner_.token();
    if (!parse_seconds(stamp, pose.time)) return fail("expected a stamp in seconds, found " + quote_token(stamp));
    if (order_ == StampOrder::rising && !file_.poses.empty() && pose.time <= file_.poses.back().time)
      return fail("expected a later stamp than " + format_seconds(file_.poses.back().time) + ", found " +
                  quote_token(stamp));
    double v[7];
    if (!numbers(kTumFields + 1, v, 7)) return false;
    const double norm = std::sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + v[6] * v[6]);
    if (!(norm > 1e-9) || !std::isfinite(norm)) return fail("expected a quaternion that is not zero");
    pose.p = {v[0], v[1], v[2]};
    pose.qx = v[3] / norm, pose.qy = v[4] / norm, pose.qz = v[5] / norm, pose.qw = v[6] / norm;
    return true;
  }

  bool kitti_line(TumPose& pose) {
    double v[12];
    if (!numbers(kKittiFields, v, 12)) return false;
    Mat3d R;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) R(i, j) = v[4 * i + j];
    const Mat3d off = R.transposed() * R - Mat3d::identity();
    if (!(off.norm() < 1e-2) || R.col(0).dot(cross(R.col(1), R.col(2))) < 0) return fail("expected a rotation matrix");
    quaternion_of(R, pose);
    pose.p = {v[3], v[7], v[11]};
    pose.time = {static_cast<std::int64_t>(file_.poses.size())};
    return true;
  }

  bool numbers(const char* const* fields, double* out, int count) {
    for (int i = 0; i < count; ++i)
      if (const NumberFault fault = scanner_.number(out[i]); fault != NumberFault::none)
        return fail(describe_number(fault, "a finite number", fields[i], scanner_.token()),
                    fault == NumberFault::not_finite ? ErrorCode::not_finite : ErrorCode::bad_input);
    return true;
  }

  bool fail(std::string message, ErrorCode code = ErrorCode::bad_input) {
    error_ = {code, std::move(message), file_.file_name, scanner_.line()};
    return false;
  }

  TextScanner scanner_, columns_;
  StampOrder order_;
  TrajectoryFile file_;
  Error error_;
};

}  // namespace

bool parse_seconds(std::string_view token, Time& out) {
  Decimal d;
  if (!parse_decimal(token, d)) return false;
  // The digits before this place count nanoseconds; the one at it rounds.
  const std::int64_t whole_digits = static_cast<std::int64_t>(d.whole.size()) + d.exponent + 9;
  const auto total = static_cast<std::int64_t>(d.whole.size() + d.fraction.size());
  const auto digit = [&](std::int64_t i) -> unsigned {
    if (i < 0 || i >= total) return 0;
    const auto k = static_cast<std::size_t>(i);
    return static_cast<unsigned>((k < d.whole.size() ? d.whole[k] : d.fraction[k - d.whole.size()]) - '0');
  };
  constexpr std::uint64_t kMost = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
  std::uint64_t ns = 0;
  for (std::int64_t i = 0; i < whole_digits; ++i) {
    if (i >= total && ns == 0) break;  // zero, whatever the exponent
    if (ns > (kMost - digit(i)) / 10) return false;
    ns = ns * 10 + digit(i);
  }
  if (whole_digits >= 0 && digit(whole_digits) >= 5) ++ns;
  if (ns > kMost) return false;
  out.ns = d.negative ? -static_cast<std::int64_t>(ns) : static_cast<std::int64_t>(ns);
  return true;
}

std::string format_seconds(Time time) {
  const bool negative = time.ns < 0;
  const std::uint64_t ns = negative ? 0 - static_cast<std::uint64_t>(time.ns) : static_cast<std::uint64_t>(time.ns);
  const std::string fraction = std::to_string(ns % 1000000000);
  return (negative ? "-" : "") + std::to_string(ns / 1000000000) + "." + std::string(9 - fraction.size(), '0') +
         fraction;
}

Result<TrajectoryFile> parse_trajectory(std::string_view text, std::string file_name, StampOrder order) {
  return Parser(text, std::move(file_name), order).parse();
}

Result<TrajectoryFile> read_trajectory(const std::string& path, StampOrder order) {
  const Result<std::string> text = read_text_file(path);
  if (!text) return text.error();
  return parse_trajectory(*text, path, order);
}

std::string format_tum(const std::vector<TumPose>& poses) {
  std::string out = "# t[s] x y z[m] qx qy qz qw\n";
  for (const TumPose& pose : poses) {
    out += format_seconds(pose.time);
    for (double value : {pose.p[0], pose.p[1], pose.p[2], pose.qx, pose.qy, pose.qz, pose.qw}) {
      out += ' ';
      append_number(out, value);
    }
    out += '\n';
  }
  return out;
}

Result<void> write_tum(const std::string& path, const std::vector<TumPose>& poses) {
  return write_text_file(path, format_tum(poses));
}

}  // namespace oriel
