#include "benchmarks/support/ceres_window.h"

#include "benchmarks/support/clocks.h"

namespace oriel::benchmark {
namespace {

class PriorCost final : public ceres::CostFunction {
 public:
  explicit PriorCost(const WindowPrior& prior) : prior_(prior) {
    set_num_residuals(static_cast<int>(prior.d.size()));
    for (const auto& b : prior.blocks) mutable_parameter_block_sizes()->push_back(b.speed ? 9 : 7);
  }
  bool Evaluate(double const* const* p, double* residuals, double** jacobians) const override {
    const int rows = num_residuals();
    Eigen::VectorXd e(prior_.R.cols());
    for (std::size_t k = 0; k < prior_.blocks.size(); ++k)
      WindowPrior::error(prior_.blocks[k], p[k], e.data() + prior_.blocks[k].column);
    Eigen::Map<Eigen::VectorXd> r(residuals, rows);
    r = prior_.d;
    r.noalias() += prior_.R.triangularView<Eigen::Upper>() * e;
    for (std::size_t k = 0; jacobians != nullptr && k < prior_.blocks.size(); ++k) {
      if (jacobians[k] == nullptr) continue;
      const auto& b = prior_.blocks[k];
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> J(jacobians[k], rows,
                                                                                           b.speed ? 9 : 7);
      J.leftCols(b.dim()) = prior_.R.middleCols(b.column, b.dim());
      if (!b.speed) J.col(6).setZero();
    }
    return true;
  }

 private:
  const WindowPrior& prior_;
};

ceres::LossFunction* make_loss(const Loss& loss) {
  if (loss.kind == LossKind::huber) return new ceres::HuberLoss(loss.scale);
  if (loss.kind == LossKind::cauchy) return new ceres::CauchyLoss(loss.scale);
  return nullptr;
}

}  // namespace

std::vector<CeresSetting> ceres_window_settings() {
  const auto lm = ceres::LEVENBERG_MARQUARDT;
  return {{"dense_schur,eigen", ceres::DENSE_SCHUR, ceres::EIGEN, true, lm},
          {"dense_schur,lapack", ceres::DENSE_SCHUR, ceres::LAPACK, true, lm},
          {"dense_schur,eigen,unscaled", ceres::DENSE_SCHUR, ceres::EIGEN, false, lm},
          {"dense_schur,eigen,dogleg", ceres::DENSE_SCHUR, ceres::EIGEN, true, ceres::DOGLEG},
          {"sparse_schur", ceres::SPARSE_SCHUR, ceres::EIGEN, true, lm}};
}

void WindowPrior::error(const Block& block, const double* x, double* e) {
  if (!block.speed) {
    const Vec6d d = reinterpret_cast<const Pose3d*>(x)->minus(block.pose);
    std::memcpy(e, d.m, sizeof(d.m));
  } else {
    const double* from = reinterpret_cast<const double*>(&block.value);
    for (int i = 0; i < 9; ++i) e[i] = x[i] - from[i];
  }
}

CeresWindow::CeresWindow(const WindowData& data, const WindowOptions& options, const CeresSetting& setting)
    : data_(data), options_(options), setting_(setting), loss_(make_loss(options.loss)) {
  states_.resize(static_cast<std::size_t>(options.window));
  depths_.resize(data.stream.tracks.size());
  for (std::size_t i = 0; i < depths_.size(); ++i) depths_[i] = data.stream.tracks[i].first_guess;
}

SlideReport CeresWindow::slide() {
  SlideReport report;
  const double cpu0 = cpu_seconds(), t0 = wall_seconds();
  const int k = next_++;
  if (k == 0)
    start();
  else
    predict(k, data_.stream.keyframes[k].motion.motion);
  add_views(k);
  solve(frame_at(k), t0, report);
  const double t2 = wall_seconds();
  if (next_ >= options_.window) fold_oldest();
  const double t3 = wall_seconds();
  report.cpu = cpu_seconds() - cpu0;
  report.wall = t3 - t0;
  report.fold = t3 - t2;
  return report;
}

// The frame stands where the next keyframe will.
SlideReport CeresWindow::pass() {
  SlideReport report;
  const double cpu0 = cpu_seconds(), t0 = wall_seconds();
  const int k = next_++ - 1;
  const SimulatedFrame& frame = data_.stream.between[k];
  predict(k + 1, frame.motion.motion);
  solve({&frame.motion.motion, &data_.between_noise[k], &data_.between_views[k]}, t0, report);
  --next_;
  report.cpu = cpu_seconds() - cpu0;
  report.wall = wall_seconds() - t0;
  return report;
}

void CeresWindow::solve(const Frame& newest, double t0, SlideReport& report) {
  ceres::Problem::Options own;
  own.cost_function_ownership = ceres::TAKE_OWNERSHIP;
  own.loss_function_ownership = own.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  own.disable_all_safety_checks = true;
  ceres::Problem problem(own);
  auto order = std::make_shared<ceres::ParameterBlockOrdering>();
  build(newest, problem, *order);
  const double t1 = wall_seconds();
  run(problem, order, report);
  report.build = t1 - t0;
  report.solve = wall_seconds() - t1;
  report.reprojections = problem.NumResidualBlocks();
  report.residual_rows = problem.NumResiduals();
  report.prior_cols = prior_ ? static_cast<int>(prior_->R.cols()) : 0;
}

void CeresWindow::start() {
  const FirstState first = first_state(data_);
  State& s = state(0);
  s = {first.T_world_body, first.T_world_body, {first.v, first.bias}, {first.v, first.bias}, true, true};
  prior_ = std::make_unique<WindowPrior>();
  prior_->blocks = {{0, false, s.pose, s.speed, 0}, {0, true, s.pose, s.speed, 6}};
  Eigen::VectorXd sigma(15);
  sigma << kStartRotation, kStartRotation, kStartRotation, kStartPosition, kStartPosition, kStartPosition,
      kStartVelocity, kStartVelocity, kStartVelocity, kStartGyroBias, kStartGyroBias, kStartGyroBias, kStartAccelBias,
      kStartAccelBias, kStartAccelBias;
  prior_->R = sigma.cwiseInverse().asDiagonal();
  prior_->d = Eigen::VectorXd::Zero(15);
}

void CeresWindow::predict(int k, const PreintegratedImud& motion) {
  const State& last = state(k - 1);
  const PredictedState next = predict_state(motion, last.pose, last.speed.v, last.speed.bias);
  const ImuBiasd bias = last.speed.bias;
  state(k) = {next.T_world_body, {}, {next.v, bias}, {}, false, false};
}

void CeresWindow::add_views(int k) {
  views_.emplace_back();
  for (const View& view : data_.views[k]) {
    const int anchor = data_.stream.tracks[view.track].anchor;
    views_[views_.size() - 1 - static_cast<std::size_t>(k - anchor)].push_back(view);
  }
}

Evaluated<Pose3d> CeresWindow::pose_at(int k) const {
  const State& s = state(k);
  return {options_.first_estimates && s.pose_touched ? &s.first_pose : nullptr};
}
Evaluated<Speed> CeresWindow::speed_at(int k) const {
  const State& s = state(k);
  return {options_.first_estimates && s.speed_touched ? &s.first_speed : nullptr};
}

void CeresWindow::build(const Frame& newest, ceres::Problem& problem, ceres::ParameterBlockOrdering& order) {
  const int first = std::max(0, next_ - options_.window);
  for (int k = first; k < next_; ++k) {
    State& s = state(k);
    auto* pose = reinterpret_cast<double*>(&s.pose);
    auto* speed = reinterpret_cast<double*>(&s.speed);
    problem.AddParameterBlock(pose, 7, &manifold_);
    problem.AddParameterBlock(speed, 9);
    order.AddElementToGroup(pose, 1);
    order.AddElementToGroup(speed, 1);
    if (k == first) continue;
    State& before = state(k - 1);
    const Frame frame = k + 1 == next_ ? newest : frame_at(k);
    auto* cost = new ImuCost(frame.motion, frame.noise, pose_at(k - 1), speed_at(k - 1), pose_at(k), speed_at(k));
    problem.AddResidualBlock(cost, nullptr, reinterpret_cast<double*>(&before.pose),
                             reinterpret_cast<double*>(&before.speed), pose, speed);
  }
  if (prior_) add_prior(problem);
  for (const auto& views : views_)
    for (const View& view : views) add_reprojection(view, problem, order);
  if (newest.views != nullptr)
    for (const View& view : *newest.views) add_reprojection(view, problem, order);
}

void CeresWindow::add_prior(ceres::Problem& problem) {
  std::vector<double*> blocks;
  for (const auto& b : prior_->blocks) {
    State& s = state(b.keyframe);
    blocks.push_back(b.speed ? reinterpret_cast<double*>(&s.speed) : reinterpret_cast<double*>(&s.pose));
  }
  problem.AddResidualBlock(new PriorCost(*prior_), nullptr, blocks);
}

void CeresWindow::add_reprojection(const View& view, ceres::Problem& problem, ceres::ParameterBlockOrdering& order) {
  const double weight = 1.0 / options_.pixel_sigma;
  const StereoRigd* rig = &data_.stream.rig;
  const SimulatedTrack& track = data_.stream.tracks[view.track];
  const SimulatedObservation& o = *view.observation;
  double* depth = &depths_[view.track];
  auto* a = reinterpret_cast<double*>(&state(track.anchor).pose);
  auto* b = reinterpret_cast<double*>(&state(view.keyframe).pose);
  if (view.keyframe == track.anchor)
    problem.AddResidualBlock(new AnchorCost({track.bearing, o.pixel1}, weight, rig), loss_.get(), depth);
  else if (options_.stereo)
    problem.AddResidualBlock(new AnchoredCost<StereoReprojectiond>({track.bearing, o.pixel0, o.pixel1}, weight, rig,
                                                                   pose_at(track.anchor), pose_at(view.keyframe)),
                             loss_.get(), a, b, depth);
  else
    problem.AddResidualBlock(new AnchoredCost<MonoReprojectiond>({track.bearing, o.pixel0}, weight, rig,
                                                                 pose_at(track.anchor), pose_at(view.keyframe)),
                             loss_.get(), a, b, depth);
  order.AddElementToGroup(depth, 0);
}

void CeresWindow::run(ceres::Problem& problem, const std::shared_ptr<ceres::ParameterBlockOrdering>& order,
                      SlideReport& report) {
  ceres::Solver::Options o;
  o.linear_solver_type = setting_.solver;
  o.dense_linear_algebra_library_type = setting_.dense;
  o.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
  o.jacobi_scaling = setting_.jacobi_scaling;
  o.trust_region_strategy_type = setting_.strategy;
  o.linear_solver_ordering = order;
  o.num_threads = 1;
  o.max_num_iterations = options_.iterations;
  o.initial_trust_region_radius = 1.0 / options_.initial_lambda;
  o.max_trust_region_radius = 1e20;
  o.function_tolerance = o.gradient_tolerance = o.parameter_tolerance = 0.0;
  o.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(o, &problem, &summary);
  if (!summary.IsSolutionUsable() && error_.empty()) error_ = summary.message;
  report.landmarks = order->GroupSize(0);
  report.initial_cost = summary.initial_cost;
  report.final_cost = summary.final_cost;
  report.iterations = static_cast<int>(summary.iterations.size()) - 1;
  report.stages.structure = summary.preprocessor_time_in_seconds + summary.postprocessor_time_in_seconds;
  report.stages.evaluate = summary.residual_evaluation_time_in_seconds;
  report.stages.linearize = summary.jacobian_evaluation_time_in_seconds;
  report.stages.solve = summary.linear_solver_time_in_seconds;
}

}  // namespace oriel::benchmark
