#include "oriel/evaluate/certificate.h"

#include <cmath>
#include <string>

#include "oriel/io/pose_start.h"
#include "oriel/linear/multifrontal.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

template <class S>
Mat<S, 2, 2> matrix_of(const Rot2<S>& R) {
  return {{R.c, R.s, -R.s, R.c}};
}
template <class S>
Mat<S, 3, 3> matrix_of(const Rot3<S>& R) {
  return R.matrix();
}

// r = [√τ (t_j - t_i - R_i t̃); √κ vec(R_j - R_i R̃)] (D + D² × 1): F = ½ Σ‖r‖².
template <int D>
struct Chord {
  Mat<double, D, D> R;
  Vec<double, D> t;
  double root_kappa, root_tau;

  template <class Pose>
  auto operator()(const Pose& a, const Pose& b) const {
    const auto A = matrix_of(a.R), B = matrix_of(b.R);
    using S = std::remove_cvref_t<decltype(A(0, 0))>;
    Vec<S, D + D * D> r;
    for (int i = 0; i < D; ++i) {
      S along = b.t[i] - a.t[i];
      for (int k = 0; k < D; ++k) along = along - A(i, k) * t[k];
      r[i] = along * root_tau;
      for (int j = 0; j < D; ++j) {
        S chord = B(i, j);
        for (int k = 0; k < D; ++k) chord = chord - A(i, k) * R(k, j);
        r[D + j * D + i] = chord * root_kappa;
      }
    }
    return r;
  }
};
struct ChordalEdge2 {
  static constexpr std::string_view kName = "chordal_edge2/1";
  using Variables = Types<Pose2d, Pose2d>;
  Chord<2> chord;
  template <class S>
  Vec<S, 6> operator()(const Pose2<S>& a, const Pose2<S>& b) const {
    return chord(a, b);
  }
};
struct ChordalEdge3 {
  static constexpr std::string_view kName = "chordal_edge3/1";
  using Variables = Types<Pose3d, Pose3d>;
  Chord<3> chord;
  template <class S>
  Vec<S, 12> operator()(const Pose3<S>& a, const Pose3<S>& b) const {
    return chord(a, b);
  }
};
template <int D>
using ChordalEdge = std::conditional_t<D == 2, ChordalEdge2, ChordalEdge3>;
template <int D>
using PoseOf = std::conditional_t<D == 2, Pose2d, Pose3d>;

// The trace of the inverse of a symmetric matrix; not positive where it is not positive definite.
double trace_of_inverse(const Mat<double, 2, 2>& a) {
  const double det = a(0, 0) * a(1, 1) - a(0, 1) * a(1, 0);
  return (a(0, 0) + a(1, 1)) / det;
}
double trace_of_inverse(const Mat3d& a) {
  const auto minor = [&](int i, int j) { return a(i, i) * a(j, j) - a(i, j) * a(j, i); };
  const double det = a(0, 0) * minor(1, 2) - a(0, 1) * (a(1, 0) * a(2, 2) - a(1, 2) * a(2, 0)) +
                     a(0, 2) * (a(1, 0) * a(2, 1) - a(1, 1) * a(2, 0));
  return (minor(0, 1) + minor(0, 2) + minor(1, 2)) / det;
}

template <int D>
Result<std::vector<IsotropicEdge<D>>> checked(const PoseGraphFile& file, std::vector<IsotropicEdge<D>> edges,
                                              const std::vector<std::int64_t>& lines) {
  if (!file.planar_sightings.empty() || !file.planar_bearings.empty() || !file.spatial_sightings.empty())
    return Error{ErrorCode::bad_input, file.file_name + ": a certificate is for poses alone, and this has landmarks",
                 file.file_name, 0};
  for (std::size_t k = 0; k < edges.size(); ++k) {
    const IsotropicEdge<D>& e = edges[k];
    if (!(e.kappa > 0.0 && e.tau > 0.0 && std::isfinite(e.kappa) && std::isfinite(e.tau)))
      return Error{ErrorCode::bad_input,
                   "a certificate wants an information that is positive for rotation and translation", file.file_name,
                   lines[k]};
  }
  return edges;
}

// ∂F/∂R_i of all poses, [D × D] each.
template <int D>
std::vector<Mat<double, D, D>> multipliers(const std::vector<PoseOf<D>>& poses,
                                           const std::vector<IsotropicEdge<D>>& edges) {
  using M = Mat<double, D, D>;
  std::vector<M> slope(poses.size(), M::constant(0.0));
  for (const IsotropicEdge<D>& e : edges) {
    const auto &a = poses[static_cast<std::size_t>(e.from)], &b = poses[static_cast<std::size_t>(e.to)];
    const M A = matrix_of(a.R), chord = (matrix_of(b.R) - A * e.R) * e.kappa;
    const Vec<double, D> along = (b.t - a.t - A * e.t) * e.tau;
    M& from = slope[static_cast<std::size_t>(e.from)];
    from = from - chord * e.R.transposed() - along * e.t.transposed();
    M& to = slope[static_cast<std::size_t>(e.to)];
    to = to + chord;
  }
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const M whole = matrix_of(poses[i].R).transposed() * slope[i];
    slope[i] = (whole + whole.transposed()) * 0.5;
  }
  return slope;
}

// S, by blocks [t_i, R_i]; of the first pose R alone: a common translation changes nothing.
template <int D>
class Slack {
 public:
  Slack(std::size_t poses, const std::vector<IsotropicEdge<D>>& edges, const std::vector<Mat<double, D, D>>& multiplier)
      : first_(poses, 1) {
    first_[0] = 0;
    std::vector<int> dims(poses, D + 1);
    dims[0] = D;
    pattern_.reset(dims);
    for (const IsotropicEdge<D>& e : edges) pattern_.connect(e.from, e.to);
    pattern_.finish();
    analyzed_ = factorization_.analyze(pattern_, {}).ok();
    h_.assign(static_cast<std::size_t>(factorization_.storage_size()), 0.0);
    for (const IsotropicEdge<D>& e : edges) add(e);
    for (std::size_t i = 0; i < poses; ++i)
      for (int r = 0; r < D; ++r)
        for (int c = 0; c < D; ++c) add(static_cast<int>(i), r, static_cast<int>(i), c, -multiplier[i](r, c));
  }
  // Whether S + η blockdiag(0, I) > 0, as far as a factorization can tell.
  bool is_positive(double eta) {
    damping_.clear();
    for (std::size_t i = 0; i < first_.size(); ++i) {
      if (first_[i] > 0) damping_.push_back(0.0);
      damping_.insert(damping_.end(), D, eta);
    }
    return analyzed_ && factorization_.factor(h_.data(), damping_.data()).status == FactorReport::Status::ok;
  }

 private:
  static constexpr int kTranslation = -1;  // else: a column of R
  void add(const IsotropicEdge<D>& e) {
    for (int k = 0; k < D; ++k) {
      add(e.to, k, e.to, k, e.kappa);
      add(e.from, k, e.from, k, e.kappa);  // κ R̃ R̃ᵀ
      for (int c = 0; c < D; ++c) add(e.from, k, e.to, c, -e.kappa * e.R(k, c));
    }
    // τ v vᵀ, v: 1 at t_j, -1 at t_i, -t̃ at R_i.
    add(e.to, kTranslation, e.to, kTranslation, e.tau);
    for (int k = kTranslation; k < D; ++k) {
      const double v = k == kTranslation ? -1.0 : -e.t[k];
      add(e.from, k, e.to, kTranslation, e.tau * v);
      for (int c = kTranslation; c < D; ++c)
        add(e.from, k, e.from, c, e.tau * v * (c == kTranslation ? -1.0 : -e.t[c]));
    }
  }
  // Of a pair of blocks (i, j) and (j, i) one is stored, and is said once; of a diagonal block both halves.
  void add(int i, int row, int j, int column, double value) {
    const int r = row + first_[static_cast<std::size_t>(i)], c = column + first_[static_cast<std::size_t>(j)];
    if (r < 0 || c < 0) return;
    const BlockAddress at = factorization_.address(i, j);
    h_[static_cast<std::size_t>(at.offset + (at.transposed ? r * at.ld + c : c * at.ld + r))] += value;
  }

  std::vector<int> first_;  // of a pose: the row in its block where R begins
  BlockPattern pattern_;
  Multifrontal factorization_;
  bool analyzed_ = false;
  std::vector<double> h_, damping_;
};

// The stationary point of F near these poses.
template <int D>
Summary descend(std::vector<PoseOf<D>>& poses, const std::vector<IsotropicEdge<D>>& edges) {
  using Pose = PoseOf<D>;
  Graph graph;
  GraphEdit edit = graph.edit();
  std::vector<VariableId<Pose>> ids;
  for (const Pose& p : poses) ids.push_back(edit.add(p));
  edit.fix(ids[0]);
  for (const IsotropicEdge<D>& e : edges)
    edit.add(ChordalEdge<D>{{e.R, e.t, std::sqrt(e.kappa), std::sqrt(e.tau)}}, Sigma(1.0),
             ids[static_cast<std::size_t>(e.from)], ids[static_cast<std::size_t>(e.to)]);
  Summary summary;
  if (!graph.apply(edit)) return summary;
  NativeEngine engine(graph);
  SolveOptions options;
  options.function_tolerance = 1e-13;
  options.gradient_tolerance = 0.0;
  options.max_iterations = 200;
  summary = engine.solve(options);
  for (std::size_t i = 0; i < poses.size(); ++i) poses[i] = graph.value(ids[i]);
  return summary;
}

template <int D>
Certificate certify_poses(std::vector<PoseOf<D>>& poses, const std::vector<IsotropicEdge<D>>& edges) {
  Certificate out;
  if (poses.empty() || edges.empty()) return out;
  const Summary summary = descend<D>(poses, edges);
  out.cost = summary.final_cost;
  out.stationary = summary.converged();
  out.lower_bound = -HUGE_VAL;
  const std::vector<Mat<double, D, D>> multiplier = multipliers<D>(poses, edges);
  double trace = 0.0, largest = 0.0;
  for (const Mat<double, D, D>& m : multiplier)
    for (int k = 0; k < D; ++k) trace += m(k, k);
  for (const IsotropicEdge<D>& e : edges) largest = std::max(largest, e.kappa);
  Slack<D> slack(poses.size(), edges, multiplier);
  // From what would leave a gap of 1e-9 on; below 1e-11 of the largest entries a factorization sees its own rounding.
  const double scale = 0.5 * static_cast<double>(poses.size()) * D;
  double eta = std::max(1e-9 * out.cost / scale, 1e-11 * largest), too_small = 0.0;
  while (eta <= 10.0 * largest && !slack.is_positive(eta)) too_small = eta, eta *= 10.0;
  if (eta > 10.0 * largest) return out;
  constexpr int kHalvings = 6;
  for (int k = 0; k < kHalvings && too_small > 0.0; ++k) {
    const double between = std::sqrt(too_small * eta);
    (slack.is_positive(between) ? eta : too_small) = between;
  }
  out.lower_bound = std::max(0.0, 0.5 * trace - eta * scale);
  return out;
}

}  // namespace

Result<std::vector<IsotropicEdge<2>>> isotropic_edges2(const PoseGraphFile& file) {
  std::vector<IsotropicEdge<2>> edges;
  std::vector<std::int64_t> lines;
  for (const PoseGraphFile::PlanarEdge& e : file.planar_edges) {
    const Vec3d& m = e.measurement;
    const Mat3d information = information_matrix(e);
    edges.push_back({e.from,
                     e.to,
                     matrix_of(Rot2d::exp(m[2])),
                     {{m[0], m[1]}},
                     0.5 * information(2, 2),
                     2.0 / trace_of_inverse(information.block<2, 2>(0, 0))});
    lines.push_back(e.line);
  }
  return checked<2>(file, std::move(edges), lines);
}

Result<std::vector<IsotropicEdge<3>>> isotropic_edges3(const PoseGraphFile& file) {
  std::vector<IsotropicEdge<3>> edges;
  std::vector<std::int64_t> lines;
  for (const PoseGraphFile::SpatialEdge& e : file.spatial_edges) {
    const Pose3d m = pose_of(e.measurement);
    const Mat6d information = information_matrix(e);
    // The file's is of half the angle: a variance of the rotation vector is four times its own.
    edges.push_back({e.from, e.to, m.R.matrix(), m.t, 3.0 / (8.0 * trace_of_inverse(information.block<3, 3>(3, 3))),
                     3.0 / trace_of_inverse(information.block<3, 3>(0, 0))});
    lines.push_back(e.line);
  }
  return checked<3>(file, std::move(edges), lines);
}

Certificate certify(std::vector<Pose2d>& poses, const std::vector<IsotropicEdge<2>>& edges) {
  return certify_poses<2>(poses, edges);
}
Certificate certify(std::vector<Pose3d>& poses, const std::vector<IsotropicEdge<3>>& edges) {
  return certify_poses<3>(poses, edges);
}

}  // namespace oriel
