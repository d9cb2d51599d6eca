// Pack: eight doubles that are computed at once, one a lane. A residual that is written over its scalar is evaluated
// for eight rows of a batch by one call with S = Pack; the compiler lowers it to AVX-512, AVX2 or SSE2 code, and each
// lane's bits do not depend on its neighbours.
#pragma once
#include <cmath>

// How a 64-byte vector is passed depends on the instruction set, so the name says which: a program for one set and a
// library for another never share an inline function of Pack.
#if defined(__AVX512F__)
#define ORIEL_PACK_ABI pack_avx512
#elif defined(__AVX__)
#define ORIEL_PACK_ABI pack_avx
#else
#define ORIEL_PACK_ABI pack_sse2
#endif

namespace oriel {
inline namespace ORIEL_PACK_ABI {

struct Pack {
  static constexpr int kLanes = 8;
  using Native = double __attribute__((vector_size(64)));
  using NativeMask = long long __attribute__((vector_size(64)));
  struct Mask {
    NativeMask v;  // -1 where true, 0 where false
    friend Mask operator&(Mask a, Mask b) { return {a.v & b.v}; }
    friend Mask operator|(Mask a, Mask b) { return {a.v | b.v}; }
    friend Mask operator!(Mask a) { return {~a.v}; }
  };

  Native v;

  Pack() = default;
  Pack(double s) : v(s - Native{}) {}  // NOLINT(google-explicit-constructor): a constant in a formula
  Pack(Native n) : v(n) {}             // NOLINT(google-explicit-constructor)

  double operator[](int lane) const { return v[lane]; }
  void set(int lane, double s) { v[lane] = s; }

  friend Pack operator+(Pack a, Pack b) { return a.v + b.v; }
  friend Pack operator-(Pack a, Pack b) { return a.v - b.v; }
  friend Pack operator*(Pack a, Pack b) { return a.v * b.v; }
  friend Pack operator/(Pack a, Pack b) { return a.v / b.v; }
  friend Pack operator-(Pack a) { return -a.v; }
  Pack& operator+=(Pack b) { return *this = *this + b; }
  Pack& operator-=(Pack b) { return *this = *this - b; }
  Pack& operator*=(Pack b) { return *this = *this * b; }
  friend Mask operator<(Pack a, Pack b) { return {a.v < b.v}; }
  friend Mask operator>(Pack a, Pack b) { return {a.v > b.v}; }
  friend Mask operator<=(Pack a, Pack b) { return {a.v <= b.v}; }
  friend Mask operator>=(Pack a, Pack b) { return {a.v >= b.v}; }
};

// select(c, a, b): a where c holds, else b. The same word for double, so that one formula serves both scalars.
inline Pack select(Pack::Mask c, Pack a, Pack b) { return c.v ? a.v : b.v; }
template <class S>
inline S select(bool c, const S& a, const S& b) {
  return c ? a : b;
}

namespace pack_detail {
template <class F>
inline Pack lane_by_lane(Pack a, F f) {
  Pack r;
  for (int i = 0; i < Pack::kLanes; ++i) r.v[i] = f(a.v[i]);
  return r;
}
}  // namespace pack_detail

inline Pack sqrt(Pack a) {
#if defined(__AVX512F__) && !defined(__clang__)
  // The builtin itself: <immintrin.h> would take longer to compile than most that includes this file.
  return Pack(__builtin_ia32_sqrtpd512_mask(a.v, Pack::Native{}, static_cast<char>(-1), 4));
#else
  return pack_detail::lane_by_lane(a, [](double s) { return std::sqrt(s); });
#endif
}
inline Pack sin(Pack a) {
  return pack_detail::lane_by_lane(a, [](double s) { return std::sin(s); });
}
inline Pack cos(Pack a) {
  return pack_detail::lane_by_lane(a, [](double s) { return std::cos(s); });
}
inline Pack exp(Pack a) {
  return pack_detail::lane_by_lane(a, [](double s) { return std::exp(s); });
}
inline Pack log(Pack a) {
  return pack_detail::lane_by_lane(a, [](double s) { return std::log(s); });
}
inline Pack abs(Pack a) { return select(a < Pack(0.0), -a, a); }

// In [-π, π], within 2 units in the last place; (0, 0) gives 0 and the sign of a zero is not looked at. The smaller
// over the larger side is brought below tan(π/8) by atan(q) = π/4 + atan((q - 1)/(q + 1)), where
// atan(q) = q + q z P(z), z = q²; P interpolates at the Chebyshev nodes of [0, tan²(π/8)], error 7e-18 of q.
inline Pack atan2(Pack y, Pack x) {
  constexpr double kP[] = {-0.019176885636589053, 0.039231657085083686, -0.050854496960392584, 0.05858148904795124,
                           -0.0666451144646022,   0.07692183190760651,  -0.09090904578121085,  0.11111111015256292,
                           -0.14285714284666542,  0.1999999999999552,   -0.3333333333333333};
  constexpr double kPi = 3.141592653589793, kQuarterRest = 3.061616997868383e-17, kTanPi8 = 0.41421356237309503;
  const Pack ax = abs(x), ay = abs(y);
  const auto steep = ay > ax;
  const Pack low = select(steep, ax, ay), high = select(steep, ay, ax);
  const auto far = low > high * Pack(kTanPi8);
  const Pack above = select(far, low - high, low), below = select(far, low + high, high);
  const Pack q = above / select(below > Pack(0.0), below, Pack(1.0)), z = q * q;
  Pack p(kP[0]);
  for (int i = 1; i < 11; ++i) p = p * z + Pack(kP[i]);
  Pack a = q + (q * z * p + select(far, Pack(kQuarterRest), Pack(0.0)));
  a = select(far, Pack(0.25 * kPi) + a, a);
  a = select(steep, Pack(0.5 * kPi) - a, a);
  a = select(x < Pack(0.0), Pack(kPi) - a, a);
  const Pack signed_angle = select(y < Pack(0.0), -a, a);
  return select((x - x <= Pack(0.0)) & (y - y <= Pack(0.0)), signed_angle, x + y - (x + y));  // NaN where not finite
}

}  // namespace ORIEL_PACK_ABI
}  // namespace oriel
