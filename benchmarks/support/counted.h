// Counted: a double that counts the operations it goes through. A residual is written over its scalar, so evaluating it
// once with S = Counted says how many flops its formula has. Roots, sines and the like count as one.
#pragma once
#include <cmath>
#include <cstdint>

namespace oriel::benchmark {

struct Counted {
  static inline std::int64_t flops = 0;
  double v;

  Counted() = default;
  constexpr Counted(double value) : v(value) {}  // NOLINT(google-explicit-constructor): a constant in a formula
  static Counted done(double value) {
    ++flops;
    return Counted(value);
  }

  friend Counted operator+(Counted a, Counted b) { return done(a.v + b.v); }
  friend Counted operator-(Counted a, Counted b) { return done(a.v - b.v); }
  friend Counted operator*(Counted a, Counted b) { return done(a.v * b.v); }
  friend Counted operator/(Counted a, Counted b) { return done(a.v / b.v); }
  friend Counted operator-(Counted a) { return Counted(-a.v); }
  Counted& operator+=(Counted b) { return *this = *this + b; }
  Counted& operator-=(Counted b) { return *this = *this - b; }
  Counted& operator*=(Counted b) { return *this = *this * b; }
  Counted& operator/=(Counted b) { return *this = *this / b; }
  friend bool operator<(Counted a, Counted b) { return a.v < b.v; }
  friend bool operator>(Counted a, Counted b) { return a.v > b.v; }
  friend bool operator<=(Counted a, Counted b) { return a.v <= b.v; }
  friend bool operator>=(Counted a, Counted b) { return a.v >= b.v; }
  friend bool operator==(Counted a, Counted b) { return a.v == b.v; }
};
inline Counted sqrt(Counted a) { return Counted::done(std::sqrt(a.v)); }
inline Counted sin(Counted a) { return Counted::done(std::sin(a.v)); }
inline Counted cos(Counted a) { return Counted::done(std::cos(a.v)); }
inline Counted atan2(Counted a, Counted b) { return Counted::done(std::atan2(a.v, b.v)); }
inline Counted abs(Counted a) { return Counted(std::fabs(a.v)); }

}  // namespace oriel::benchmark
