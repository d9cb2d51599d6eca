#include "benchmarks/support/ceres_window_costs.h"

namespace oriel::benchmark {
namespace {

// Whitens W·J into rows of `stride` numbers; W is upper triangular, row by row.
template <int C>
void put_white(const FullNoise<15>& noise, Mat<double, 15, C>& J, int stride, int column, double* out) {
  FullNoise<15>::whiten(noise.w, J);
  put(J, 1.0, stride, column, out);
}

void put_pose(const FullNoise<15>& noise, Mat<double, 15, 6>& J, double* out) {
  if (out == nullptr) return;
  put_white(noise, J, 7, 0, out);
  for (int i = 0; i < 15; ++i) out[i * 7 + 6] = 0.0;
}

void put_speed(const FullNoise<15>& noise, Mat<double, 15, 3>& J_v, Mat<double, 15, 6>& J_b, double* out) {
  if (out == nullptr) return;
  put_white(noise, J_v, 9, 0, out);
  put_white(noise, J_b, 9, 3, out);
}

}  // namespace

bool ImuCost::Evaluate(double const* const* p, double* residuals, double** jacobians) const {
  const ImuResiduald residual{*motion_};
  Vec<double, 15> r;
  if (jacobians != nullptr) {
    Mat<double, 15, 6> J_xi, J_bi, J_xj, J_bj;
    Mat<double, 15, 3> J_vi, J_vj;
    const Speed &s_i = s_i_.jacobian_at(p[1]), &s_j = s_j_.jacobian_at(p[3]);
    residual.evaluate(x_i_.jacobian_at(p[0]), s_i.v, s_i.bias, x_j_.jacobian_at(p[2]), s_j.v, s_j.bias, r, &J_xi, &J_vi,
                      &J_bi, &J_xj, &J_vj, &J_bj);
    put_pose(*noise_, J_xi, jacobians[0]);
    put_speed(*noise_, J_vi, J_bi, jacobians[1]);
    put_pose(*noise_, J_xj, jacobians[2]);
    put_speed(*noise_, J_vj, J_bj, jacobians[3]);
  }
  const bool apart = x_i_.first != nullptr || s_i_.first != nullptr || x_j_.first != nullptr || s_j_.first != nullptr;
  if (jacobians == nullptr || apart) {
    const Speed &s_i = s_i_.at(p[1]), &s_j = s_j_.at(p[3]);
    residual.evaluate(x_i_.at(p[0]), s_i.v, s_i.bias, x_j_.at(p[2]), s_j.v, s_j.bias, r, nullptr, nullptr, nullptr,
                      nullptr, nullptr, nullptr);
  }
  FullNoise<15>::whiten(noise_->w, r);
  std::memcpy(residuals, r.m, sizeof(r.m));
  return true;
}

}  // namespace oriel::benchmark
