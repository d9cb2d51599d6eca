// Rules that priors keep whatever they are made of: weights, what was never evaluated, what is never lost, sizes.
#include <gtest/gtest.h>

#include <chrono>
#include <numeric>

#include "oriel/solve/native_engine.h"
#include "window/marginal_problems.h"

namespace oriel {
namespace {

using dense_oracle::VectorXd;
using namespace marginal_problems;

// r = x² + y - z: its Jacobian is not the same everywhere.
struct Bent {
  static constexpr std::string_view kName = "test.bent/1";
  static constexpr int kDim = 1;
  using Variables = Types<VectorNd<1>, VectorNd<1>>;
  double z = 0.0;
  bool evaluate(const VectorNd<1>& x, const VectorNd<1>& y, Vec<double, 1>& r, Mat<double, 1, 1>* J_x,
                Mat<double, 1, 1>* J_y) const {
    r[0] = x.v[0] * x.v[0] + y.v[0] - z;
    if (J_x != nullptr) (*J_x)(0, 0) = 2.0 * x.v[0], (*J_y)(0, 0) = 1.0;
    return true;
  }
  bool finite() const { return std::isfinite(z); }
};

// A robust bent factor between x, which leaves and is held by a tight prior, and y. All is scalar, so that what the
// prior on y must be can be written down.
struct RobustPair {
  Graph graph;
  VariableId<VectorNd<1>> x, y;
  static constexpr double kSigma = 0.5, kHuber = 1.0, kHold = 1e-3;

  RobustPair() {
    GraphEdit edit = graph.edit();
    x = edit.add(VectorNd<1>{{{2.0}}}), y = edit.add(VectorNd<1>{{{0.0}}});
    edit.add(Prior{VectorNd<1>{{{2.0}}}}, Sigma(kHold), x);
    edit.add(Prior{VectorNd<1>{{{0.0}}}}, Sigma(0.1), y);
    edit.add(Bent{14.0}, Sigma(kSigma), Huber(kHuber), x, y);
    EXPECT_TRUE(graph.apply(edit).ok());
  }
  // R of the only prior on y: of r = w (J_x x + y) / σ with x known to `hold`.
  double prior_root() const {
    for (std::uint32_t row = 0; row < graph.priors().extent(); ++row)
      if (graph.priors().slots().is_live(row)) return std::abs(graph.priors().numbers(row).R[0]);
    return 0.0;
  }
  // √(w/σ² - (w J/σ²)² / (w J²/σ² + 1/hold²)), with the weight w of the residual at x, y and J at `at`.
  static double expected_root(double x_value, double y_value, double at) {
    const double r = std::abs(x_value * x_value + y_value - 14.0) / kSigma, w = r <= kHuber ? 1.0 : kHuber / r;
    const double info = w / (kSigma * kSigma), J = 2.0 * at, hold = 1.0 / (kHold * kHold);
    return std::sqrt(info - info * J * info * J / (info * J * J + hold));
  }
};

// M6, W12
TEST(MarginalRules, RobustWeightsAreThoseOfTheValuesThatTheLastSolveLeft) {
  RobustPair p;
  const double before = RobustPair::expected_root(2.0, 0.0, 2.0);
  NativeEngine engine(p.graph);
  ASSERT_TRUE(engine.solve({.max_iterations = 30}).converged());
  const double x = p.graph.value(p.x).v[0], y = p.graph.value(p.y).v[0];
  const double after = RobustPair::expected_root(x, y, x);
  ASSERT_GT(std::abs(after - before), 1e-6 * before);
  leave(p.graph, {p.x});
  EXPECT_NEAR(p.prior_root(), after, 1e-9 * after);
}

// M6
TEST(MarginalRules, UnderFirstEstimatesWeightsAreOfTheValuesAndJacobiansOfTheEstimates) {
  for (const bool first_estimates : {true, false}) {
    RobustPair p;
    GraphEdit edit = p.graph.edit();
    LinearPrior prior;  // says next to nothing; it sets the first estimate of x to 1.5
    prior.variables = {p.x}, prior.estimates = {1.5}, prior.rows = prior.cols = 1, prior.d = {0.0}, prior.R = {1e-9};
    edit.add(prior);
    ASSERT_TRUE(p.graph.apply(edit).ok());
    leave(p.graph, {p.x}, {.first_estimates = first_estimates});
    const double expected = RobustPair::expected_root(2.0, 0.0, first_estimates ? 1.5 : 2.0);
    EXPECT_NEAR(p.prior_root(), expected, 1e-9 * expected);
  }
}

// M6
TEST(MarginalRules, AFactorThatWasNeverEvaluatedIsLinearizedFirst) {
  for (const bool last : {false, true}) {
    VisualProblem p(0.01);
    NativeEngine engine(p.graph);
    (void)engine.solve({.max_iterations = 3});
    GraphEdit edit = p.graph.edit();
    const auto fresh = edit.add(Pose3d{p.graph.value(p.poses[4])});
    edit.add(Between{Pose3d{Rot3d{}, {{0.1, 0.0, 0.2}}}}, Sigma(0.05), p.poses[last ? 4 : 0], fresh);
    ASSERT_TRUE(p.graph.apply(edit).ok());
    const System whole = dense_oracle::system(p.graph);
    const MarginalizeReport report = leave(p.graph, {p.poses[last ? 4 : 0]}, {.landmarks = LandmarkPolicy::keep});
    EXPECT_GT(report.absorbed_factors, 2);
    expect_same_system(whole, p.graph, 1e-10);
  }
}

double smallest_eigenvalue(const MatrixXd& m) { return m.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(); }

// M7
TEST(MarginalRules, InformationOnNeighboursIsAsBeforeAndNeverLessThanAfterPlainRemoval) {
  for (const LandmarkPolicy policy : {LandmarkPolicy::keep, LandmarkPolicy::close, LandmarkPolicy::drop})
    for (const double threshold : {0.0, 3.0}) {
      VisualProblem p(0.02, 6, 40, Huber(1.0)), removed(0.02, 6, 40, Huber(1.0));
      for (int step = 0; step < 3; ++step) {
        const System before = dense_oracle::system(p.graph);
        leave(p.graph, {p.poses[step]}, {.landmarks = policy, .outlier_threshold = threshold});
        const System after = dense_oracle::system(p.graph);
        const System marginal = dense_oracle::schur_complement(before, after);
        // No more than was known, and all of it where nothing was dropped.
        EXPECT_GT(smallest_eigenvalue(marginal.H - after.H), -1e-9 * marginal.H.norm());
        if (policy != LandmarkPolicy::drop && threshold == 0.0) {
          EXPECT_LT(difference(marginal.H, after.H), 1e-9);
        }
        // No less than if the same variables were removed.
        GraphEdit edit = removed.graph.edit();
        edit.remove(removed.poses[step]);
        for (const auto id : removed.depths)
          if (removed.graph.contains(id) && !p.graph.contains(id)) edit.remove(id);
        ASSERT_TRUE(removed.graph.apply(edit).ok());
        const System plain = dense_oracle::system(removed.graph);
        ASSERT_EQ(plain.H.rows(), after.H.rows());
        EXPECT_GT(smallest_eigenvalue(after.H - plain.H), -1e-9 * after.H.norm());
      }
    }
}

// M7
TEST(MarginalRules, ALaterConflictPullsLessThanAfterPlainRemovalInASolveToo) {
  auto pulled = [](bool marginalize) {
    VisualProblem p(0.005);
    NativeEngine engine(p.graph);
    EXPECT_FALSE(engine.solve({.max_iterations = 20}).failed());
    if (marginalize) {
      leave(p.graph, {p.poses[0]});
    } else {
      GraphEdit edit = p.graph.edit();
      edit.remove(p.poses[0]);
      EXPECT_TRUE(p.graph.apply(edit).ok());
    }
    const Pose3d before = p.graph.value(p.poses[1]);
    GraphEdit edit = p.graph.edit();
    edit.add(Prior{before.plus({{0, 0, 0, 0.1, 0.0, 0.0}})}, Sigma(0.1), p.poses[1]);
    EXPECT_TRUE(p.graph.apply(edit).ok());
    EXPECT_FALSE(engine.solve({.max_iterations = 20}).failed());
    return (p.graph.value(p.poses[1]).t - before.t).norm();
  };
  EXPECT_LT(pulled(true), 0.5 * pulled(false));
}

// A line of vectors over which a window slides: two kinds, each tied to the last of both, and marks that are seen for
// a while.
struct Line {
  Graph window, batch;  // the same factors; nothing ever leaves the batch
  std::vector<VariableKey> states;
  Random random{11};
  VariableId<VectorNd<2>> b[2];
  VariableId<Velocity3d> a[2];
  VariableId<Point3d> mark[2];
  int step_ = 0;

  Mat3d matrix() {
    Mat3d m;
    for (double& e : m.m) e = random.normal();
    return m;
  }
  Mat<double, 3, 2> narrow() {
    Mat<double, 3, 2> m;
    for (double& e : m.m) e = random.normal();
    return m;
  }
  void grow() {
    const auto A = matrix(), B = matrix(), M = matrix(), N = matrix();
    const auto C = narrow(), D = narrow();
    const Vec3d z[3] = {random.normal<3>(1.0), random.normal<3>(1.0), random.normal<3>(1.0)};
    const auto prior = random.value<VectorNd<2>>(1.0);
    const auto point = random.value<Point3d>(1.0);
    int side = 0;
    for (Graph* graph : {&window, &batch}) {
      GraphEdit edit = graph->edit();
      const auto last_a = a[side];
      a[side] = edit.add(Velocity3d{});
      b[side] = edit.add(VectorNd<2>{});
      edit.add(Prior{prior}, Sigma(1.0), b[side]);
      edit.add(LinearPair<Velocity3d, VectorNd<2>>{A, C, z[0]}, Sigma(0.3), a[side], b[side]);
      if (step_ > 0) edit.add(LinearPair<Velocity3d, Velocity3d>{B, M, z[1]}, Sigma(0.2), last_a, a[side]);
      if (step_ % 3 == 0) {
        mark[side] = edit.add(point);
        edit.add(Prior{point}, Sigma(2.0), mark[side]);
      }
      edit.add(LinearPair<Point3d, VectorNd<2>>{N, D, z[2]}, Sigma(0.4), mark[side], b[side]);
      EXPECT_TRUE(graph->apply(edit).ok());
      ++side;
    }
    states.push_back(a[0]), states.push_back(b[0]);
    ++step_;
  }
};

// W12
TEST(MarginalRules, SlidingWithLandmarksKeptEndsAtTheGaussianOfTheBatch) {
  for (const SquareRootMethod method : {SquareRootMethod::qr, SquareRootMethod::schur}) {
    Line line;
    NativeEngine window(line.window);
    Marginalizer marginalizer;
    for (int i = 0; i < 25; ++i) {
      line.grow();
      ASSERT_FALSE(window.solve({.max_iterations = 3}).failed());
      const System few = dense_oracle::system(line.window), all = dense_oracle::system(line.batch);
      const MatrixXd x = few.H.inverse(), y = all.H.inverse();
      const VectorXd to_few = -x * few.g, to_all = -y * all.g;
      auto mean = [](const auto& value, const System& s, const VectorXd& step, VariableKey id) {
        VectorXd m = step.segment(s.offsets[s.find(id)], value.kSize);
        for (int k = 0; k < m.size(); ++k) m[k] += value[k];
        return m;
      };
      EXPECT_LT((mean(line.window.value(line.a[0]).v, few, to_few, line.a[0]) -
                 mean(line.batch.value(line.a[1]).v, all, to_all, line.a[1]))
                    .norm(),
                1e-9);
      EXPECT_LT((mean(line.window.value(line.b[0]).v, few, to_few, line.b[0]) -
                 mean(line.batch.value(line.b[1]).v, all, to_all, line.b[1]))
                    .norm(),
                1e-9);
      EXPECT_LT(difference(x(few.scalars({line.a[0], line.b[0]}), few.scalars({line.a[0], line.b[0]})),
                           y(all.scalars({line.a[1], line.b[1]}), all.scalars({line.a[1], line.b[1]}))),
                1e-9);
      if (i < 4) continue;
      GraphEdit edit = line.window.edit();
      const std::vector<VariableKey> oldest = {line.states[0], line.states[1]};
      ASSERT_TRUE(
          marginalizer.marginalize(line.window, oldest, {.landmarks = LandmarkPolicy::keep, .method = method}, edit)
              .ok());
      ASSERT_TRUE(line.window.apply(edit).ok());
      line.states.erase(line.states.begin(), line.states.begin() + 2);
    }
    EXPECT_EQ(line.window.count<Velocity3d>(), 4u);
  }
}

// M11
TEST(MarginalRules, OneMarginalizationTakesNoLongerInALargeGraph) {
  auto seconds = [](int n) {
    Graph graph;
    GraphEdit edit = graph.edit();
    std::vector<VariableId<VectorNd<3>>> ids;
    for (int i = 0; i < n; ++i) {
      ids.push_back(edit.add(VectorNd<3>{}));
      edit.add(Prior{VectorNd<3>{}}, Sigma(1.0), ids.back());
      if (i > 0) edit.add(Between{VectorNd<3>{{{1, 0, 0}}}}, Sigma(0.1), ids[i - 1], ids[i]);
    }
    EXPECT_TRUE(graph.apply(edit).ok());
    Marginalizer marginalizer;
    double best = 1e9;
    for (int round = 0; round < 5; ++round) {
      const auto begin = std::chrono::steady_clock::now();
      for (int i = 10 + 100 * round; i < n && i < 100 + 100 * round; i += 10) {
        const VariableKey id = ids[i];
        edit.clear();
        EXPECT_TRUE(marginalizer.marginalize(graph, {&id, 1}, {}, edit).ok());
        EXPECT_TRUE(graph.apply(edit).ok());
      }
      best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
    }
    return best;
  };
  const double small = seconds(1'000), large = seconds(100'000);
  EXPECT_LT(large, 10.0 * small);  // a hundred times the graph
}

// M11
TEST(MarginalRules, PriorsOnDisjointVariablesCostWhatTheirBlocksCost) {
  Graph graph;
  GraphEdit edit = graph.edit();
  std::vector<VariableId<VectorNd<3>>> ids;
  constexpr int kVariables = 100'000, kGone = 1'000;
  for (int i = 0; i < kVariables; ++i) {
    ids.push_back(edit.add(VectorNd<3>{}));
    edit.add(Prior{VectorNd<3>{}}, Sigma(1.0), ids.back());
    if (i > 0) edit.add(Between{VectorNd<3>{{{1, 0, 0}}}}, Sigma(0.1), ids[i - 1], ids[i]);
  }
  ASSERT_TRUE(graph.apply(edit).ok());
  std::vector<VariableKey> leaving;
  for (int i = 50; i < kVariables; i += kVariables / kGone) leaving.push_back(ids[i]);
  const MarginalizeReport report = leave(graph, leaving);
  EXPECT_EQ(report.priors, kGone);
  // r = d + R e of every prior: as many products as there are numbers in the blocks.
  std::size_t products = 0;
  for (std::uint32_t row = 0; row < graph.priors().extent(); ++row)
    products += static_cast<std::size_t>(graph.priors().shape(row).rows) * graph.priors().shape(row).cols;
  EXPECT_LE(products, std::size_t{kGone} * 36);
  NativeEngine engine(graph);
  const Summary summary = engine.solve({.max_iterations = 2});
  EXPECT_FALSE(summary.failed());
  EXPECT_LT(summary.final_cost, summary.initial_cost);
}

}  // namespace
}  // namespace oriel
