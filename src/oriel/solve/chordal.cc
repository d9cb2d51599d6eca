#include "oriel/solve/chordal.h"

#include <Eigen/Dense>
#include <cmath>
#include <string>

#include "oriel/manifold/vector.h"
#include "oriel/residual/between.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

template <int N>
struct RowName {};
template <>
struct RowName<2> {
  static constexpr std::string_view kName = "chordal_row2/1";
};
template <>
struct RowName<3> {
  static constexpr std::string_view kName = "chordal_row3/1";
};

// One row of R_j = R_i R_ij, as a column: r = x_j - R_ijᵀ x_i.
template <int N>
struct ChordalRow {
  static constexpr std::string_view kName = RowName<N>::kName;
  static constexpr int kDim = N;
  using Variables = Types<VectorNd<N>, VectorNd<N>>;
  Mat<double, N, N> R_j_i;  // R_ijᵀ

  bool evaluate(const VectorNd<N>& i, const VectorNd<N>& j, Vec<double, N>& r, Mat<double, N, N>* J_i,
                Mat<double, N, N>* J_j) const {
    r = j.v - R_j_i * i.v;
    if (J_i != nullptr) {
      *J_i = -R_j_i;
      *J_j = Mat<double, N, N>::identity();
    }
    return true;
  }
};

// What differs between the plane and space.
template <class Pose>
struct Space;
template <>
struct Space<Pose2d> {
  static constexpr int kDim = 2, kRows = 1;  // the other row follows
  static Mat<double, 2, 2> matrix(const Rot2d& R) { return {{R.c, R.s, -R.s, R.c}}; }
  static Rot2d nearest(const Vec2d (&rows)[1]) {
    const double n = rows[0].norm();
    return n > 0.0 ? Rot2d{rows[0][0] / n, -rows[0][1] / n} : Rot2d{};
  }
};
template <>
struct Space<Pose3d> {
  static constexpr int kDim = 3, kRows = 3;
  static Mat3d matrix(const Rot3d& R) { return R.matrix(); }
  static Rot3d nearest(const Vec3d (&rows)[3]) {
    Eigen::Matrix3d m;
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) m(i, k) = rows[i][k];
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Matrix3d U = svd.matrixU();
    if (U.determinant() * svd.matrixV().determinant() < 0.0) U.col(2) = -U.col(2);
    const Eigen::Matrix3d R = U * svd.matrixV().transpose();
    Mat3d out;
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) out(i, k) = R(i, k);
    return Rot3d::from_matrix(out);
  }
};

Error unsolved(const Graph& graph, const Summary& summary, const char* what) {
  std::string text = std::string("chordal start: the ") + what + " have no solution";
  if (!summary.undetermined.empty()) text += ", nothing determines " + describe(graph, summary.undetermined.front());
  return {ErrorCode::singular, text};
}

template <class Pose>
class ChordalStart {
 public:
  static constexpr int kDim = Space<Pose>::kDim;
  using Vector = VectorNd<kDim>;
  using Edge = RelativePose<Pose>;

  ChordalStart(std::size_t poses, std::span<const Edge> edges) : edges_(edges), poses_(poses), held_(poses, 0) {}

  Result<std::vector<Pose>> run(std::span<const KnownPose<Pose>> known) {
    const auto count = static_cast<std::int64_t>(poses_.size());
    for (const Edge& e : edges_)
      if (std::min(e.from, e.to) < 0 || std::max(e.from, e.to) >= count)
        return Error{ErrorCode::bad_input, "chordal start: an edge from " + std::to_string(e.from) + " to " +
                                               std::to_string(e.to) + " of " + std::to_string(count) + " poses"};
    for (const auto& k : known) {
      if (k.pose < 0 || k.pose >= count) return Error{ErrorCode::bad_input, "chordal start: no such pose is known"};
      poses_[static_cast<std::size_t>(k.pose)] = k.value;
      held_[static_cast<std::size_t>(k.pose)] = 1;
    }
    hold_pieces();
    if (auto ok = find_rotations(); !ok) return ok.error();
    if (auto ok = find_places(); !ok) return ok.error();
    return std::move(poses_);
  }

 private:
  // Each piece has a pose that is held.
  void hold_pieces() {
    std::vector<std::size_t> root(poses_.size());
    for (std::size_t i = 0; i < root.size(); ++i) root[i] = i;
    auto find = [&](std::size_t i) {
      while (root[i] != i) i = root[i] = root[root[i]];
      return i;
    };
    for (const Edge& e : edges_)
      if (e.rotation_weight > 0.0) root[find(static_cast<std::size_t>(e.to))] = find(static_cast<std::size_t>(e.from));
    std::vector<char> has(poses_.size(), 0);
    for (std::size_t i = 0; i < root.size(); ++i)
      if (held_[i]) has[find(i)] = 1;
    for (std::size_t i = 0; i < root.size(); ++i)
      if (!has[find(i)]) has[find(i)] = held_[i] = 1;
  }

  std::vector<VariableId<Vector>> add_vectors(GraphEdit& edit) {
    std::vector<VariableId<Vector>> ids;
    ids.reserve(poses_.size());
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      ids.push_back(edit.add(Vector{}));
      if (held_[i]) edit.fix(ids.back());
    }
    return ids;
  }

  // The rows of all rotations answer to the same matrix, one after the other.
  Result<void> find_rotations() {
    Graph graph;
    GraphEdit edit = graph.edit();
    const auto ids = add_vectors(edit);
    for (const Edge& e : edges_)
      if (e.rotation_weight > 0.0)
        edit.add(ChordalRow<kDim>{Space<Pose>::matrix(e.motion.R).transposed()},
                 Sigma(1.0 / std::sqrt(e.rotation_weight)), ids[static_cast<std::size_t>(e.from)],
                 ids[static_cast<std::size_t>(e.to)]);
    if (auto ok = graph.apply(edit); !ok) return ok;
    NativeEngine engine(graph);
    std::vector<Vec<double, kDim>> rows[Space<Pose>::kRows];
    for (int k = 0; k < Space<Pose>::kRows; ++k) {
      GraphEdit set = graph.edit();
      for (std::size_t i = 0; i < poses_.size(); ++i) {
        Vector x;
        for (int c = 0; held_[i] && c < kDim; ++c) x.v[c] = Space<Pose>::matrix(poses_[i].R)(k, c);
        set.set(ids[i], x);
      }
      if (auto ok = graph.apply(set); !ok) return ok;
      if (auto ok = solve(graph, engine, "rotations"); !ok) return ok;
      for (const auto& id : ids) rows[k].push_back(graph.value(id).v);
    }
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      if (held_[i]) continue;
      Vec<double, kDim> of_pose[Space<Pose>::kRows];
      for (int k = 0; k < Space<Pose>::kRows; ++k) of_pose[k] = rows[k][i];
      poses_[i].R = Space<Pose>::nearest(of_pose);
    }
    return {};
  }

  Result<void> find_places() {
    Graph graph;
    GraphEdit edit = graph.edit();
    const auto ids = add_vectors(edit);
    for (std::size_t i = 0; i < poses_.size(); ++i)
      if (held_[i]) edit.set(ids[i], Vector{poses_[i].t});
    for (const Edge& e : edges_) {
      const auto R = Space<Pose>::matrix(poses_[static_cast<std::size_t>(e.from)].R);
      auto information = R * e.translation_information * R.transposed();
      information = 0.5 * (information + information.transposed());
      edit.add(Between<Vector>{Vector{R * e.motion.t}}, Information(information), ids[static_cast<std::size_t>(e.from)],
               ids[static_cast<std::size_t>(e.to)]);
    }
    if (auto ok = graph.apply(edit); !ok) return ok;
    NativeEngine engine(graph);
    if (auto ok = solve(graph, engine, "places"); !ok) return ok;
    for (std::size_t i = 0; i < poses_.size(); ++i) poses_[i].t = graph.value(ids[i]).v;
    return {};
  }

  // It is linear: one step.
  static Result<void> solve(const Graph& graph, NativeEngine& engine, const char* what) {
    SolveOptions options;
    options.method = Method::gauss_newton;
    options.max_iterations = 1;
    options.trace = false;
    const Summary summary = engine.solve(options);
    if (summary.failed() || !summary.undetermined.empty()) return unsolved(graph, summary, what);
    return {};
  }

  std::span<const Edge> edges_;
  std::vector<Pose> poses_;
  std::vector<char> held_;
};

}  // namespace

Result<std::vector<Pose2d>> chordal_start(std::size_t poses, std::span<const RelativePose<Pose2d>> edges,
                                          std::span<const KnownPose<Pose2d>> known) {
  return ChordalStart<Pose2d>(poses, edges).run(known);
}

Result<std::vector<Pose3d>> chordal_start(std::size_t poses, std::span<const RelativePose<Pose3d>> edges,
                                          std::span<const KnownPose<Pose3d>> known) {
  return ChordalStart<Pose3d>(poses, edges).run(known);
}

}  // namespace oriel
