// Variables that are vectors: x ⊞ d = x + d. One type a meaning, so that a velocity is never taken for a point.
#pragma once
#include "oriel/manifold/manifold.h"

namespace oriel {

// A landmark in world coordinates [m].
template <class S>
struct Point3 {
  static constexpr std::string_view kName = "point3/1";
  static constexpr int kDim = 3;
  static constexpr bool kLandmark = true;
  static constexpr std::array<std::string_view, 3> kTangentNames = {"x [m]", "y [m]", "z [m]"};
  template <class T>
  using rebind = Point3<T>;
  Vec<S, 3> p = Vec<S, 3>::zero();
  Point3 plus(const Vec<S, 3>& d) const { return {p + d}; }
  Vec<S, 3> minus(const Point3& x) const { return p - x.p; }
  Mat<S, 3, 3> world_axes() const { return Mat<S, 3, 3>::identity(); }
};
using Point3d = Point3<double>;

// A landmark of the plane [m].
template <class S>
struct Point2 {
  static constexpr std::string_view kName = "point2/1";
  static constexpr int kDim = 2;
  static constexpr bool kLandmark = true;
  static constexpr std::array<std::string_view, 2> kTangentNames = {"x [m]", "y [m]"};
  template <class T>
  using rebind = Point2<T>;
  Vec<S, 2> p = Vec<S, 2>::zero();
  Point2 plus(const Vec<S, 2>& d) const { return {p + d}; }
  Vec<S, 2> minus(const Point2& x) const { return p - x.p; }
  Mat<S, 2, 2> world_axes() const { return Mat<S, 2, 2>::identity(); }
};
using Point2d = Point2<double>;

// v_world_body [m/s].
template <class S>
struct Velocity3 {
  static constexpr std::string_view kName = "velocity3/1";
  static constexpr int kDim = 3;
  static constexpr std::array<std::string_view, 3> kTangentNames = {"velocity x [m/s]", "velocity y [m/s]",
                                                                    "velocity z [m/s]"};
  template <class T>
  using rebind = Velocity3<T>;
  Vec<S, 3> v = Vec<S, 3>::zero();
  Velocity3 plus(const Vec<S, 3>& d) const { return {v + d}; }
  Vec<S, 3> minus(const Velocity3& x) const { return v - x.v; }
  Mat<S, 3, 3> world_axes() const { return Mat<S, 3, 3>::identity(); }
};
using Velocity3d = Velocity3<double>;

// Biases of an IMU in its own frame; tangent [gyroscope; accelerometer].
template <class S>
struct ImuBias {
  static constexpr std::string_view kName = "imu_bias/1";
  static constexpr int kDim = 6;
  static constexpr std::array<std::string_view, 6> kTangentNames = {
      "gyroscope bias x [rad/s]",    "gyroscope bias y [rad/s]",    "gyroscope bias z [rad/s]",
      "accelerometer bias x [m/s2]", "accelerometer bias y [m/s2]", "accelerometer bias z [m/s2]"};
  template <class T>
  using rebind = ImuBias<T>;
  Vec<S, 3> gyro = Vec<S, 3>::zero();   // [rad/s]
  Vec<S, 3> accel = Vec<S, 3>::zero();  // [m/s²]
  ImuBias plus(const Vec<S, 6>& d) const { return {gyro + d.template segment<3>(0), accel + d.template segment<3>(3)}; }
  Vec<S, 6> minus(const ImuBias& x) const {
    Vec<S, 6> d;
    d.set_segment(0, gyro - x.gyro);
    d.set_segment(3, accel - x.accel);
    return d;
  }
};
using ImuBiasd = ImuBias<double>;

// A vector without a meaning of its own, e.g. the parameters of a fitted curve.
template <class S, int N>
struct VectorN {
  static_assert(N >= 1 && N <= 9);
  static constexpr char kText[] = {'v', 'e', 'c', 't', 'o', 'r', '0' + N, '/', '1', '\0'};
  static constexpr std::string_view kName = kText;
  static constexpr int kDim = N;
  template <class T>
  using rebind = VectorN<T, N>;
  Vec<S, N> v = Vec<S, N>::zero();
  VectorN plus(const Vec<S, N>& d) const { return {v + d}; }
  Vec<S, N> minus(const VectorN& x) const { return v - x.v; }
};
template <int N>
using VectorNd = VectorN<double, N>;

}  // namespace oriel
