// The laws of a manifold, checked for any type, a user's as well as the shipped ones; it knows nothing of any test
// framework. An empty answer means that all laws hold:
//
//   for (const LawViolation& v : check_manifold_laws<MyManifold>({.radius = 1.0})) std::cerr << v << '\n';
//
// With x, y points and d a tangent vector: x ⊞ 0 = x, x ⊞ (y ⊟ x) = y, (x ⊞ d) ⊟ x = d within the injectivity radius;
// for groups (operator*, inverse) also (a b) c = a (b c) and a⁻¹ a = a a⁻¹ = 1, with V{} the identity.
#pragma once
#include <cmath>
#include <cstdint>
#include <ostream>
#include <random>
#include <string>
#include <vector>

#include "oriel/manifold/manifold.h"

namespace oriel {

struct LawViolation {
  std::string law;   // as written above
  double deviation;  // norm of a tangent vector that should be zero, over 1 + the norm of d or of y ⊟ x
  double step;       // norm of d
};

inline std::ostream& operator<<(std::ostream& out, const LawViolation& v) {
  return out << v.law << " is off by " << v.deviation << " at a step of norm " << v.step;
}

struct LawOptions {
  double radius = 1.0;      // largest norm of a step; below the injectivity radius
  double tolerance = 1e-9;  // of a deviation
  int points = 50;          // that are drawn around V{}
  std::uint64_t seed = 1;
};

namespace detail {

template <class V>
class LawChecker {
 public:
  static constexpr int n = V::kDim;
  using Tangent = Vec<double, n>;

  explicit LawChecker(const LawOptions& options) : options_(options), random_(options.seed) {}

  std::vector<LawViolation> run() {
    check_at(V{}, V{});
    V y = random_point(V{});
    for (int i = 0; i < options_.points; ++i) {
      const V x = random_point(V{});
      check_at(x, y);
      if constexpr (requires {
                      { x* y } -> std::same_as<V>;
                      x.inverse();
                    })
        check_group(x, y, random_point(x));
      y = x;
    }
    return violations_;
  }

 private:
  Tangent direction() {
    std::normal_distribution<double> normal;
    Tangent d;
    for (int i = 0; i < n; ++i) d[i] = normal(random_);
    return d / d.norm();
  }
  V random_point(const V& from) {
    return from.plus(direction() * (options_.radius * std::uniform_real_distribution<double>()(random_)));
  }
  void expect_zero(const char* law, const Tangent& e, double step) {
    const double deviation = e.norm() / (1.0 + step);
    if (!(deviation <= options_.tolerance)) violations_.push_back({law, deviation, step});
  }
  void check_at(const V& x, const V& y) {
    expect_zero("x ⊞ 0 = x", x.plus(Tangent::zero()).minus(x), 0.0);
    const Tangent between = y.minus(x);
    expect_zero("x ⊞ (y ⊟ x) = y", x.plus(between).minus(y), between.norm());
    for (const double step : {1e-300, 1e-16, 1e-8, 1e-4, 0.01, 0.3, 0.7, 0.999}) {
      const Tangent d = direction() * (step < 1e-3 ? step : step * options_.radius);
      expect_zero("(x ⊞ d) ⊟ x = d", x.plus(d).minus(x) - d, d.norm());
    }
  }
  void check_group(const V& a, const V& b, const V& c) {
    expect_zero("(a b) c = a (b c)", ((a * b) * c).minus(a * (b * c)), 0.0);
    expect_zero("a⁻¹ a = 1", (a.inverse() * a).minus(V{}), 0.0);
    expect_zero("a a⁻¹ = 1", (a * a.inverse()).minus(V{}), 0.0);
  }

  LawOptions options_;
  std::mt19937_64 random_;
  std::vector<LawViolation> violations_;
};

}  // namespace detail

template <Manifold V>
std::vector<LawViolation> check_manifold_laws(const LawOptions& options = {}) {
  return detail::LawChecker<V>(options).run();
}

}  // namespace oriel
