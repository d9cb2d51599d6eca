// A problem with directions to hold, and the same as dense algebra on the free ones.
#pragma once
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cstring>
#include <random>

#include "graph/random_graph.h"
#include "oriel/linear/linearize_factor.h"

namespace oriel::testing_freedom {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing_graph::SeenPoint;

// Poses on an uneven path, points that they see, velocities beside them; all with noise. Everything is anchored.
struct World {
  Graph graph;
  std::vector<VariableId<Pose3d>> poses;
  std::vector<VariableId<Point3d>> points;
  std::vector<VariableId<Velocity3d>> velocities;

  // `sight`: how many poses in a row see a point.
  explicit World(int n = 8, int seen = 24, int sight = 8, double off = 0.05, unsigned seed = 1) : random_(seed) {
    GraphEdit edit = graph.edit();
    std::vector<Pose3d> truth;
    for (int i = 0; i < n; ++i) {
      truth.push_back(
          Pose3d{}.plus({{0.2, -0.3, 0.0, 1.0 * i, 0.1 * i * i, 0.5}}).plus({{0.1 * i, 0, 0.2 * i, 0, 0, 0}}));
      poses.push_back(edit.add(truth.back().plus(six(off)), Label("x", i)));
      velocities.push_back(edit.add(Velocity3d{{{1.0, number(off), number(off)}}}));
      edit.add(Prior{truth.back().plus(six(off))}, Sigma(0.5), poses.back());
      edit.add(Prior{Velocity3d{{{1.0, 0.2 * i, number(off)}}}}, Sigma(0.3), velocities.back());
      const auto k = static_cast<std::size_t>(i);
      if (i == 0) continue;
      edit.add(Between{(truth[k - 1].inverse() * truth[k]).plus(six(off))}, Sigma(0.1), Huber(2.0), poses[k - 1],
               poses[k]);
      edit.add(Between{Velocity3d{{{number(off), 0.2, number(off)}}}}, Sigma(0.2), velocities[k - 1], velocities[k]);
    }
    for (int k = 0; k < seen; ++k) {
      const Vec3d p = {{number(6.0) + 4.0, number(4.0), 5.0 + number(2.0)}};
      points.push_back(edit.add(Point3d{p + vec3(off)}));
      for (int i = 0; i < std::min(sight, n); ++i) {
        const auto at = static_cast<std::size_t>((k + i) % n);
        edit.add(SeenPoint{truth[at].inverse() * p + vec3(off)}, Sigma(0.05), poses[at], points.back());
      }
    }
    EXPECT_TRUE(graph.apply(edit));
  }

  double number(double scale) { return scale * std::normal_distribution<double>()(random_); }
  Vec3d vec3(double scale) { return {{number(scale), number(scale), number(scale)}}; }
  Vec6d six(double scale) {
    return {{number(scale), number(scale), number(scale), number(scale), number(scale), number(scale)}};
  }

  void set(VariableKey id, const Freedom& freedom) {
    GraphEdit edit = graph.edit();
    edit.set(id, freedom);
    const auto ok = graph.apply(edit);
    ASSERT_TRUE(ok) << ok.error();
  }
  // A linear prior over two poses that may be restricted, about a point beside them.
  void add_prior() {
    LinearPrior prior;
    for (const auto id : {poses[2], poses[4]}) {
      const Pose3d x = graph.value(id).plus(six(0.1));
      prior.variables.push_back(id);
      const std::size_t at = prior.estimates.size();
      prior.estimates.resize(at + estimate_doubles(kVariableOps<Pose3d>));
      std::memcpy(prior.estimates.data() + at, &x, sizeof(x));
    }
    prior.rows = 9, prior.cols = 12;
    for (int i = 0; i < prior.rows; ++i) prior.d.push_back(number(0.3));
    for (int i = 0; i < prior.rows * prior.cols; ++i) prior.R.push_back(number(3.0));
    GraphEdit edit = graph.edit();
    edit.add(prior);
    ASSERT_TRUE(graph.apply(edit));
  }
  // Of every kind: poses and velocities that are kept, points that are eliminated; neighbours of one another too.
  void restrict_some() {
    set(poses[1], Freedom::yaw());
    set(poses[2], Freedom::planar());
    set(poses[3], Freedom::position());
    set(poses[5], Freedom::hold({1, 3, 5}, Freedom::Axes::world));
    set(velocities[1], Freedom::hold({0, 2}));
    set(velocities[2], Freedom::hold({1}, Freedom::Axes::world));
    set(points[0], Freedom::hold({2}));
    set(points[1], Freedom::hold({0, 1}, Freedom::Axes::world));
  }

 private:
  std::mt19937 random_;
};

// The whole problem at the graph's values by dense algebra, factor by factor, and the basis of what is free: each
// column of N is a direction that the graph says is free, from the rotation matrix of the pose itself.
struct Dense {
  MatrixXd H, N;
  VectorXd g;
  std::vector<std::pair<VariableKey, int>> place;  // of the first scalar

  int at(VariableKey id) const {
    for (const auto& [key, offset] : place)
      if (key == id) return offset;
    return -1;
  }
  VectorXd step() const { return -N * (N.transpose() * H * N).ldlt().solve(N.transpose() * g); }
  MatrixXd covariance() const { return N * (N.transpose() * H * N).inverse() * N.transpose(); }
};

inline MatrixXd axes_of(const Graph& graph, VariableKey id, int dim) {
  MatrixXd B = MatrixXd::Identity(dim, dim);
  if (id.type != kVariableOps<Pose3d>.key || graph.freedom(id).axes != Freedom::Axes::world) return B;
  const auto R = static_cast<const Pose3d*>(graph.find_value(id))->rotation().matrix();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) B(i, j) = B(3 + i, 3 + j) = R(i, j);
  return B;
}

inline Dense dense_of(const Graph& graph) {
  Dense d;
  int n = 0;
  std::vector<VectorXd> directions;
  for (const auto& pool : graph.pools())
    for (std::uint32_t v = 0; v < pool->extent(); ++v) {
      if (!pool->slots().is_live(v) || pool->fixed(v)) continue;
      d.place.push_back({{pool->ops().key, pool->slots().key(v)}, n});
      n += pool->ops().dim;
    }
  for (const auto& [id, offset] : d.place) {
    const int dim = graph.find_ops(id.type)->dim;
    const MatrixXd B = axes_of(graph, id, dim);
    for (int k = 0; k < dim; ++k) {
      if ((graph.freedom(id).held >> k & 1u) != 0) continue;
      VectorXd column = VectorXd::Zero(n);
      column.segment(offset, dim) = B.row(k).transpose();  // d = Bᵀ e_k
      directions.push_back(column);
    }
  }
  d.N.resize(n, static_cast<Eigen::Index>(directions.size()));
  for (std::size_t k = 0; k < directions.size(); ++k) d.N.col(static_cast<Eigen::Index>(k)) = directions[k];
  d.H = MatrixXd::Zero(n, n), d.g = VectorXd::Zero(n);
  auto add = [&](FactorId id) {
    const auto f = linearize_factor(graph, id, false);
    ASSERT_TRUE(f) << f.error();
    MatrixXd J = MatrixXd::Zero(f->rows, n);
    int column = 0;
    for (const VariableKey& v : f->variables) {
      const int dim = graph.find_ops(v.type)->dim;
      if (d.at(v) >= 0)
        J.middleCols(d.at(v), dim) +=
            Eigen::Map<const MatrixXd>(f->jacobian.data(), f->rows, f->cols).middleCols(column, dim);
      column += dim;
    }
    d.H += J.transpose() * J;
    d.g += J.transpose() * Eigen::Map<const VectorXd>(f->residual.data(), f->rows);
  };
  for (const auto& table : graph.tables())
    for (std::uint32_t r = 0; r < table->extent(); ++r)
      if (table->slots().is_live(r)) add({table->ops().key, table->slots().key(r)});
  for (std::uint32_t r = 0; r < graph.priors().extent(); ++r)
    if (graph.priors().slots().is_live(r)) add({PriorTable::kKey, graph.priors().slots().key(r)});
  return d;
}

}  // namespace oriel::testing_freedom
