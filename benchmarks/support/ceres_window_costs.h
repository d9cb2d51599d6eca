// The factors of the window as cost functions of Ceres, by hand: analytic Jacobians in fixed sizes, nothing allocated,
// the same formulas and the same whitening as on Oriel's side. Parameter blocks: a pose is the seven numbers of Pose3d,
// velocity and biases are one block of nine, as VINS-Mono has them; an inverse depth is one number.
//
// Jacobians are by the tangent, and filled up with a column of zeros: the manifold's PlusJacobian is [I; 0], so that
// their product is what Ceres wants, and costs next to nothing.
#pragma once
#include <ceres/ceres.h>

#include <cstring>

#include "oriel/residual/imu_residual.h"
#include "oriel/residual/reprojection.h"

namespace oriel::benchmark {

// The block of velocity and biases, [v; b_gyro; b_accel].
struct Speed {
  Velocity3d v;
  ImuBiasd bias;
};
static_assert(sizeof(Pose3d) == 7 * sizeof(double) && sizeof(Speed) == 9 * sizeof(double));

class PoseManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override {
    Vec6d d;
    std::memcpy(d.m, delta, sizeof(d.m));
    *reinterpret_cast<Pose3d*>(x_plus_delta) = reinterpret_cast<const Pose3d*>(x)->plus(d);
    return true;
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    std::memset(jacobian, 0, 42 * sizeof(double));
    for (int i = 0; i < 6; ++i) jacobian[i * 6 + i] = 1.0;
    return true;
  }
  bool Minus(const double*, const double*, double*) const override { return false; }  // nobody asks
  bool MinusJacobian(const double*, double*) const override { return false; }
};

// A value, and where Jacobians are taken: `first`, once a prior has fixed it.
template <class V>
struct Evaluated {
  const V* first = nullptr;
  const V& at(const double* x) const { return *reinterpret_cast<const V*>(x); }
  const V& jacobian_at(const double* x) const { return first != nullptr ? *first : at(x); }
};

// J (D × C by columns) into Ceres's rows of `stride` numbers, from column `column` on; zeros beyond are the caller's.
template <int D, int C>
inline void put(const Mat<double, D, C>& J, double scale, int stride, int column, double* out) {
  for (int i = 0; i < D; ++i)
    for (int j = 0; j < C; ++j) out[i * stride + column + j] = scale * J(i, j);
}

template <class Reprojection>
class AnchoredCost final : public ceres::SizedCostFunction<Reprojection::kDim, 7, 7, 1> {
 public:
  static constexpr int kDim = Reprojection::kDim;
  AnchoredCost(const Reprojection& residual, double weight, const StereoRigd* rig, Evaluated<Pose3d> a,
               Evaluated<Pose3d> b)
      : residual_(residual), weight_(weight), rig_(rig), a_(a), b_(b) {}

  bool Evaluate(double const* const* p, double* residuals, double** jacobians) const override {
    const InverseDepthd& depth = *reinterpret_cast<const InverseDepthd*>(p[2]);
    Vec<double, kDim> r;
    bool valid = true;
    if (jacobians != nullptr) {
      Mat<double, kDim, 6> J_a, J_b;
      Mat<double, kDim, 1> J_depth;
      valid = residual_.evaluate(a_.jacobian_at(p[0]), b_.jacobian_at(p[1]), depth, *rig_, r, &J_a, &J_b, &J_depth);
      put_pose(J_a, jacobians[0]);
      put_pose(J_b, jacobians[1]);
      if (jacobians[2] != nullptr) put(J_depth, weight_, 1, 0, jacobians[2]);
    }
    if (jacobians == nullptr || a_.first != nullptr || b_.first != nullptr)
      valid = residual_.evaluate(a_.at(p[0]), b_.at(p[1]), depth, *rig_, r, nullptr, nullptr, nullptr) && valid;
    for (int i = 0; i < kDim; ++i) residuals[i] = weight_ * r[i];
    return valid;
  }

 private:
  void put_pose(const Mat<double, kDim, 6>& J, double* out) const {
    if (out == nullptr) return;
    put(J, weight_, 7, 0, out);
    for (int i = 0; i < kDim; ++i) out[i * 7 + 6] = 0.0;
  }
  Reprojection residual_;
  double weight_;
  const StereoRigd* rig_;
  Evaluated<Pose3d> a_, b_;
};

class AnchorCost final : public ceres::SizedCostFunction<2, 1> {
 public:
  AnchorCost(const AnchorReprojectiond& residual, double weight, const StereoRigd* rig)
      : residual_(residual), weight_(weight), rig_(rig) {}
  bool Evaluate(double const* const* p, double* residuals, double** jacobians) const override {
    Vec2d r;
    Mat<double, 2, 1> J;
    const bool wanted = jacobians != nullptr && jacobians[0] != nullptr;
    const bool valid =
        residual_.evaluate(*reinterpret_cast<const InverseDepthd*>(p[0]), *rig_, r, wanted ? &J : nullptr);
    for (int i = 0; i < 2; ++i) {
      residuals[i] = weight_ * r[i];
      if (wanted) jacobians[0][i] = weight_ * J[i];
    }
    return valid;
  }

 private:
  AnchorReprojectiond residual_;
  double weight_;
  const StereoRigd* rig_;
};

class ImuCost final : public ceres::SizedCostFunction<15, 7, 9, 7, 9> {
 public:
  ImuCost(const PreintegratedImud* motion, const FullNoise<15>* noise, Evaluated<Pose3d> x_i, Evaluated<Speed> s_i,
          Evaluated<Pose3d> x_j, Evaluated<Speed> s_j)
      : motion_(motion), noise_(noise), x_i_(x_i), s_i_(s_i), x_j_(x_j), s_j_(s_j) {}
  bool Evaluate(double const* const* p, double* residuals, double** jacobians) const override;

 private:
  const PreintegratedImud* motion_;
  const FullNoise<15>* noise_;
  Evaluated<Pose3d> x_i_;
  Evaluated<Speed> s_i_;
  Evaluated<Pose3d> x_j_;
  Evaluated<Speed> s_j_;
};

}  // namespace oriel::benchmark
