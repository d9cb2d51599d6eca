#include "oriel/residual/structureless_track.h"

#include <algorithm>
#include <cmath>

#include "oriel/residual/reprojection.h"

namespace oriel {
namespace detail {
namespace {

constexpr int kMostRows = 4 * kMostTrackViews, kMostCols = 6 * kMostTrackViews + 1;

// The point while it is looked for: [α, β, ρ], the direction [α, β, 1] in camera 0 of the first pose over the depth
// 1/ρ there. Its range is that of J_l for a point in world coordinates, and it stays well-behaved far away.
struct Track {
  const TrackView* views;
  const Pose3d* const* poses;
  int n;
  const StereoRigd& rig;
  Mat3d R[kMostTrackViews];  // R_k R_0
  Vec3d s[kMostTrackViews];  // R_kᵀ (t_0 - t_k), so that h_body = R (R_bc [α β 1]ᵀ + ρ t_bc) + ρ s
  int rows = 0;

  Track(const TrackView* v, const Pose3d* const* p, int count, const StereoRigd& cameras)
      : views(v), poses(p), n(count), rig(cameras) {
    for (int k = 0; k < n; ++k) {
      const Rot3d inverse = poses[k]->R.inverse();
      R[k] = (inverse * poses[0]->R).matrix();
      s[k] = inverse * (poses[0]->t - poses[k]->t);
      rows += views[k].right != 0.0 ? 4 : 2;
    }
  }
  int cameras(int k) const { return views[k].right != 0.0 ? 2 : 1; }
  Vec3d toward(const Vec3d& l) const {  // in the first body, times ρ
    const auto& anchor = rig.cameras[0];
    return anchor.R_body_camera * Vec3d{{l[0], l[1], 1.0}} + anchor.t_body_camera * l[2];
  }
  Vec3d in_body(int k, const Vec3d& l) const { return R[k] * toward(l) + s[k] * l[2]; }

  // Errors, and their derivatives by l and by the direction in the body (2 × 3 a camera) unless they are null.
  bool errors(const Vec3d& l, double* e, Mat<double, 2, 3>* by_l, Mat<double, 2, 3>* by_body) const {
    const auto& anchor = rig.cameras[0];
    bool valid = l[2] > 0.0;
    int row = 0;
    for (int k = 0; k < n; ++k) {
      const Vec3d h = in_body(k, l), g = R[k] * anchor.t_body_camera + s[k];
      const Mat3d across = R[k] * anchor.R_body_camera;
      for (int c = 0; c < cameras(k); ++c, row += 2) {
        const auto& mount = rig.cameras[c];
        Vec2d error;
        Mat<double, 2, 3> K;
        valid = view(mount, h, l[2], c == 0 ? views[k].pixel0 : views[k].pixel1, 0, error,
                     by_l != nullptr ? &K : nullptr) &&
                valid;
        e[row] = error[0], e[row + 1] = error[1];
        if (by_l == nullptr) continue;
        by_body[row / 2] = K;
        by_l[row / 2].set_block(0, 0, K * across.col(0));
        by_l[row / 2].set_block(0, 1, K * across.col(1));
        by_l[row / 2].set_block(0, 2, K * (g - mount.t_body_camera));
      }
    }
    return valid;
  }

  // Along the first bearing, where the other bearings b say: b h_z - h_xy = 0 is linear in ρ.
  bool start(Vec3d& l) const {
    l = {{views[0].bearing0[0], views[0].bearing0[1], 0.0}};
    double bb = 0.0, ab = 0.0;
    for (int k = 0; k < n; ++k)
      for (int c = k == 0 ? 1 : 0; c < cameras(k); ++c) {
        const auto& mount = rig.cameras[c];
        const Vec2d& bearing = c == 0 ? views[k].bearing0 : views[k].bearing1;
        const Vec3d far = transposed_times(mount.R_body_camera, in_body(k, l));
        const Vec3d near =
            transposed_times(mount.R_body_camera, R[k] * rig.cameras[0].t_body_camera + s[k] - mount.t_body_camera);
        for (int i = 0; i < 2; ++i) {
          const double a = bearing[i] * far[2] - far[i], b = bearing[i] * near[2] - near[i];
          bb += b * b, ab += a * b;
        }
      }
    l[2] = -ab / bb;
    return std::isfinite(l[2]) && l[2] > 0.0;
  }

  // The largest angle by which a ray turns from where a point far away would be.
  double parallax(const Vec3d& l) const {
    double largest = 0.0;
    for (int k = 0; k < n; ++k)
      for (int c = 0; c < cameras(k); ++c) {
        const Vec3d near = in_body(k, l) - rig.cameras[c].t_body_camera * l[2], far = in_body(k, {{l[0], l[1], 0.0}});
        largest = std::max(largest, std::atan2(cross(near, far).norm(), near.dot(far)));
      }
    return largest;
  }
};

double half_square(const double* e, int n) {
  double s = 0.0;
  for (int i = 0; i < n; ++i) s += e[i] * e[i];
  return 0.5 * s;
}

// (A + λ diag A) x = -g, by Cholesky; false where A is not positive definite.
bool solve_damped(Mat3d A, double lambda, const Vec3d& g, Vec3d& x) {
  for (int i = 0; i < 3; ++i) A(i, i) += lambda * A(i, i);
  x = -g;
  for (int j = 0; j < 3; ++j) {
    for (int k = 0; k < j; ++k) A(j, j) -= A(j, k) * A(j, k);
    if (!(A(j, j) > 0.0)) return false;
    A(j, j) = std::sqrt(A(j, j));
    for (int i = j + 1; i < 3; ++i) {
      for (int k = 0; k < j; ++k) A(i, j) -= A(i, k) * A(j, k);
      A(i, j) /= A(j, j);
    }
    for (int k = 0; k < j; ++k) x[j] -= A(j, k) * x[k];
    x[j] /= A(j, j);
  }
  for (int j = 2; j >= 0; --j) {
    for (int i = j + 1; i < 3; ++i) x[j] -= A(i, j) * x[i];
    x[j] /= A(j, j);
  }
  return true;
}

// Errors at a place, with their derivatives.
struct Place {
  Vec3d l;
  double e[kMostRows];
  Mat<double, 2, 3> by_l[kMostRows / 2], by_body[kMostRows / 2];
  double cost = 0.0;
  Mat3d A;
  Vec3d g;

  bool look(const Track& track, const Vec3d& at) {
    l = at;
    if (!track.errors(l, e, by_l, by_body)) return false;
    cost = half_square(e, track.rows);
    A = Mat3d::zero();
    g = Vec3d::zero();
    for (int i = 0; i < track.rows / 2; ++i) {
      A += transposed_times(by_l[i], by_l[i]);
      g += transposed_times(by_l[i], Vec2d{{e[2 * i], e[2 * i + 1]}});
    }
    return std::isfinite(cost);
  }
};

// Levenberg–Marquardt on the point alone, to where a step would move no error by more than rounding: the equality of
// the gradients rests on it.
const Place* find_point(const Track& track, Place (&places)[2]) {
  constexpr int kMostSteps = 30;
  // Decreases that are predicted, over 1 + cost [px²]. Below the second one the cost itself is rounding.
  constexpr double kDone = 1e-22, kRounding = 1e-12;
  Vec3d start, step;
  int at = 0;
  if (!track.start(start) || !places[at].look(track, start)) return nullptr;
  double lambda = 0.0, predicted = HUGE_VAL;
  for (int k = 0; k < kMostSteps; ++k) {
    Place &now = places[at], &next = places[1 - at];
    const bool solved = solve_damped(now.A, lambda, now.g, step);
    predicted = solved ? -0.5 * step.dot(now.g) : HUGE_VAL;
    const bool done = predicted <= kDone * (1.0 + now.cost);
    const double most = now.cost + (predicted <= kRounding * (1.0 + now.cost) ? kRounding * (1.0 + now.cost) : 0.0);
    if (solved && next.look(track, now.l + step) && next.cost <= most) {
      at = 1 - at;
      if (done) break;
      lambda = lambda > 1e-6 ? 0.1 * lambda : 0.0;
    } else {
      if (done) break;
      lambda = std::max(10.0 * lambda, 1e-4);
    }
  }
  return predicted <= kRounding * (1.0 + places[at].cost) ? &places[at] : nullptr;
}

// Columns of one system, all of `rows` rows: J_l first, then e and, if wanted, J_x.
struct Columns {
  int rows, count;
  double at[3 + kMostCols][kMostRows];

  // Householder reflections that bring J_l to upper triangular form with a positive diagonal (Golub & Van Loan, Matrix
  // Computations, 4th ed., algorithm 5.1.1, after Parlett). The usual choice of sign, away from the diagonal entry,
  // would let Q₂ jump where that entry passes zero; with this one r is a differentiable function, of which J may be
  // taken at a first estimate and r at the value.
  bool triangularize() {
    for (int j = 0; j < 3; ++j) {
      double* v = at[j] + j;
      const int n = rows - j;
      double below = 0.0;
      for (int i = 1; i < n; ++i) below += v[i] * v[i];
      const double length = std::sqrt(v[0] * v[0] + below);
      if (!(length > 0.0)) return false;
      v[0] = v[0] <= 0.0 ? v[0] - length : -below / (v[0] + length);
      const double square = v[0] * v[0] + below;
      if (square > 0.0)
        for (int c = j + 1; c < 3 + count; ++c) reflect(v, 2.0 / square, at[c] + j, n);
    }
    return true;
  }
  static void reflect(const double* v, double factor, double* x, int n) {
    double s = 0.0;
    for (int i = 0; i < n; ++i) s += v[i] * x[i];
    s *= factor;
    for (int i = 0; i < n; ++i) x[i] -= s * v[i];
  }
};

// J_x of a pose with the point held in the world: its rows alone are not zero.
void fill_pose(const Track& track, const Place& place, Columns& columns) {
  int row = 0;
  for (int k = 0; k < track.n; ++k) {
    const Vec3d h = track.in_body(k, place.l);
    for (int c = 0; c < 6; ++c) std::fill_n(columns.at[4 + 6 * k + c], columns.rows, 0.0);
    for (int c = 0; c < track.cameras(k); ++c, row += 2) {
      const Mat<double, 2, 3>& K = place.by_body[row / 2];
      const Mat<double, 2, 3> turn = times_hat(K, h), move = K * -place.l[2];
      for (int i = 0; i < 2; ++i)
        for (int d = 0; d < 3; ++d) {
          columns.at[4 + 6 * k + d][row + i] = turn(i, d);
          columns.at[7 + 6 * k + d][row + i] = move(i, d);
        }
    }
  }
}

}  // namespace

bool locate_structureless(const TrackView* views, const Pose3d* const* poses, int n, const StereoRigd& rig,
                          Vec3d& p_world) {
  const Track track(views, poses, n, rig);
  Place places[2];
  const Place* place = find_point(track, places);
  if (place == nullptr || !(track.parallax(place->l) >= kLeastTrackParallax)) return false;
  p_world = *poses[0] * (track.toward(place->l) / place->l[2]);
  return true;
}

bool evaluate_structureless(const TrackView* views, const Pose3d* const* poses, int n, const StereoRigd& rig, double* r,
                            double* const* J) {
  const Track track(views, poses, n, rig);
  Place places[2];
  const Place* place = find_point(track, places);
  if (place == nullptr || !(track.parallax(place->l) >= kLeastTrackParallax)) return false;
  Columns columns;
  columns.rows = track.rows;
  columns.count = J != nullptr ? 1 + 6 * n : 1;
  for (int i = 0; i < track.rows; ++i) {
    for (int c = 0; c < 3; ++c) columns.at[c][i] = place->by_l[i / 2](i % 2, c);
    columns.at[3][i] = place->e[i];
  }
  if (J != nullptr) fill_pose(track, *place, columns);
  if (!columns.triangularize()) return false;
  const int dim = 4 * n - 3, filled = track.rows - 3;
  auto take = [&](const double* column, double* to) {
    std::copy_n(column + 3, filled, to);
    std::fill(to + filled, to + dim, 0.0);
  };
  take(columns.at[3], r);
  for (int k = 0; J != nullptr && k < n; ++k)
    for (int c = 0; c < 6; ++c) take(columns.at[4 + 6 * k + c], J[k] + c * dim);
  return true;
}

}  // namespace detail

template void linearize_rows<StructurelessTrack<2>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<StructurelessTrack<3>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<StructurelessTrack<4>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<StructurelessTrack<5>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<StructurelessTrack<6>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<StructurelessTrack<7>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;
template void linearize_rows<StructurelessTrack<8>, IsotropicNoise>(const RowPointers&, Batch&) noexcept;

}  // namespace oriel
