// The window as systems of the VINS class write it on Ceres: a Problem made anew for each keyframe, an elimination
// order with the inverse depths first, and a marginalization by hand with a Schur complement and first estimates.
#pragma once
#include <ceres/ceres.h>

#include <Eigen/Dense>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "benchmarks/support/ceres_window_costs.h"
#include "benchmarks/support/window_race.h"

namespace oriel::benchmark {

// What may be chosen of Ceres for this problem.
struct CeresSetting {
  std::string name;
  ceres::LinearSolverType solver = ceres::DENSE_SCHUR;
  ceres::DenseLinearAlgebraLibraryType dense = ceres::EIGEN;
  bool jacobi_scaling = true;
  ceres::TrustRegionStrategyType strategy = ceres::LEVENBERG_MARQUARDT;
};
std::vector<CeresSetting> ceres_window_settings();

// r = d + R [.. x ⊟ x̂ ..] over the poses and speeds that it touches; R upper triangular.
class WindowPrior {
 public:
  struct Block {
    int keyframe = 0;
    bool speed = false;  // of its speed, else of its pose
    Pose3d pose{};       // x̂
    Speed value{};       // x̂
    int column = 0;
    int dim() const { return speed ? 9 : 6; }
  };
  std::vector<Block> blocks;
  Eigen::MatrixXd R;
  Eigen::VectorXd d;

  // x ⊟ x̂ of one block into e.
  static void error(const Block& block, const double* x, double* e);
};

class CeresWindow {
 public:
  CeresWindow(const WindowData& data, const WindowOptions& options, const CeresSetting& setting);
  SlideReport slide();
  // Takes in the frame after the newest keyframe, solves, and takes it out again.
  SlideReport pass();
  const Pose3d& newest_pose() const { return state(next_ - 1).pose; }
  const std::string& error() const { return error_; }

 private:
  struct State {
    Pose3d pose, first_pose;
    Speed speed, first_speed;
    bool pose_touched = false, speed_touched = false;  // by a prior
  };
  State& state(int k) { return states_[static_cast<std::size_t>(k) % states_.size()]; }
  const State& state(int k) const { return states_[static_cast<std::size_t>(k) % states_.size()]; }
  int oldest() const { return std::max(0, next_ - static_cast<int>(states_.size())); }
  Evaluated<Pose3d> pose_at(int k) const;
  Evaluated<Speed> speed_at(int k) const;

  void start();
  void predict(int k, const PreintegratedImud& motion);
  void add_views(int k);
  // What stands between two states; and what only one update sees.
  struct Frame {
    const PreintegratedImud* motion = nullptr;
    const FullNoise<15>* noise = nullptr;
    const std::vector<View>* views = nullptr;
  };
  Frame frame_at(int k) const { return {&data_.stream.keyframes[k].motion.motion, &data_.imu_noise[k], nullptr}; }
  void solve(const Frame& newest, double t0, SlideReport& report);
  void build(const Frame& newest, ceres::Problem& problem, ceres::ParameterBlockOrdering& order);
  void add_prior(ceres::Problem& problem);
  void add_reprojection(const View& view, ceres::Problem& problem, ceres::ParameterBlockOrdering& order);
  void run(ceres::Problem& problem, const std::shared_ptr<ceres::ParameterBlockOrdering>& order, SlideReport& report);

  // ---- marginalization (ceres_window_fold.cc) ----
  struct Fold;
  void fold_oldest();
  void lay_out(Fold& fold) const;
  void fold_prior(Fold& fold) const;
  void fold_imu(Fold& fold) const;
  void fold_landmarks(Fold& fold) const;
  void finish_prior(Fold& fold);

  const WindowData& data_;
  WindowOptions options_;
  CeresSetting setting_;
  PoseManifold manifold_;
  std::unique_ptr<ceres::LossFunction> loss_;
  std::vector<State> states_;            // a ring, by keyframe
  std::vector<double> depths_;           // by track
  std::deque<std::vector<View>> views_;  // by keyframe of the anchor, oldest first
  std::unique_ptr<WindowPrior> prior_;
  int next_ = 0;
  std::string error_;
};

}  // namespace oriel::benchmark
