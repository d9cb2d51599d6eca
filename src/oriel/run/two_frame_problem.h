// The least-squares problem of a two-frame pose: one graph of two poses, of which the first is fixed. Private to
// two_frame_task.cc.
#pragma once
#include <optional>
#include <vector>

#include "oriel/graph/graph.h"
#include "oriel/run/two_frame_task.h"
#include "oriel/solve/native_engine.h"

namespace oriel::run_detail {

class TwoFrameProblem {
 public:
  // Both must outlive it.
  TwoFrameProblem(const TwoFrameTask::Context& context, const TwoFrameInput& input, const Pose3d& T_a_b);

  // Covariances of all residuals at the estimate, and which matches are within the gate; how many are. They are the
  // factors of the next solve.
  int weigh();
  // Iterations that it took.
  int solve();
  // Who is within the gate now, by the covariances of the estimate.
  void judge();

  int inliers() const { return inliers_; }
  bool is_inlier(std::size_t match) const { return within_[match] != 0; }
  const Summary& summary() const { return summary_; }
  Pose3d T_a_b() const { return T_base_a_.inverse() * T_base_b_; }
  Pose3d T_world_b() const;
  // Of T_a_b in its tangent on the right, at the last solve.
  Result<Mat6d> covariance() const;

 private:
  template <class R, class Noise>
  bool add_if_within(const R& residual, const Noise& noise, const Mat<double, R::kDim, 1>& r, bool valid,
                     GraphEdit* edit);
  bool add_points(const PointMatch& m, GraphEdit* edit);
  template <int D>
  bool add_seen(const PointMatch& m, const Vec<double, D>& seen, const Mat<double, D, D>& V, GraphEdit* edit);
  bool add(const PointMatch& m, GraphEdit* edit);

  const TwoFrameTask::Context& context_;
  const TwoFrameInput& input_;
  // Base: frame a itself, or world.
  Pose3d T_base_a_, T_base_b_;
  std::vector<std::uint8_t> within_;
  int inliers_ = 0;
  std::optional<Graph> graph_;
  VariableId<Pose3d> a_, b_;
  VariableId<StereoRigd> rig_;
  Summary summary_;
  Result<Mat6d> covariance_ = Error{ErrorCode::not_found, "nothing was solved"};
};

}  // namespace oriel::run_detail
