// Random numbers that are the same with every standard library: std::mt19937_64 is defined to the bit, its
// distributions are not. (Box and Muller's method stands on libm, whose last bits may differ.)
#pragma once
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

#include "oriel/base/matrix.h"

namespace oriel {

class SeededRandom {
 public:
  // Streams of one seed are independent: a sensor draws from its own, so that another one changes none of its numbers.
  explicit SeededRandom(std::uint64_t seed, std::uint64_t stream = 0) : bits_(mixed(seed + kGolden * (stream + 1))) {}

  std::uint64_t bits() { return bits_(); }
  double uniform() { return (static_cast<double>(bits_() >> 11) + 0.5) * 0x1p-53; }  // in (0, 1)
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  bool chance(double probability) { return uniform() < probability; }
  std::size_t below(std::size_t n) { return static_cast<std::size_t>(uniform() * static_cast<double>(n)); }

  // Box, Muller, "A note on the generation of random normal deviates", 1958. One after the other: operands of one
  // expression are evaluated in no defined order.
  double normal() {
    const double radius = std::sqrt(-2.0 * std::log(uniform()));
    return radius * std::cos(2.0 * std::numbers::pi * uniform());
  }
  template <int N>
  Vec<double, N> normals(double sigma) {
    Vec<double, N> v;
    for (int i = 0; i < N; ++i) v[i] = sigma * normal();
    return v;
  }

 private:
  static constexpr std::uint64_t kGolden = 0x9e3779b97f4a7c15ull;
  // Steele, Lea, Flood, "Fast splittable pseudorandom number generators" (SplitMix64), 2014: seeds 1, 2, 3 lie far
  // apart.
  static constexpr std::uint64_t mixed(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    return z ^ (z >> 31);
  }

  std::mt19937_64 bits_;
};

}  // namespace oriel
