// Small matrices of fixed size: trivially copyable aggregates, column-major like Eigen's.
//
// Eigen's own fixed matrices have a copy constructor of their own (3.4), so a struct that holds one could be neither
// sent to another process by memcpy nor recorded; and <Eigen/Core> alone is half of the compile time that a first
// program may take. The dense algebra of the solver works on raw memory, through Eigen::Map where that is handy; see
// docs/decisions/0001-small-matrices.md. `S` is double, Dual<N> (derivatives) or Pack (8 rows of a batch at once).
//
// The loops ask to be unrolled: without it GCC 12 carries matrices of packs through memory (2.5 times slower).
#pragma once
#include <cmath>
#include <cstddef>
#include <ostream>
#include <type_traits>

namespace oriel {

template <class S, int R, int C>
struct Mat {
  static_assert(R > 0 && C > 0);
  static constexpr int kRows = R, kCols = C, kSize = R * C;
  using Scalar = S;

  S m[R * C];  // column-major

  static constexpr Mat zero() {
    Mat a;
#pragma GCC unroll 64
    for (int i = 0; i < kSize; ++i) a.m[i] = S(0.0);
    return a;
  }
  static constexpr Mat constant(const S& s) {
    Mat a;
#pragma GCC unroll 64
    for (int i = 0; i < kSize; ++i) a.m[i] = s;
    return a;
  }
  static constexpr Mat identity() {
    Mat a = zero();
    constexpr int kDiagonal = R < C ? R : C;  // NOLINT(bugprone-branch-clone): where R is C
#pragma GCC unroll 64
    for (int i = 0; i < kDiagonal; ++i) a(i, i) = S(1.0);
    return a;
  }
  // The i-th unit vector, for columns.
  static constexpr Mat unit(int i) {
    Mat a = zero();
    a.m[i] = S(1.0);
    return a;
  }

  constexpr S& operator()(int i, int j) { return m[j * R + i]; }
  constexpr const S& operator()(int i, int j) const { return m[j * R + i]; }
  constexpr S& operator[](int i) { return m[i]; }
  constexpr const S& operator[](int i) const { return m[i]; }
  constexpr S* data() { return m; }
  constexpr const S* data() const { return m; }
  constexpr const S& x() const { return m[0]; }
  constexpr const S& y() const { return m[1]; }
  constexpr const S& z() const { return m[2]; }

  constexpr Mat& operator+=(const Mat& b) {
#pragma GCC unroll 64
    for (int i = 0; i < kSize; ++i) m[i] = m[i] + b.m[i];
    return *this;
  }
  constexpr Mat& operator-=(const Mat& b) {
#pragma GCC unroll 64
    for (int i = 0; i < kSize; ++i) m[i] = m[i] - b.m[i];
    return *this;
  }
  constexpr Mat& operator*=(const S& s) {
#pragma GCC unroll 64
    for (int i = 0; i < kSize; ++i) m[i] = m[i] * s;
    return *this;
  }
  friend constexpr Mat operator+(Mat a, const Mat& b) { return a += b; }
  friend constexpr Mat operator-(Mat a, const Mat& b) { return a -= b; }
  friend constexpr Mat operator-(Mat a) {
#pragma GCC unroll 64
    for (int i = 0; i < kSize; ++i) a.m[i] = -a.m[i];
    return a;
  }
  friend constexpr Mat operator*(Mat a, const S& s) { return a *= s; }
  friend constexpr Mat operator*(const S& s, Mat a) { return a *= s; }
  friend constexpr Mat operator/(Mat a, const S& s) { return a *= S(1.0) / s; }
  friend constexpr bool operator==(const Mat&, const Mat&) = default;

  constexpr Mat<S, C, R> transposed() const {
    Mat<S, C, R> t;
#pragma GCC unroll 64
    for (int j = 0; j < C; ++j)
#pragma GCC unroll 64
      for (int i = 0; i < R; ++i) t(j, i) = (*this)(i, j);
    return t;
  }
  template <int BR, int BC>
  constexpr Mat<S, BR, BC> block(int i0, int j0) const {
    Mat<S, BR, BC> b;
#pragma GCC unroll 64
    for (int j = 0; j < BC; ++j)
#pragma GCC unroll 64
      for (int i = 0; i < BR; ++i) b(i, j) = (*this)(i0 + i, j0 + j);
    return b;
  }
  template <int BR, int BC>
  constexpr void set_block(int i0, int j0, const Mat<S, BR, BC>& b) {
#pragma GCC unroll 64
    for (int j = 0; j < BC; ++j)
#pragma GCC unroll 64
      for (int i = 0; i < BR; ++i) (*this)(i0 + i, j0 + j) = b(i, j);
  }
  // Rows [i0, i0 + N) of a column vector.
  template <int N>
  constexpr Mat<S, N, 1> segment(int i0) const {
    static_assert(C == 1);
    return block<N, 1>(i0, 0);
  }
  template <int N>
  constexpr void set_segment(int i0, const Mat<S, N, 1>& b) {
    static_assert(C == 1);
    set_block(i0, 0, b);
  }
  constexpr Mat<S, R, 1> col(int j) const { return block<R, 1>(0, j); }

  constexpr S dot(const Mat& b) const {
    S s = m[0] * b.m[0];
#pragma GCC unroll 64
    for (int i = 1; i < kSize; ++i) s = s + m[i] * b.m[i];
    return s;
  }
  constexpr S squared_norm() const { return dot(*this); }
  S norm() const {
    using std::sqrt;
    return sqrt(squared_norm());
  }

  // Element by element to another scalar, e.g. double → Dual (derivatives zero) or double → Pack (all lanes equal).
  template <class T>
  constexpr Mat<T, R, C> cast() const {
    Mat<T, R, C> b;
#pragma GCC unroll 64
    for (int i = 0; i < kSize; ++i) b.m[i] = T(m[i]);
    return b;
  }
};

template <class S, int R, int K, int C>
constexpr Mat<S, R, C> operator*(const Mat<S, R, K>& a, const Mat<S, K, C>& b) {
  Mat<S, R, C> c;
#pragma GCC unroll 64
  for (int j = 0; j < C; ++j)
#pragma GCC unroll 64
    for (int i = 0; i < R; ++i) {
      S s = a(i, 0) * b(0, j);
#pragma GCC unroll 64
      for (int k = 1; k < K; ++k) s = s + a(i, k) * b(k, j);
      c(i, j) = s;
    }
  return c;
}

// A measurement in double beside a value over another scalar: `pose.translation() - p_world_beacon`.
template <class S, int R, int C>
requires(!std::is_same_v<S, double>) constexpr Mat<S, R, C> operator-(const Mat<S, R, C>& a,
                                                                      const Mat<double, R, C>& b) {
  return a - b.template cast<S>();
}
template <class S, int R, int C>
requires(!std::is_same_v<S, double>) constexpr Mat<S, R, C> operator-(const Mat<double, R, C>& a,
                                                                      const Mat<S, R, C>& b) {
  return a.template cast<S>() - b;
}
template <class S, int R, int C>
requires(!std::is_same_v<S, double>) constexpr Mat<S, R, C> operator+(const Mat<S, R, C>& a,
                                                                      const Mat<double, R, C>& b) {
  return a + b.template cast<S>();
}
template <class S, int R, int K, int C>
requires(!std::is_same_v<S, double>) constexpr Mat<S, R, C> operator*(const Mat<double, R, K>& a,
                                                                      const Mat<S, K, C>& b) {
  return a.template cast<S>() * b;
}

template <class S, int N>
using Vec = Mat<S, N, 1>;
using Vec1d = Vec<double, 1>;
using Vec2d = Vec<double, 2>;
using Vec3d = Vec<double, 3>;
using Vec4d = Vec<double, 4>;
using Vec6d = Vec<double, 6>;
using Mat2d = Mat<double, 2, 2>;
using Mat3d = Mat<double, 3, 3>;
using Mat6d = Mat<double, 6, 6>;

template <class S>
constexpr Vec<S, 3> cross(const Vec<S, 3>& a, const Vec<S, 3>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

template <class S, int R, int C>
std::ostream& operator<<(std::ostream& out, const Mat<S, R, C>& a) {
#pragma GCC unroll 64
  for (int i = 0; i < R; ++i)
#pragma GCC unroll 64
    for (int j = 0; j < C; ++j) out << a(i, j) << (j + 1 < C ? " " : (i + 1 < R ? "\n" : ""));
  return out;
}

static_assert(std::is_trivially_copyable_v<Mat<double, 3, 3>>);

}  // namespace oriel
