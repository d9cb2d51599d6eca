// Marginalization by hand, as it is done beside Ceres: JᵀJ of the factors that leave, Schur complements (inverse depths
// one by one, then the 15 × 15 block of the state), and the square root of what is left by Cholesky.
#include <array>
#include <cmath>

#include "benchmarks/support/ceres_window.h"

namespace oriel::benchmark {

// Columns: pose and speed of the oldest state (15), then poses by keyframe, then speeds. H is kept in its lower half.
struct CeresWindow::Fold {
  int oldest = 0;
  std::vector<WindowPrior::Block> blocks;  // that stay; columns count from 15
  std::vector<int> pose_column;            // by keyframe - oldest; -1 where nothing touches it
  std::vector<int> speed_column;
  int dim = 0;
  Eigen::MatrixXd H;
  Eigen::VectorXd b;  // Jᵀr

  int pose(int k) const { return pose_column[k - oldest]; }
  int speed(int k) const { return speed_column[k - oldest]; }
};

namespace {

// Of a robust factor: r and J are scaled by √ρ' (its second derivative is left out, as Ceres does where ρ'' ≤ 0).
double robust_scale(const ceres::LossFunction* loss, double squared_norm) {
  if (loss == nullptr) return 1.0;
  double rho[3];
  loss->Evaluate(squared_norm, rho);
  return std::sqrt(rho[1]);
}

// H += AᵀB at (row, column), row ≥ column; A and B have their residuals as rows.
template <class A, class B>
void add(Eigen::MatrixXd& H, int row, const A& a, int column, const B& b) {
  if (row < column)
    H.block(column, row, b.cols(), a.cols()).noalias() += b.transpose() * a;
  else
    H.block(row, column, a.cols(), b.cols()).noalias() += a.transpose() * b;
}

constexpr double kRoundingPivot = 1e-10;  // of its diagonal entry

template <int Rows, int Cols>
using RowMajor = Eigen::Matrix<double, Rows, Cols, (Cols == 1 ? Eigen::ColMajor : Eigen::RowMajor)>;

// Upper R with RᵀR = H for a positive semidefinite H (its lower half is read): the row of a pivot that is rounding
// error is zero. A pose that the leaving landmarks saw but once or twice is not determined by them, and a prior says
// so.
Eigen::MatrixXd semidefinite_root(const Eigen::MatrixXd& H) {
  const Eigen::Index n = H.rows();
  Eigen::MatrixXd L = H.triangularView<Eigen::Lower>();
  for (Eigen::Index j = 0; j < n; ++j) {
    const double pivot = L(j, j);
    const bool null = !(pivot > kRoundingPivot * H(j, j));
    if (null)
      L.col(j).tail(n - j).setZero();
    else
      L.col(j).tail(n - j) /= std::sqrt(pivot);
    for (Eigen::Index k = j + 1; k < n && !null; ++k) L.col(k).tail(n - k) -= L(k, j) * L.col(j).tail(n - k);
  }
  return L.transpose();
}

}  // namespace

void CeresWindow::fold_oldest() {
  Fold fold;
  fold.oldest = next_ - options_.window;
  lay_out(fold);
  fold.H = Eigen::MatrixXd::Zero(fold.dim, fold.dim);
  fold.b = Eigen::VectorXd::Zero(fold.dim);
  fold_prior(fold);
  fold_imu(fold);
  fold_landmarks(fold);
  finish_prior(fold);
  views_.pop_front();
}

void CeresWindow::lay_out(Fold& fold) const {
  const auto n = static_cast<std::size_t>(options_.window);
  fold.pose_column.assign(n, -1);
  fold.speed_column.assign(n, -1);
  fold.pose_column[1] = fold.speed_column[1] = 0;
  for (const auto& b : prior_->blocks) (b.speed ? fold.speed_column : fold.pose_column)[b.keyframe - fold.oldest] = 0;
  for (const View& view : views_.front()) fold.pose_column[view.keyframe - fold.oldest] = 0;
  fold.pose_column[0] = 0, fold.speed_column[0] = 6;
  int column = 15;
  for (const bool speed : {false, true})
    for (std::size_t i = 1; i < n; ++i) {
      int& c = (speed ? fold.speed_column : fold.pose_column)[i];
      if (c < 0) continue;
      c = column;
      fold.blocks.push_back({fold.oldest + static_cast<int>(i), speed, {}, {}, column - 15});
      column += speed ? 9 : 6;
    }
  fold.dim = column;
}

void CeresWindow::fold_prior(Fold& fold) const {
  const WindowPrior& p = *prior_;
  Eigen::VectorXd e(p.R.cols());
  for (const auto& b : p.blocks) {
    const State& s = state(b.keyframe);
    const auto* x = b.speed ? reinterpret_cast<const double*>(&s.speed) : reinterpret_cast<const double*>(&s.pose);
    WindowPrior::error(b, x, e.data() + b.column);
  }
  const Eigen::VectorXd r = p.d + p.R * e;
  const Eigen::MatrixXd H = p.R.transpose() * p.R;
  const Eigen::VectorXd g = p.R.transpose() * r;
  const auto at = [&fold](const WindowPrior::Block& b) {
    return b.speed ? fold.speed(b.keyframe) : fold.pose(b.keyframe);
  };
  for (const auto& x : p.blocks) {
    fold.b.segment(at(x), x.dim()) += g.segment(x.column, x.dim());
    for (const auto& y : p.blocks)
      if (at(x) >= at(y)) fold.H.block(at(x), at(y), x.dim(), y.dim()) += H.block(x.column, y.column, x.dim(), y.dim());
  }
}

void CeresWindow::fold_imu(Fold& fold) const {
  const int i = fold.oldest, j = i + 1;
  const ImuCost cost(&data_.stream.keyframes[j].motion.motion, &data_.imu_noise[j], pose_at(i), speed_at(i), pose_at(j),
                     speed_at(j));
  const double* p[4] = {
      reinterpret_cast<const double*>(&state(i).pose), reinterpret_cast<const double*>(&state(i).speed),
      reinterpret_cast<const double*>(&state(j).pose), reinterpret_cast<const double*>(&state(j).speed)};
  Eigen::Matrix<double, 15, 1> r;
  RowMajor<15, 7> J_xi, J_xj;
  RowMajor<15, 9> J_si, J_sj;
  double* J[4] = {J_xi.data(), J_si.data(), J_xj.data(), J_sj.data()};
  cost.Evaluate(p, r.data(), J);
  Eigen::Matrix<double, 15, 30> all;
  all << J_xi.leftCols<6>(), J_si, J_xj.leftCols<6>(), J_sj;
  const Eigen::Matrix<double, 30, 30> H = all.transpose() * all;
  const Eigen::Matrix<double, 30, 1> g = all.transpose() * r;
  const std::array<std::array<int, 3>, 4> parts = {
      {{0, 6, fold.pose(i)}, {6, 9, fold.speed(i)}, {15, 6, fold.pose(j)}, {21, 9, fold.speed(j)}}};
  for (const auto& x : parts) {
    fold.b.segment(x[2], x[1]) += g.segment(x[0], x[1]);
    for (const auto& y : parts)
      if (x[2] >= y[2]) fold.H.block(x[2], y[2], x[1], y[1]) += H.block(x[0], y[0], x[1], y[1]);
  }
}

namespace {

// One inverse depth and what couples it to the poses: H of itself, Jᵀr, and one column of the coupling.
struct DepthSums {
  double information = 0.0, gradient = 0.0;
  Eigen::VectorXd coupling;
};

template <int Rows>
void add_view(const ceres::CostFunction& cost, const ceres::LossFunction* loss, const double* const* p, int a, int b,
              Eigen::MatrixXd& H, Eigen::VectorXd& g, DepthSums& depth) {
  Eigen::Matrix<double, Rows, 1> r, J_depth;
  RowMajor<Rows, 7> J_a7, J_b7;
  double* J[3] = {J_a7.data(), J_b7.data(), J_depth.data()};
  if (!cost.Evaluate(p, r.data(), J)) return;
  const double scale = robust_scale(loss, r.squaredNorm());
  r *= scale, J_depth *= scale;
  const Eigen::Matrix<double, Rows, 6> J_a = scale * J_a7.template leftCols<6>(),
                                       J_b = scale * J_b7.template leftCols<6>();
  H.block<6, 6>(a, a).noalias() += J_a.transpose() * J_a;
  H.block<6, 6>(b, b).noalias() += J_b.transpose() * J_b;
  H.block<6, 6>(b, a).noalias() += J_b.transpose() * J_a;
  g.segment<6>(a).noalias() += J_a.transpose() * r;
  g.segment<6>(b).noalias() += J_b.transpose() * r;
  depth.coupling.segment<6>(a).noalias() += J_a.transpose() * J_depth;
  depth.coupling.segment<6>(b).noalias() += J_b.transpose() * J_depth;
  depth.information += J_depth.squaredNorm();
  depth.gradient += J_depth.dot(r);
}

void add_anchor_view(const AnchorCost& cost, const ceres::LossFunction* loss, const double* const* p,
                     DepthSums& depth) {
  Eigen::Vector2d r, J_depth;
  double* J[1] = {J_depth.data()};
  if (!cost.Evaluate(p, r.data(), J)) return;
  const double scale = robust_scale(loss, r.squaredNorm());
  r *= scale, J_depth *= scale;
  depth.information += J_depth.squaredNorm();
  depth.gradient += J_depth.dot(r);
}

}  // namespace

// Views of one track stand in the order of keyframes, tracks mixed; so sums are kept by track until all are seen.
void CeresWindow::fold_landmarks(Fold& fold) const {
  std::vector<DepthSums> sums;
  const int first_track = views_.front().empty() ? 0 : views_.front().front().track;
  const double weight = 1.0 / options_.pixel_sigma;
  const StereoRigd* rig = &data_.stream.rig;
  for (const View& view : views_.front()) {
    const auto at = static_cast<std::size_t>(view.track - first_track);
    if (at >= sums.size()) sums.resize(at + 1);
    if (sums[at].coupling.size() == 0) sums[at].coupling = Eigen::VectorXd::Zero(fold.dim);
    const SimulatedTrack& track = data_.stream.tracks[view.track];
    const SimulatedObservation& o = *view.observation;
    const double* p[3] = {reinterpret_cast<const double*>(&state(track.anchor).pose),
                          reinterpret_cast<const double*>(&state(view.keyframe).pose), &depths_[view.track]};
    const int a = fold.pose(track.anchor), b = fold.pose(view.keyframe);
    if (view.keyframe == track.anchor)
      add_anchor_view(AnchorCost({track.bearing, o.pixel1}, weight, rig), loss_.get(), p + 2, sums[at]);
    else if (options_.stereo)
      add_view<4>(AnchoredCost<StereoReprojectiond>({track.bearing, o.pixel0, o.pixel1}, weight, rig,
                                                    pose_at(track.anchor), pose_at(view.keyframe)),
                  loss_.get(), p, a, b, fold.H, fold.b, sums[at]);
    else
      add_view<2>(AnchoredCost<MonoReprojectiond>({track.bearing, o.pixel0}, weight, rig, pose_at(track.anchor),
                                                  pose_at(view.keyframe)),
                  loss_.get(), p, a, b, fold.H, fold.b, sums[at]);
  }
  // All landmarks at once: H -= W V⁻¹ Wᵀ, one symmetric product.
  Eigen::MatrixXd W(fold.dim, static_cast<Eigen::Index>(sums.size()));
  Eigen::Index used = 0;
  for (const DepthSums& s : sums) {
    if (!(s.information > 0.0)) continue;
    fold.b -= s.coupling * (s.gradient / s.information);
    W.col(used++) = s.coupling / std::sqrt(s.information);
  }
  fold.H.selfadjointView<Eigen::Lower>().rankUpdate(W.leftCols(used), -1.0);
}

void CeresWindow::finish_prior(Fold& fold) {
  const int n = fold.dim - 15;
  const Eigen::LLT<Eigen::MatrixXd> leaving(fold.H.topLeftCorner(15, 15));
  Eigen::MatrixXd coupling = fold.H.bottomLeftCorner(n, 15);
  leaving.matrixU().solveInPlace<Eigen::OnTheRight>(coupling);  // H_rm L⁻ᵀ
  Eigen::MatrixXd H = fold.H.bottomRightCorner(n, n);
  H.selfadjointView<Eigen::Lower>().rankUpdate(coupling, -1.0);
  const Eigen::VectorXd y = leaving.matrixL().solve(fold.b.head(15));
  const Eigen::VectorXd b = fold.b.tail(n) - coupling * y;
  const Eigen::LLT<Eigen::MatrixXd> root(H);
  if (leaving.info() != Eigen::Success && error_.empty()) error_ = "the leaving state is not determined";
  const auto pivots = root.matrixLLT().diagonal().array().square();
  if (root.info() == Eigen::Success && (pivots > kRoundingPivot * H.diagonal().array()).all())
    prior_->R = root.matrixU();
  else
    prior_->R = semidefinite_root(H);
  // Rᵀd = b, at the values of now; nothing in the rows that say nothing.
  const auto& R = prior_->R;
  prior_->d = b;
  for (int i = 0; i < n; ++i) {
    double& d = prior_->d[i];
    d = R(i, i) > 0.0 ? (d - R.col(i).head(i).dot(prior_->d.head(i))) / R(i, i) : 0.0;
  }
  Eigen::VectorXd moved(n);  // x ⊟ x̂: the prior speaks of first estimates
  for (auto& block : fold.blocks) {
    State& s = state(block.keyframe);
    bool& touched = block.speed ? s.speed_touched : s.pose_touched;
    if (!touched) (block.speed ? static_cast<void>(s.first_speed = s.speed) : static_cast<void>(s.first_pose = s.pose));
    if (!options_.first_estimates)
      (block.speed ? static_cast<void>(s.first_speed = s.speed) : static_cast<void>(s.first_pose = s.pose));
    touched = true;
    block.pose = s.first_pose, block.value = s.first_speed;
    const auto* x = block.speed ? reinterpret_cast<const double*>(&s.speed) : reinterpret_cast<const double*>(&s.pose);
    WindowPrior::error(block, x, moved.data() + block.column);
  }
  prior_->d -= prior_->R * moved;
  prior_->blocks = std::move(fold.blocks);
}

}  // namespace oriel::benchmark
