#include "benchmarks/support/ceres_files.h"

#include <array>
#include <cmath>

#include "benchmarks/support/ceres_window_costs.h"
#include "benchmarks/support/clocks.h"
#include "oriel/residual/noise.h"
#include "oriel/residual/pose_graph.h"

namespace oriel::benchmark {
namespace {

// A planar pose is [x y θ] as in the file, and steps are added: no manifold at all. Oriel's Jacobians are by the body's
// own translation, which R turns into the world's.
class PlanarEdgeCost final : public ceres::SizedCostFunction<3, 3, 3> {
 public:
  explicit PlanarEdgeCost(const PoseGraphFile::PlanarEdge& e)
      : residual_{pose(e.measurement.data())}, noise_(Information(information_matrix(e))) {}
  bool Evaluate(double const* const* p, double* residuals, double** jacobians) const override {
    const Pose2d a = pose(p[0]), b = pose(p[1]);
    Vec3d r;
    Mat3d J_a, J_b;
    residual_.evaluate(a, b, r, jacobians != nullptr ? &J_a : nullptr, jacobians != nullptr ? &J_b : nullptr);
    FullNoise<3>::whiten(noise_.w, r);
    for (int i = 0; i < 3; ++i) residuals[i] = r[i];
    if (jacobians == nullptr) return true;
    put(J_a, a.R, jacobians[0]);
    put(J_b, b.R, jacobians[1]);
    return true;
  }

 private:
  static Pose2d pose(const double* p) { return {Rot2d::exp(p[2]), {{p[0], p[1]}}}; }
  void put(Mat3d& J, const Rot2d& R, double* out) const {
    if (out == nullptr) return;
    FullNoise<3>::whiten(noise_.w, J);
    for (int i = 0; i < 3; ++i) {
      out[3 * i] = J(i, 1) * R.c - J(i, 2) * R.s;
      out[3 * i + 1] = J(i, 1) * R.s + J(i, 2) * R.c;
      out[3 * i + 2] = J(i, 0);
    }
  }
  PoseGraphEdge2d residual_;
  FullNoise<3> noise_;
};

Pose3d pose_of(const PoseGraphFile::SpatialPose& p) { return {Rot3d{p.qx, p.qy, p.qz, p.qw}, p.t}; }

class SpatialEdgeCost final : public ceres::SizedCostFunction<6, 7, 7> {
 public:
  explicit SpatialEdgeCost(const PoseGraphFile::SpatialEdge& e)
      : residual_{pose_of(e.measurement)}, noise_(Information(information_matrix(e))) {}
  bool Evaluate(double const* const* p, double* residuals, double** jacobians) const override {
    const auto &a = *reinterpret_cast<const Pose3d*>(p[0]), &b = *reinterpret_cast<const Pose3d*>(p[1]);
    Vec6d r;
    Mat6d J_a, J_b;
    residual_.evaluate(a, b, r, jacobians != nullptr ? &J_a : nullptr, jacobians != nullptr ? &J_b : nullptr);
    FullNoise<6>::whiten(noise_.w, r);
    for (int i = 0; i < 6; ++i) residuals[i] = r[i];
    if (jacobians == nullptr) return true;
    put_pose(J_a, jacobians[0]);
    put_pose(J_b, jacobians[1]);
    return true;
  }

 private:
  void put_pose(Mat6d& J, double* out) const {
    if (out == nullptr) return;
    FullNoise<6>::whiten(noise_.w, J);
    put(J, 1.0, 7, 0, out);
    for (int i = 0; i < 6; ++i) out[7 * i + 6] = 0.0;
  }
  PoseGraphEdge3d residual_;
  FullNoise<6> noise_;
};

// R(w) and Jr(w) at once, from one sine and cosine (Rodrigues; Solà et al., arXiv:1812.01537, eq. 134 and 143).
void rotation(const Vec3d& w, Mat3d& R, Mat3d* Jr) {
  const double t = w.squared_norm();
  double A = 1.0, B = 0.5, C = 1.0 / 6.0;
  if (t > 1e-12) {
    const double theta = std::sqrt(t), s = std::sin(theta), c = std::cos(theta);
    A = s / theta, B = (1.0 - c) / t, C = (theta - s) / (t * theta);
  }
  const Mat3d W = hat(w), W2 = W * W;
  R = Mat3d::identity() + W * A + W2 * B;
  if (Jr != nullptr) *Jr = Mat3d::identity() - W * B + W2 * C;
}

// A camera is the file's nine numbers, and steps are added (Ceres's own bundle_adjuster does so by default).
class BalCost final : public ceres::SizedCostFunction<2, 9, 3> {
 public:
  BalCost(double u, double v) : u_(u), v_(v) {}
  bool Evaluate(double const* const* parameters, double* r, double** jacobians) const override {
    const double *c = parameters[0], *x = parameters[1];
    const Vec3d X = {{x[0], x[1], x[2]}}, w = {{c[0], c[1], c[2]}};
    Mat3d R, Jr;
    rotation(w, R, jacobians != nullptr ? &Jr : nullptr);
    const Vec3d P = R * X + Vec3d{{c[3], c[4], c[5]}};
    const double m = -1.0 / P[2], p = P[0] * m, q = P[1] * m, s = p * p + q * q;
    const double f = c[6], d = 1.0 + s * (c[7] + s * c[8]);
    r[0] = f * d * p - u_, r[1] = f * d * q - v_;
    if (jacobians == nullptr) return true;
    const double slope = 2.0 * f * (c[7] + 2.0 * c[8] * s) * m, a = f * d * m + slope * p * p, b = slope * p * q;
    const double e = f * d * m + slope * q * q;
    const Mat<double, 2, 3> J_P = {{a, b, b, e, a * p + b * q, b * p + e * q}}, J_X = J_P * R;
    if (jacobians[1] != nullptr) put(J_X, 1.0, 3, 0, jacobians[1]);
    if (jacobians[0] == nullptr) return true;
    put(-(times_hat(J_X, X) * Jr), 1.0, 9, 0, jacobians[0]);
    put(J_P, 1.0, 9, 3, jacobians[0]);
    put(Mat<double, 2, 3>{{d * p, d * q, f * s * p, f * s * q, f * s * s * p, f * s * s * q}}, 1.0, 9, 6, jacobians[0]);
    return true;
  }

 private:
  double u_, v_;
};

class Recorder final : public ceres::IterationCallback {
 public:
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& s) override {
    trace.points.push_back({wall_seconds() - began, s.cost});
    return ceres::SOLVER_CONTINUE;
  }
  Trace trace;
  double began = wall_seconds();
};

Trace run(ceres::Problem& problem, const CeresFileSetting& setting, const CeresFileOptions& options,
          std::shared_ptr<ceres::ParameterBlockOrdering> order) {
  ceres::Solver::Options o;
  o.linear_solver_type = setting.solver;
  o.trust_region_strategy_type = setting.strategy;
  o.dogleg_type = setting.dogleg;
  o.initial_trust_region_radius = setting.radius;
  o.max_trust_region_radius = 1e20;
  o.dense_linear_algebra_library_type = setting.dense;
  o.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
  o.linear_solver_ordering = std::move(order);
  o.num_threads = options.threads;
  o.max_num_iterations = options.max_iterations;
  o.function_tolerance = options.function_tolerance;
  o.gradient_tolerance = o.parameter_tolerance = 1e-12;
  o.logging_type = ceres::SILENT;
  Recorder recorder;
  o.callbacks.push_back(&recorder);
  ceres::Solver::Summary summary;
  recorder.began = wall_seconds();
  ceres::Solve(o, &problem, &summary);
  recorder.trace.total = wall_seconds() - recorder.began;
  recorder.trace.iterations = static_cast<int>(summary.iterations.size()) - 1;
  return recorder.trace;
}

template <class Block>
void hold(ceres::Problem& problem, const PoseGraphFile& file, std::vector<Block>& poses) {
  const auto number = [](Block& b) { return reinterpret_cast<double*>(&b); };
  for (const std::int32_t i : file.fixed) problem.SetParameterBlockConstant(number(poses[i]));
  if (file.fixed.empty()) problem.SetParameterBlockConstant(number(poses[0]));
}

Trace solve_spatial(const PoseGraphFile& file, const CeresFileSetting& setting, const CeresFileOptions& options) {
  PoseManifold manifold;
  std::vector<Pose3d> poses;
  for (const auto& p : file.spatial_poses) poses.push_back(pose_of(p));
  ceres::Problem::Options own;
  own.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(own);
  const auto number = [&poses](std::int32_t i) { return reinterpret_cast<double*>(&poses[i]); };
  for (std::int32_t i = 0; i < std::ssize(poses); ++i) problem.AddParameterBlock(number(i), 7, &manifold);
  for (const auto& e : file.spatial_edges)
    problem.AddResidualBlock(new SpatialEdgeCost(e), nullptr, number(e.from), number(e.to));
  hold(problem, file, poses);
  return run(problem, setting, options, nullptr);
}

}  // namespace

std::vector<CeresFileSetting> ceres_settings_for_pose_graphs() {
  return {
      {"lm", ceres::SPARSE_NORMAL_CHOLESKY, ceres::LEVENBERG_MARQUARDT, ceres::TRADITIONAL_DOGLEG, 1e16, ceres::EIGEN},
      {"dogleg", ceres::SPARSE_NORMAL_CHOLESKY, ceres::DOGLEG, ceres::TRADITIONAL_DOGLEG, 1e16, ceres::EIGEN}};
}

std::vector<CeresFileSetting> ceres_settings_for_bundle_adjustment() {
  const auto lm = ceres::LEVENBERG_MARQUARDT, dogleg = ceres::DOGLEG;
  return {{"dense_schur,lm", ceres::DENSE_SCHUR, lm, ceres::TRADITIONAL_DOGLEG, 1e4, ceres::EIGEN},
          {"dense_schur,lapack,lm", ceres::DENSE_SCHUR, lm, ceres::TRADITIONAL_DOGLEG, 1e4, ceres::LAPACK},
          {"dense_schur,subspace_dogleg", ceres::DENSE_SCHUR, dogleg, ceres::SUBSPACE_DOGLEG, 1e4, ceres::EIGEN},
          {"sparse_schur,lm", ceres::SPARSE_SCHUR, lm, ceres::TRADITIONAL_DOGLEG, 1e4, ceres::EIGEN}};
}

Trace solve_with_ceres(const PoseGraphFile& file, const CeresFileSetting& setting, const CeresFileOptions& options) {
  if (file.is_3d) return solve_spatial(file, setting, options);
  std::vector<Vec3d> poses = file.planar_poses;
  ceres::Problem problem;
  for (const auto& e : file.planar_edges)
    problem.AddResidualBlock(new PlanarEdgeCost(e), nullptr, poses[e.from].data(), poses[e.to].data());
  hold(problem, file, poses);
  return run(problem, setting, options, nullptr);
}

Trace solve_with_ceres(const BalFile& file, const CeresFileSetting& setting, const CeresFileOptions& options) {
  auto cameras = file.cameras;
  auto points = file.points;
  ceres::Problem problem;
  for (const auto& o : file.observations)
    problem.AddResidualBlock(new BalCost(o.u, o.v), nullptr, cameras[o.camera].data(), points[o.point].data());
  auto order = std::make_shared<ceres::ParameterBlockOrdering>();
  for (auto& p : points) order->AddElementToGroup(p.data(), 0);
  for (auto& c : cameras) order->AddElementToGroup(c.data(), 1);
  return run(problem, setting, options, std::move(order));
}

}  // namespace oriel::benchmark
