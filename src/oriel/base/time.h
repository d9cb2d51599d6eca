// Time is an integer count of nanoseconds: two stamps 1 ns apart are two, and sums never round (behaviour W1).
#pragma once
#include <compare>
#include <cstdint>

namespace oriel {

struct Duration {
  std::int64_t ns = 0;  // [ns]
  auto operator<=>(const Duration&) const = default;
  double seconds() const { return static_cast<double>(ns) * 1e-9; }  // [s], for arithmetic of small spans
  static constexpr Duration from_seconds(double s) {
    return {static_cast<std::int64_t>(s * 1e9 + (s < 0 ? -0.5 : 0.5))};
  }
};

struct Time {
  std::int64_t ns = 0;  // [ns] since an epoch of the recording's choice; may be negative
  auto operator<=>(const Time&) const = default;
};

constexpr Duration operator-(Time a, Time b) { return {a.ns - b.ns}; }
constexpr Time operator+(Time t, Duration d) { return {t.ns + d.ns}; }
constexpr Time operator-(Time t, Duration d) { return {t.ns - d.ns}; }
constexpr Duration operator+(Duration a, Duration b) { return {a.ns + b.ns}; }
constexpr Duration operator-(Duration a, Duration b) { return {a.ns - b.ns}; }

}  // namespace oriel
