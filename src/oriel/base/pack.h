// Pack: eight doubles that are computed at once, one a lane. A residual that is written over its scalar is evaluated
// for eight rows of a batch by one call with S = Pack; the compiler lowers it to AVX-512, AVX2 or SSE2 code, and each
// lane's bits do not depend on its neighbours.
#pragma once
#include <cmath>
#include <cstring>

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

// GCC 12 keeps a vector that is wider than a register in memory and takes each operation on it through stores and loads
// of sixteen bytes. So a Pack is as many vectors as eight doubles take registers, and no operation is wider than one.
struct Pack {
  static constexpr int kLanes = 8;
#if defined(__AVX512F__)
  static constexpr int kParts = 1;
  using Native = double __attribute__((vector_size(64)));
  using NativeMask = long long __attribute__((vector_size(64)));
#elif defined(__AVX__)
  static constexpr int kParts = 2;
  using Native = double __attribute__((vector_size(32)));
  using NativeMask = long long __attribute__((vector_size(32)));
#else
  static constexpr int kParts = 4;
  using Native = double __attribute__((vector_size(16)));
  using NativeMask = long long __attribute__((vector_size(16)));
#endif
  static constexpr int kNative = kLanes / kParts;  // lanes of a part

  // r[p] = f(p). Written out: a loop would reach the pass that takes structs apart before it is unrolled.
  template <class R, class F>
  static R each(F f) {
    R r;
    r.v[0] = f(0);
    if constexpr (kParts > 1) r.v[1] = f(1);
    if constexpr (kParts > 2) r.v[2] = f(2), r.v[3] = f(3);
    return r;
  }

  struct Mask {
    NativeMask v[kParts];  // -1 where true, 0 where false
    bool operator[](int lane) const { return v[lane / kNative][lane % kNative] != 0; }
    friend Mask operator&(Mask a, Mask b) {
      return each<Mask>([&](int p) { return a.v[p] & b.v[p]; });
    }
    friend Mask operator|(Mask a, Mask b) {
      return each<Mask>([&](int p) { return a.v[p] | b.v[p]; });
    }
    friend Mask operator!(Mask a) {
      return each<Mask>([&](int p) { return ~a.v[p]; });
    }
  };

  Native v[kParts];

  Pack() = default;
  Pack(double s) {  // NOLINT(google-explicit-constructor): a constant in a formula
    *this = each<Pack>([&](int) { return s - Native{}; });
  }

  // Eight doubles, part by part: GCC 12 moves a struct that is copied whole through the stack.
  static Pack load(const double* from) {
    return each<Pack>([from](int p) {
      Native part;
      std::memcpy(&part, from + p * kNative, sizeof(part));
      return part;
    });
  }
  void store(double* to) const {
    std::memcpy(to, &v[0], sizeof(Native));
    if constexpr (kParts > 1) std::memcpy(to + kNative, &v[1], sizeof(Native));
    if constexpr (kParts > 2)
      std::memcpy(to + 2 * kNative, &v[2], sizeof(Native)), std::memcpy(to + 3 * kNative, &v[3], sizeof(Native));
  }

  double operator[](int lane) const { return v[lane / kNative][lane % kNative]; }
  void set(int lane, double s) { v[lane / kNative][lane % kNative] = s; }

  friend Pack operator+(Pack a, Pack b) {
    return each<Pack>([&](int p) { return a.v[p] + b.v[p]; });
  }
  friend Pack operator-(Pack a, Pack b) {
    return each<Pack>([&](int p) { return a.v[p] - b.v[p]; });
  }
  friend Pack operator*(Pack a, Pack b) {
    return each<Pack>([&](int p) { return a.v[p] * b.v[p]; });
  }
  friend Pack operator/(Pack a, Pack b) {
    return each<Pack>([&](int p) { return a.v[p] / b.v[p]; });
  }
  friend Pack operator-(Pack a) {
    return each<Pack>([&](int p) { return -a.v[p]; });
  }
  Pack& operator+=(Pack b) { return *this = *this + b; }
  Pack& operator-=(Pack b) { return *this = *this - b; }
  Pack& operator*=(Pack b) { return *this = *this * b; }
  friend Mask operator<(Pack a, Pack b) {
    return each<Mask>([&](int p) { return (NativeMask)(a.v[p] < b.v[p]); });
  }
  friend Mask operator>(Pack a, Pack b) {
    return each<Mask>([&](int p) { return (NativeMask)(a.v[p] > b.v[p]); });
  }
  friend Mask operator<=(Pack a, Pack b) {
    return each<Mask>([&](int p) { return (NativeMask)(a.v[p] <= b.v[p]); });
  }
  friend Mask operator>=(Pack a, Pack b) {
    return each<Mask>([&](int p) { return (NativeMask)(a.v[p] >= b.v[p]); });
  }
};

// select(c, a, b): a where c holds, else b. The same word for double, so that one formula serves both scalars.
inline Pack select(Pack::Mask c, Pack a, Pack b) {
  return Pack::each<Pack>([&](int p) { return c.v[p] ? a.v[p] : b.v[p]; });
}
template <class S>
inline S select(bool c, const S& a, const S& b) {
  return c ? a : b;
}

// Bit l is set where lane l holds.
inline unsigned bits(Pack::Mask m) {
#if defined(__AVX512F__) || !defined(__AVX__)
  unsigned b = 0;
  for (int l = 0; l < Pack::kLanes; ++l) b |= (m[l] ? 1u : 0u) << l;
  return b;
#else
  const auto part = [&](int p) { return static_cast<unsigned>(__builtin_ia32_movmskpd256((Pack::Native)m.v[p])); };
  return part(0) | part(1) << Pack::kNative;
#endif
}
inline Pack::Mask mask_of(unsigned bits) {
  Pack::Mask m;
  for (int l = 0; l < Pack::kLanes; ++l)
    m.v[l / Pack::kNative][l % Pack::kNative] = -static_cast<long long>(bits >> l & 1u);
  return m;
}

namespace pack_detail {
template <class F>
inline Pack lane_by_lane(Pack a, F f) {
  Pack r;
  for (int i = 0; i < Pack::kLanes; ++i) r.set(i, f(a[i]));
  return r;
}
}  // namespace pack_detail

// The builtins themselves: <immintrin.h> would take longer to compile than most that includes this file.
inline Pack sqrt(Pack a) {
#if defined(__AVX512F__) && !defined(__clang__)
  a.v[0] = __builtin_ia32_sqrtpd512_mask(a.v[0], Pack::Native{}, static_cast<char>(-1), 4);
  return a;
#elif defined(__AVX__) && !defined(__AVX512F__) && !defined(__clang__)
  return Pack::each<Pack>([&](int p) { return __builtin_ia32_sqrtpd256(a.v[p]); });
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
