// A robot of the plane sees a landmark of the plane. With u = R_aᵀ (l - t_a), the landmark in the robot's frame:
//   sighting       r = u - z [m] (2 × 1)                                 (g2o's EDGE_SE2_XY)
//   bearing        r = atan2(u_y, u_x) - z wrapped to (-π, π] [rad]      (g2o's EDGE_BEARING_SE2_XY)
//   range          r = ‖u‖ - z [m]
//   bearing-range  both, in this order (2 × 1)
// (Thrun, Burgard, Fox, Probabilistic Robotics, 2005, eq. 6.40, 7.12.) The pose moves on its right, so that
//   ∂u/∂φ = [u_y, -u_x]ᵀ,  ∂u/∂t = -I,  ∂u/∂l = R_aᵀ,
//   ∂bearing/∂u = [-u_y, u_x] / ‖u‖²,  ∂range/∂u = uᵀ / ‖u‖.
// At the landmark itself bearing and range have no direction, and the factor is not valid.
#pragma once
#include "oriel/manifold/se2.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/linearize_rows.h"
#include "oriel/residual/noise.h"
#include "oriel/residual/residual.h"

namespace oriel {

namespace detail {

inline constexpr double kLeastSight = 1e-6;  // [m]

// What a bearing, a range or both of them share: rows = G · ∂u, G being ∂row/∂u (kDim × 2).
template <class S, int N>
void chain_sight(const Pose2<S>& a, const Vec<S, 2>& u, const Mat<S, N, 2>& G, Mat<S, N, 3>* J_a, Mat<S, N, 2>* J_l) {
  if (J_a == nullptr) return;
  for (int i = 0; i < N; ++i) {
    (*J_a)(i, 0) = G(i, 0) * u[1] - G(i, 1) * u[0];
    (*J_a)(i, 1) = -G(i, 0);
    (*J_a)(i, 2) = -G(i, 1);
    (*J_l)(i, 0) = G(i, 0) * a.R.c - G(i, 1) * a.R.s;
    (*J_l)(i, 1) = G(i, 0) * a.R.s + G(i, 1) * a.R.c;
  }
}

// Where u has no direction, one of length 1 m stands in for it: the row is left out, but must not become NaN.
template <class S>
struct Sight {
  Vec<S, 2> u;
  S range;
  Valid<S> valid;
  Sight(const Pose2<S>& a, const Point2<S>& l) : u(a.R.inverse() * (l.p - a.t)) {
    using std::sqrt;
    const S squared = u.squared_norm();
    valid = squared > S(kLeastSight * kLeastSight);
    u[0] = select(valid, u[0], S(1.0));
    range = sqrt(select(valid, squared, S(1.0)));
  }
  // The angle from z to u, so that wrapping needs no rounding of turns.
  S turn_from(const S& z) const { return (Rot2<S>::exp(-z) * Rot2<S>{u[0] / range, u[1] / range}).log(); }
  Vec<S, 2> bearing_row() const { return {{-u[1] / (range * range), u[0] / (range * range)}}; }
  Vec<S, 2> range_row() const { return {{u[0] / range, u[1] / range}}; }
};

}  // namespace detail

template <class S>
struct Sighting2 {
  static constexpr std::string_view kName = "sighting2/1";
  static constexpr int kDim = 2;
  using Variables = Types<Pose2d, Point2d>;
  template <class T>
  using rebind = Sighting2<T>;

  Vec<S, 2> measured;  // of the landmark, in the robot's frame [m]

  Valid<S> evaluate(const Pose2<S>& a, const Point2<S>& l, Vec<S, 2>& r, Mat<S, 2, 3>* J_a, Mat<S, 2, 2>* J_l) const {
    const Vec<S, 2> u = a.R.inverse() * (l.p - a.t);
    r = u - measured;
    detail::chain_sight(a, u, Mat<S, 2, 2>::identity(), J_a, J_l);
    return always_valid<S>();
  }
};
using Sighting2d = Sighting2<double>;

template <class S>
struct Bearing2 {
  static constexpr std::string_view kName = "bearing2/1";
  static constexpr int kDim = 1;
  using Variables = Types<Pose2d, Point2d>;
  template <class T>
  using rebind = Bearing2<T>;

  S measured;  // [rad], from the robot's x to its y

  Valid<S> evaluate(const Pose2<S>& a, const Point2<S>& l, Vec<S, 1>& r, Mat<S, 1, 3>* J_a, Mat<S, 1, 2>* J_l) const {
    const detail::Sight<S> sight(a, l);
    r[0] = sight.turn_from(measured);
    const Vec<S, 2> g = sight.bearing_row();
    detail::chain_sight(a, sight.u, Mat<S, 1, 2>{{g[0], g[1]}}, J_a, J_l);
    return sight.valid;
  }
};
using Bearing2d = Bearing2<double>;

template <class S>
struct Range2 {
  static constexpr std::string_view kName = "range2/1";
  static constexpr int kDim = 1;
  using Variables = Types<Pose2d, Point2d>;
  template <class T>
  using rebind = Range2<T>;

  S measured;  // [m]

  Valid<S> evaluate(const Pose2<S>& a, const Point2<S>& l, Vec<S, 1>& r, Mat<S, 1, 3>* J_a, Mat<S, 1, 2>* J_l) const {
    const detail::Sight<S> sight(a, l);
    r[0] = sight.range - measured;
    const Vec<S, 2> g = sight.range_row();
    detail::chain_sight(a, sight.u, Mat<S, 1, 2>{{g[0], g[1]}}, J_a, J_l);
    return sight.valid;
  }
};
using Range2d = Range2<double>;

template <class S>
struct BearingRange2 {
  static constexpr std::string_view kName = "bearing_range2/1";
  static constexpr int kDim = 2;
  using Variables = Types<Pose2d, Point2d>;
  template <class T>
  using rebind = BearingRange2<T>;

  S bearing;  // [rad]
  S range;    // [m]

  Valid<S> evaluate(const Pose2<S>& a, const Point2<S>& l, Vec<S, 2>& r, Mat<S, 2, 3>* J_a, Mat<S, 2, 2>* J_l) const {
    const detail::Sight<S> sight(a, l);
    r = {{sight.turn_from(bearing), sight.range - range}};
    const Vec<S, 2> g = sight.bearing_row(), h = sight.range_row();
    detail::chain_sight(a, sight.u, Mat<S, 2, 2>{{g[0], h[0], g[1], h[1]}}, J_a, J_l);
    return sight.valid;
  }
};
using BearingRange2d = BearingRange2<double>;

// Compiled once, in the library.
extern template void linearize_rows<Sighting2d, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Sighting2d, DiagonalNoise<2>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Sighting2d, FullNoise<2>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Bearing2d, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<Range2d, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<BearingRange2d, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<BearingRange2d, DiagonalNoise<2>>(const RowPointers&, Batch&) noexcept;
extern template void linearize_rows<BearingRange2d, FullNoise<2>>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
