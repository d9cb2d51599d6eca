// S²: unit vectors, directions without a length (a bearing, gravity's direction, a plane's normal). Two tangent
// directions.
//
// With B(x) an orthonormal basis of the plane across x, a function of x alone, x ⊞ d walks the angle ‖d‖ along the
// great circle that leaves x towards B(x) d, and y ⊟ x is the way there:
//   x ⊞ d = x cos‖d‖ + B(x) d sin‖d‖/‖d‖,   y ⊟ x = B(x)ᵀ y · θ/sin θ,  θ = ∠(x, y).
// C. Hertzberg, R. Wagner, U. Frese, L. Schröder, "Integrating generic sensor fusion algorithms with sound state
// representations through encapsulation of manifolds", Information Fusion 14, 2013, section 3, treats the sphere so. No
// tangent vector is carried from one point to another: d is read in the basis of the point that it was made at, and
// where B jumps nothing else does. Two points that face each other have no way that is the shortest; y ⊟ x is then one
// of them, of length π.
#pragma once
#include "oriel/base/pack.h"
#include "oriel/manifold/so3.h"

namespace oriel {

template <class S>
struct UnitVector3 {
  static constexpr std::string_view kName = "unit_vector3/1";
  static constexpr int kDim = 2;
  static constexpr std::array<std::string_view, 2> kTangentNames = {"direction 1 [rad]", "direction 2 [rad]"};
  template <class T>
  using rebind = UnitVector3<T>;

  Vec<S, 3> v = {{S(0.0), S(0.0), S(1.0)}};

  static UnitVector3 from_vector(const Vec<S, 3>& a) { return {a / a.norm()}; }

  // T. Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017, listing 3: exact to rounding
  // everywhere, and smooth but for the equator z = 0.
  Mat<S, 3, 2> basis() const {
    const S one(1.0), sign = select(v[2] < S(0.0), -one, one), a = -one / (sign + v[2]), b = v[0] * v[1] * a;
    return {{one + sign * v[0] * v[0] * a, sign * b, -(sign * v[0]), b, sign + v[1] * v[1] * a, -v[1]}};
  }
  UnitVector3 plus(const Vec<S, 2>& d) const {
    using so3_detail::alternating;
    using std::cos, std::sin, std::sqrt;
    const S t = d.squared_norm();
    const auto small = t < S(so3_detail::kSeries);
    const S angle = sqrt(select(small, S(1.0), t));
    const S c = select(small, alternating<0>(t), cos(angle)), s = select(small, alternating<1>(t), sin(angle) / angle);
    return from_vector(v * c + basis() * d * s);
  }
  Vec<S, 2> minus(const UnitVector3& x) const {
    const Vec<S, 2> across = transposed_times(x.basis(), v);
    S stretch, slope;
    x.angles(across, x.v.dot(v), stretch, slope);
    const S pi(3.141592653589793);
    const auto opposite = (across.squared_norm() <= S(1e-300)) & (x.v.dot(v) < S(0.0));
    return {{select(opposite, pi, across[0] * stretch), across[1] * stretch}};
  }

  // θ/sin θ and its slope by cos θ = c, -(sin θ - θ cos θ)/sin³ θ, from B(x)ᵀ y and c = x·y.
  static void angles(const Vec<S, 2>& across, const S& c, S& stretch, S& slope) {
    using std::atan2, std::sqrt;
    const S n2 = across.squared_norm();
    // For small u = n2 = sin²θ and c > 0 they are F(u) = asin(√u)/√u and F'(u) du/dc, du/dc = -2 c.
    const auto small = (n2 < S(0.04)) & (c > S(0.0));
    const S safe = select(n2 > S(1e-300), n2, S(1.0)), n = sqrt(select(small, S(1.0), safe)), theta = atan2(n, c);
    S near(0.0), near_slope(0.0);
    series(n2, near, near_slope);
    stretch = select(small, near, theta / n);
    slope = select(small, near_slope * c * S(-2.0), -(n - theta * c) / (n * n * n));
  }

 private:
  // F(u) = asin(√u)/√u = Σ f_k u^k, f_0 = 1, f_(k+1) = f_k (2k+1)²/((2k+2)(2k+3)), and F'(u).
  static constexpr std::array<double, 13> coefficients() {
    std::array<double, 13> f{1.0};
    for (int k = 0; k < 12; ++k) f[k + 1] = f[k] * (2 * k + 1) * (2 * k + 1) / ((2.0 * k + 2) * (2 * k + 3));
    return f;
  }
  static void series(const S& u, S& f, S& df) {
    constexpr auto a = coefficients();
    for (int k = 12; k > 0; --k) {
      f = (f + S(a[k])) * u;
      df = df * u + S(k * a[k]);
    }
    f = f + S(1.0);
  }
};
using UnitVector3d = UnitVector3<double>;

// Of y moved by B(y) δ: B(x)ᵀ y moves by B(x)ᵀ B(y) δ, and c = x·y by xᵀ B(y) δ.
template <class S>
Mat<S, 2, 2> analytic_minus_jacobian(const UnitVector3<S>& y, const UnitVector3<S>& x, const Vec<S, 2>&) {
  const Mat<S, 3, 2> Bx = x.basis(), By = y.basis();
  const Vec<S, 2> across = transposed_times(Bx, y.v);
  S stretch, slope;
  UnitVector3<S>::angles(across, x.v.dot(y.v), stretch, slope);
  return transposed_times(Bx, By) * stretch + across * (transposed_times(x.v, By) * slope);
}

}  // namespace oriel
