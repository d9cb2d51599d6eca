#include "oriel/run/two_frame_problem.h"

#include <cmath>

#include "oriel/residual/matched_point.h"
#include "oriel/residual/registration.h"

namespace oriel::run_detail {

TwoFrameProblem::TwoFrameProblem(const TwoFrameTask::Context& context, const TwoFrameInput& input, const Pose3d& T_a_b)
    : context_(context), input_(input), within_(input.matches.size(), 0) {
  if (context.options.coordinates == MatchCoordinates::world) T_base_a_ = input.T_world_a;
  T_base_b_ = T_base_a_ * T_a_b;
}

Pose3d TwoFrameProblem::T_world_b() const {
  if (context_.options.coordinates == MatchCoordinates::world) return T_base_b_;
  const Pose3d T = input_.T_world_a * T_base_b_;
  return {T.R.normalized(), T.t};  // of products of thousands of frames
}

template <class R, class Noise>
bool TwoFrameProblem::add_if_within(const R& residual, const Noise& noise, const Mat<double, R::kDim, 1>& r, bool valid,
                                    GraphEdit* edit) {
  if (!valid || !noise.valid()) return false;
  Mat<double, R::kDim, 1> white = r;
  Noise::whiten(noise.w, white);
  if (!(white.norm() <= context_.options.gate * std::sqrt(static_cast<double>(R::kDim)))) return false;
  if (edit == nullptr) return true;
  const Loss loss = Huber(context_.options.huber);
  if constexpr (R::Variables::kCount == 3)
    edit->add(residual, noise, loss, a_, b_, rig_);
  else
    edit->add(residual, noise, loss, a_, b_);
  return true;
}

bool TwoFrameProblem::add_points(const PointMatch& m, GraphEdit* edit) {
  const PointToPointd residual{m.p_a, m.p_b};
  Vec3d r;
  const bool valid = m.has_point != 0 && residual.evaluate(T_base_a_, T_base_b_, r, nullptr, nullptr);
  const Mat3d R_ab = (T_base_a_.R.inverse() * T_base_b_.R).matrix();
  return add_if_within(residual, Covariance(m.covariance_a + R_ab * m.covariance_b * R_ab.transposed()), r, valid,
                       edit);
}

template <int D>
bool TwoFrameProblem::add_seen(const PointMatch& m, const Vec<double, D>& seen, const Mat<double, D, D>& V,
                               GraphEdit* edit) {
  const MatchedPoint<double, D> residual{m.p_a, seen};
  Vec<double, D> r;
  Mat<double, D, 6> J_a, J_b;
  const bool valid = residual.evaluate(T_base_a_, T_base_b_, context_.rig, r, &J_a, &J_b);
  const auto M = J_a.template block<D, 3>(0, 3);
  return add_if_within(residual, Covariance(V + M * m.covariance_a * M.transposed()), r, valid, edit);
}

bool TwoFrameProblem::add(const PointMatch& m, GraphEdit* edit) {
  const MatchResidual kind = context_.options.residual;
  if (kind == MatchResidual::points) return add_points(m, edit);
  if (kind == MatchResidual::pixel || m.has_right == 0) return add_seen<2>(m, m.pixel0, m.covariance0, edit);
  if (kind == MatchResidual::disparity) {
    // u0 is part of the disparity: their errors go together.
    Mat3d V = Mat3d::zero();
    V.set_block(0, 0, m.covariance0);
    for (int i = 0; i < 2; ++i) V(i, 2) = V(2, i) = m.covariance0(i, 0);
    V(2, 2) = m.covariance0(0, 0) + m.covariance1(0, 0);
    return add_seen<3>(m, {{m.pixel0[0], m.pixel0[1], m.pixel0[0] - m.pixel1[0]}}, V, edit);
  }
  Mat<double, 4, 4> V = Mat<double, 4, 4>::zero();
  V.set_block(0, 0, m.covariance0);
  V.set_block(2, 2, m.covariance1);
  return add_seen<4>(m, {{m.pixel0[0], m.pixel0[1], m.pixel1[0], m.pixel1[1]}}, V, edit);
}

int TwoFrameProblem::weigh() {
  graph_.emplace();
  GraphEdit edit = graph_->edit();
  a_ = edit.add(T_base_a_);
  edit.fix(a_);
  b_ = edit.add(T_base_b_);
  if (context_.options.residual != MatchResidual::points) rig_ = edit.add(context_.rig);
  int within = 0;
  for (const PointMatch& m : input_.matches) within += add(m, &edit) ? 1 : 0;
  if (!graph_->apply(edit)) return 0;  // numbers that are not finite
  return within;
}

int TwoFrameProblem::solve() {
  NativeEngine engine(*graph_);
  SolveOptions options;
  options.max_iterations = context_.options.max_iterations;
  options.trace = false;
  summary_ = engine.solve(options);
  if (summary_.failed()) return summary_.iterations;
  T_base_b_ = graph_->value(b_);
  covariance_ = engine.covariance(b_);
  return summary_.iterations;
}

void TwoFrameProblem::judge() {
  inliers_ = 0;
  for (std::size_t k = 0; k < within_.size(); ++k) {
    within_[k] = add(input_.matches[k], nullptr) ? 1 : 0;
    inliers_ += within_[k];
  }
}

Result<Mat6d> TwoFrameProblem::covariance() const {
  if (!covariance_) return covariance_;
  return (*covariance_ + covariance_->transposed()) * 0.5;  // to the bit
}

}  // namespace oriel::run_detail
