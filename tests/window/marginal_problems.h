// Problems that the tests of marginalization share, and what they expect of what is left.
#pragma once
#include <gtest/gtest.h>

#include <vector>

#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/residual/reprojection.h"
#include "oriel/window/marginalize.h"
#include "residual/random_values.h"
#include "window/dense_oracle.h"

namespace oriel::marginal_problems {

using dense_oracle::difference;
using dense_oracle::MatrixXd;
using dense_oracle::System;
using testing_values::Random;

// z = A x + B y, over any two vectors: 3 × 1.
struct LinearPairName {
  static constexpr std::string_view kName = "test.linear_pair/1";
};
template <class V, class W>
struct LinearPair {
  struct Inner {
    static constexpr std::string_view kName = ComposedName<LinearPairName, V>::kName;
  };
  static constexpr std::string_view kName = ComposedName<Inner, W>::kName;
  static constexpr int kDim = 3;
  using Variables = Types<V, W>;
  Mat<double, 3, V::kDim> A;
  Mat<double, 3, W::kDim> B;
  Vec3d z;

  bool evaluate(const V& x, const W& y, Vec3d& r, Mat<double, 3, V::kDim>* J_x, Mat<double, 3, W::kDim>* J_y) const {
    r = A * x.minus(V{}) + B * y.minus(W{}) - z;
    if (J_x != nullptr) *J_x = A, *J_y = B;
    return true;
  }
  bool finite() const { return std::isfinite(A.squared_norm() + B.squared_norm() + z.squared_norm()); }
};

// A random linear problem of mixed types: a chessboard of variables with factors to the right and below, and a prior
// each. White fields are of two types, black ones of all, which keeps the kinds of factors few.
struct LinearProblem {
  Graph graph;
  std::vector<VariableKey> ids;
  Random random;

  explicit LinearProblem(unsigned seed, int width = 4, int height = 4) : random(seed) {
    GraphEdit edit = graph.edit();
    for (int i = 0; i < width * height; ++i) {
      const int kind = i / 2 + static_cast<int>(seed);
      auto add = [&]<class V>(VariableId<V>) {
        const VariableId<V> id = edit.add(random.value<V>(1.0));
        edit.add(Prior{random.value<V>(1.0)}, Sigma(random.uniform(0.5, 3.0)), id);
        ids.push_back(id);
      };
      if (white(i, width))
        kind % 2 == 0 ? add(VariableId<Point3d>{}) : add(VariableId<VectorNd<5>>{});
      else
        with_type(kind % 8, SlotKey{}, add);
    }
    EXPECT_TRUE(graph.apply(edit).ok());
    link_all(width, height);
  }

  static bool is_white(int i, int width) { return white(i, width); }
  // f(residual, noise, x, y) of a random factor between a black and a white field.
  template <class F>
  void with_pair(VariableKey black, VariableKey white, F&& f) {
    const int kind = static_cast<int>(std::find(std::begin(kTypes), std::end(kTypes), black.type) - kTypes);
    with_type(kind, black.key, [&]<class V>(VariableId<V> x) {
      auto to = [&]<class W>(VariableId<W> y) {
        const auto A = matrix<V::kDim>();
        const auto B = matrix<W::kDim>();
        const Vec3d z = random.normal<3>(1.0);
        f(LinearPair<V, W>{A, B, z}, Sigma(random.uniform(0.1, 1.0)), x, y);
      };
      white.type == kVariableOps<Point3d>.key ? to(VariableId<Point3d>{white.key})
                                              : to(VariableId<VectorNd<5>>{white.key});
    });
  }

 private:
  static constexpr std::uint64_t kTypes[] = {kVariableOps<VectorNd<1>>.key, kVariableOps<VectorNd<2>>.key,
                                             kVariableOps<VectorNd<3>>.key, kVariableOps<VectorNd<4>>.key,
                                             kVariableOps<VectorNd<5>>.key, kVariableOps<VectorNd<6>>.key,
                                             kVariableOps<Point3d>.key,     kVariableOps<Velocity3d>.key};
  static bool white(int i, int width) { return (i + i / width) % 2 != 0; }

  template <class F>
  static void with_type(int kind, SlotKey key, F&& f) {
    if (kind == 0) f(VariableId<VectorNd<1>>{key});
    if (kind == 1) f(VariableId<VectorNd<2>>{key});
    if (kind == 2) f(VariableId<VectorNd<3>>{key});
    if (kind == 3) f(VariableId<VectorNd<4>>{key});
    if (kind == 4) f(VariableId<VectorNd<5>>{key});
    if (kind == 5) f(VariableId<VectorNd<6>>{key});
    if (kind == 6) f(VariableId<Point3d>{key});
    if (kind == 7) f(VariableId<Velocity3d>{key});
  }
  template <int C>
  Mat<double, 3, C> matrix() {
    Mat<double, 3, C> a;
    for (double& e : a.m) e = random.normal();
    return a;
  }
  void link(GraphEdit& edit, VariableKey black, VariableKey white) {
    with_pair(black, white,
              [&](const auto& residual, const auto& noise, auto x, auto y) { edit.add(residual, noise, x, y); });
  }
  void link_all(int width, int height) {
    GraphEdit edit = graph.edit();
    auto connect = [&](int i, int j) {
      if (white(i, width)) std::swap(i, j);
      link(edit, ids[i], ids[j]);
    };
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        if (x + 1 < width) connect(y * width + x, y * width + x + 1);
        if (y + 1 < height) connect(y * width + x, y * width + width + x);
      }
    EXPECT_TRUE(graph.apply(edit).ok());
  }
};

// A pose–landmark problem: poses on a line, inverse depths that are anchored at poses and seen by later ones.
struct VisualProblem {
  Graph graph;
  std::vector<VariableId<Pose3d>> poses;
  std::vector<VariableId<InverseDepthd>> depths;

  explicit VisualProblem(double error, int pose_count = 5, int landmarks = 30, Loss loss = Loss::none()) {
    Random random(3);
    GraphEdit edit = graph.edit();
    const StereoRigd rig_value = testing_values::euroc_like_rig();
    const auto rig = edit.add(rig_value);
    std::vector<Pose3d> truth;
    for (int i = 0; i < pose_count; ++i) {
      truth.push_back(Pose3d{Rot3d::exp({{0.02 * i, -0.01 * i, 0.03 * i}}), {{0.2 * i, 0.1 * i, 0.05 * i}}});
      poses.push_back(edit.add(truth.back().plus(random.normal<6>(error))));
    }
    edit.add(Prior{truth[0]}, Sigma(0.01), poses[0]);
    for (int i = 1; i < pose_count; ++i)
      edit.add(Between{truth[i - 1].inverse() * truth[i]}, Sigma(0.05), poses[i - 1], poses[i]);
    for (int k = 0; k < landmarks; ++k) {
      const int anchor = k % (pose_count - 1);
      const Vec2d bearing = {{random.uniform(-0.3, 0.3), random.uniform(-0.3, 0.3)}};
      const InverseDepthd depth{random.uniform(0.1, 0.3)};
      depths.push_back(edit.add(InverseDepthd{depth.rho * (1.0 + error)}));
      for (int i = anchor + 1; i < std::min(pose_count, anchor + 4); ++i) {
        StereoReprojectiond residual{bearing, {}, {}};
        Vec<double, 4> pixels;
        residual.evaluate(truth[anchor], truth[i], depth, rig_value, pixels, nullptr, nullptr, nullptr);
        pixels += random.normal<4>(error > 0.0 ? 1.0 : 0.0);
        residual.pixel0 = pixels.segment<2>(0), residual.pixel1 = pixels.segment<2>(2);
        edit.add(residual, Sigma(1.0), loss, poses[anchor], poses[i], depths.back(), rig);
      }
    }
    const auto applied = graph.apply(edit);
    EXPECT_TRUE(applied.ok()) << applied.error();
  }
};

inline MarginalizeReport leave(Graph& graph, const std::vector<VariableKey>& leaving,
                               const MarginalizeOptions& options = {}) {
  Marginalizer marginalizer;
  GraphEdit edit = graph.edit();
  auto report = marginalizer.marginalize(graph, leaving, options, edit);
  EXPECT_TRUE(report.ok()) << report.error();
  const auto applied = graph.apply(edit);
  EXPECT_TRUE(applied.ok()) << applied.error();
  return *report;
}

// Mean (as a step from the graph's values) and covariance of what is left equal those in the whole problem.
inline void expect_same_gaussian(const System& whole, const Graph& graph, double tolerance) {
  const System rest = dense_oracle::system(graph);
  const std::vector<int> keep = whole.scalars(rest.variables);
  const MatrixXd covariance = whole.H.inverse();
  EXPECT_LT(difference(rest.H.inverse(), covariance(keep, keep)), tolerance);
  EXPECT_LT(difference(-rest.H.inverse() * rest.g, (-covariance * whole.g)(keep)), tolerance);
}

inline void expect_same_system(const System& whole, const Graph& graph, double tolerance, bool first_estimates = true) {
  const System rest = dense_oracle::system(graph, first_estimates);
  const System want = dense_oracle::schur_complement(whole, rest);
  EXPECT_LT(difference(rest.H, want.H), tolerance);
  EXPECT_LT(difference(rest.g, want.g), tolerance);
}

}  // namespace oriel::marginal_problems
