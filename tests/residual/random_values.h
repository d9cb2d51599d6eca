// Random values for the tests of residuals: reproducible, of a given size.
#pragma once
#include <random>

#include "oriel/manifold/bal_camera.h"
#include "oriel/manifold/se2.h"
#include "oriel/manifold/se3.h"
#include "oriel/sensor/stereo_rig.h"

namespace oriel::testing_values {

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine_); }
  double normal() { return normal_(engine_); }
  template <int N>
  Vec<double, N> normal(double sigma) {
    Vec<double, N> d;
    for (int i = 0; i < N; ++i) d[i] = sigma * normal();
    return d;
  }
  // A step from V{} with components of standard deviation sigma.
  template <class V>
  V value(double sigma) {
    return V{}.plus(normal<V::kDim>(sigma));
  }

 private:
  std::mt19937_64 engine_;
  std::normal_distribution<double> normal_;
};

// The stereo rig of EuRoC's V1_01, rounded.
inline StereoRigd euroc_like_rig() {
  StereoRigd rig;
  const Rot3d turned = Rot3d::exp({{0.0, 0.0, 1.55}});
  rig.cameras[0] = {RadTanCamerad{458.654, 457.296, 367.215, 248.375, -0.28340811, 0.07395907, 0.00019359, 1.76e-05},
                    Pose3d{turned * Rot3d::exp({{0.02, 0.01, 0.0}}), {{-0.0216, -0.0647, 0.0098}}}};
  rig.cameras[1] = {RadTanCamerad{457.587, 456.134, 379.999, 255.238, -0.28368365, 0.07451284, -0.00010473, -3.55e-05},
                    Pose3d{turned * Rot3d::exp({{0.01, 0.02, 0.01}}), {{-0.0198, 0.0453, 0.0079}}}};
  return rig;
}

}  // namespace oriel::testing_values
