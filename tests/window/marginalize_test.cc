#include "oriel/window/marginalize.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "oriel/solve/native_engine.h"
#include "window/marginal_problems.h"

namespace oriel {
namespace {

using dense_oracle::VectorXd;
using namespace marginal_problems;

constexpr SquareRootMethod kMethods[] = {SquareRootMethod::automatic, SquareRootMethod::qr, SquareRootMethod::schur};

// M1
TEST(Marginalize, LeavesMeansAndCovariancesOfTheRestAsTheyWere) {
  for (const SquareRootMethod method : kMethods)
    for (unsigned seed = 1; seed <= 6; ++seed) {
      LinearProblem p(seed);
      const System whole = dense_oracle::system(p.graph);
      std::shuffle(p.ids.begin(), p.ids.end(), std::mt19937(seed));
      for (int i = 0; i < 12; ++i) {
        leave(p.graph, {p.ids[i]}, {.landmarks = LandmarkPolicy::keep, .method = method});
        expect_same_gaussian(whole, p.graph, 1e-9);
      }
      EXPECT_EQ(p.graph.variable_count(), 4u);
    }
}

// M1
TEST(Marginalize, TakesAVariableThatAFactorNamesTwice) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto a = edit.add(VectorNd<3>{}), b = edit.add(VectorNd<3>{});
  edit.add(Prior{VectorNd<3>{{{1, 2, 3}}}}, Sigma(0.5), a);
  Mat3d A = Mat3d::identity(), B = Mat3d::identity() * 2.0;
  A(0, 1) = 3.0, B(2, 0) = -1.0;
  edit.add(LinearPair<VectorNd<3>, VectorNd<3>>{A, B, {{1, 1, 1}}}, Sigma(1.0), b, b);
  edit.add(Between{VectorNd<3>{}}, Sigma(1.0), a, b);
  ASSERT_TRUE(graph.apply(edit).ok());
  const System whole = dense_oracle::system(graph);
  leave(graph, {a}, {.method = SquareRootMethod::schur});
  expect_same_gaussian(whole, graph, 1e-12);
}

// M2
TEST(Marginalize, LeavesTheDenseSchurComplementNearAndFarFromConvergence) {
  for (const double error : {0.0, 1e-3, 0.05})
    for (const SquareRootMethod method : kMethods)
      for (const LandmarkPolicy policy : {LandmarkPolicy::keep, LandmarkPolicy::close}) {
        VisualProblem p(error, 5, 30, Huber(1.5));
        const System whole = dense_oracle::system(p.graph);
        leave(p.graph, {p.poses[0]}, {.landmarks = policy, .method = method});
        expect_same_system(whole, p.graph, 1e-10);
        leave(p.graph, {p.poses[1]}, {.landmarks = policy, .method = method});
        expect_same_system(whole, p.graph, 1e-10);
      }
}

// M2
TEST(Marginalize, TakesLandmarksAwayInChunksWithTheSameResult) {
  VisualProblem p(0.01, 4, 3 * MarginalScope::kChunk + 5);
  const System whole = dense_oracle::system(p.graph);
  const std::vector<VariableKey> all(p.depths.begin(), p.depths.end());
  leave(p.graph, all, {.method = SquareRootMethod::schur});
  EXPECT_EQ(p.graph.count<InverseDepthd>(), 0u);
  expect_same_system(whole, p.graph, 1e-10);
}

// M3
TEST(Marginalize, DoesTwoInEitherOrderAsBothAtOnce) {
  std::vector<System> results;
  for (const std::vector<std::vector<int>>& order :
       std::vector<std::vector<std::vector<int>>>{{{0, 1}}, {{0}, {1}}, {{1}, {0}}}) {
    VisualProblem p(0.02);
    for (const std::vector<int>& step : order) {
      std::vector<VariableKey> leaving;
      for (int i : step) leaving.push_back(p.poses[i]);
      leave(p.graph, leaving);
    }
    results.push_back(dense_oracle::system(p.graph));
  }
  for (int i = 1; i < 3; ++i) {
    ASSERT_EQ(results[i].variables.size(), results[0].variables.size());
    EXPECT_LT(difference(results[i].H, results[0].H), 1e-9);
    EXPECT_LT(difference(results[i].g, results[0].g), 1e-9);
  }
}

// M4
TEST(Marginalize, NamesALeavingScalarThatNothingDeterminesOrKeepsTheNullSpace) {
  for (const SquareRootMethod method : kMethods) {
    Graph graph;
    GraphEdit edit = graph.edit();
    const auto x = edit.add(Velocity3d{}, Label("x"));
    const auto y = edit.add(VectorNd<2>{}), z = edit.add(VectorNd<2>{});
    Mat3d A = Mat3d::zero();  // only the sum of two components of x is seen
    A(0, 0) = A(0, 1) = 1.0, A(1, 2) = 2.0;
    edit.add(LinearPair<Velocity3d, VectorNd<2>>{A, {{1, 2, 3, 4, 5, 7}}, {{1, 2, 3}}}, Sigma(1.0), x, y);
    edit.add(LinearPair<Velocity3d, VectorNd<2>>{A * 0.5, {{3, 1, 2, 2, 1, 0}}, {{0, 2, 0}}}, Sigma(1.0), x, z);
    ASSERT_TRUE(graph.apply(edit).ok());
    const System whole = dense_oracle::system(graph);
    const std::uint64_t version = graph.version();

    Marginalizer marginalizer;
    const std::vector<VariableKey> leaving = {x};
    const auto refused =
        marginalizer.marginalize(graph, leaving, {.fail_if_undetermined = true, .method = method}, edit);
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::singular);
    EXPECT_NE(refused.error().message.find("velocity y [m/s] of velocity3/1 'x'"), std::string::npos)
        << refused.error();
    EXPECT_TRUE(edit.empty());
    EXPECT_EQ(graph.version(), version);

    const MarginalizeReport report = leave(graph, leaving, {.method = method});
    ASSERT_EQ(report.undetermined.size(), 1u);
    EXPECT_EQ(report.undetermined[0].tangent, 1);
    EXPECT_EQ(report.prior_rows, 4);
    expect_same_system(whole, graph, 1e-12);
  }
}

// M4
TEST(Marginalize, RefusesStaleAndDoubleIdsAndConstantsAndLeavesTheGraphAlone) {
  VisualProblem p(0.0);
  Marginalizer marginalizer;
  GraphEdit edit = p.graph.edit();
  VariableId<StereoRigd> rig;
  p.graph.for_each<StereoRigd>([&](auto id, const StereoRigd&) { rig = id; });
  auto code = [&](std::vector<VariableKey> leaving) {
    const auto result = marginalizer.marginalize(p.graph, leaving, {}, edit);
    return result.ok() ? ErrorCode::io : result.error().code;
  };
  EXPECT_EQ(code({p.poses[0], p.poses[0]}), ErrorCode::duplicate);
  EXPECT_EQ(code({rig}), ErrorCode::bad_input);
  EXPECT_EQ(code({VariableId<Pose3d>{{77, 1}}}), ErrorCode::stale_id);
  EXPECT_EQ(code({VariableId<Velocity3d>{{0, 1}}}), ErrorCode::stale_id);
  EXPECT_TRUE(edit.empty());
}

TEST(Marginalize, IsRefusedByAGraphThatChangedSince) {
  VisualProblem p(0.0);
  Marginalizer marginalizer;
  GraphEdit edit = p.graph.edit(), late = p.graph.edit();
  const std::vector<VariableKey> leaving = {p.poses[0]};
  ASSERT_TRUE(marginalizer.marginalize(p.graph, leaving, {}, edit).ok());
  late.add(Prior{Pose3d{}}, Sigma(1.0), p.poses[0]);
  ASSERT_TRUE(p.graph.apply(late).ok());
  const auto refused = p.graph.apply(edit);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::conflict);
}

// Steps by dense algebra, whatever the cost says: it cannot tell steps below 1e-8 apart.
void converge(VisualProblem& p) {
  for (int round = 0; round < 3; ++round) {
    const System whole = dense_oracle::system(p.graph);
    const Eigen::VectorXd step = -whole.H.ldlt().solve(whole.g);
    GraphEdit edit = p.graph.edit();
    auto move = [&]<class V>(VariableId<V> id) {
      Vec<double, V::kDim> d;
      for (int i = 0; i < V::kDim; ++i) d[i] = step[whole.offsets[whole.find(id)] + i];
      edit.set(id, p.graph.value(id).plus(d));
    };
    for (const auto id : p.poses) move(id);
    for (const auto id : p.depths) move(id);
    ASSERT_TRUE(p.graph.apply(edit).ok());
  }
}

// M5
TEST(Marginalize, OfAllLandmarksAtConvergenceLeavesNothingToStep) {
  VisualProblem p(0.01);
  NativeEngine engine(p.graph);
  ASSERT_TRUE(engine.solve({.function_tolerance = 0.0, .gradient_tolerance = 1e-9}).converged());
  converge(p);
  const std::vector<VariableKey> all(p.depths.begin(), p.depths.end());
  leave(p.graph, all);
  for (const auto& table : p.graph.tables())
    if (table->ops().residual.find("reprojection") != std::string_view::npos) {
      EXPECT_EQ(table->slots().size(), 0u);
    }
  const System rest = dense_oracle::system(p.graph);
  EXPECT_LT((rest.H.ldlt().solve(rest.g)).norm(), 1e-9);
}

// M6
TEST(Marginalize, AbsorbsWithTheRobustWeightAndDropsWhatIsInvalidOrAnOutlier) {
  VisualProblem p(0.001, 3, 12, Huber(1.0));
  GraphEdit edit = p.graph.edit();
  VariableId<StereoRigd> rig;
  p.graph.for_each<StereoRigd>([&](auto id, const StereoRigd&) { rig = id; });
  const auto behind = edit.add(InverseDepthd{100.0}), wild = edit.add(InverseDepthd{0.2});
  edit.add(StereoReprojectiond{{{0.0, 0.0}}, {{300, 200}}, {{300, 200}}}, Sigma(1.0), p.poses[0], p.poses[1], behind,
           rig);
  edit.add(StereoReprojectiond{{{0.0, 0.0}}, {{900, 900}}, {{900, 900}}}, Sigma(1.0), Huber(1.0), p.poses[0],
           p.poses[1], wild, rig);
  ASSERT_TRUE(p.graph.apply(edit).ok());
  Graph& graph = p.graph;
  const System whole = dense_oracle::system(graph);  // invalid factors are not in it
  Marginalizer marginalizer;
  edit.clear();
  const std::vector<VariableKey> leaving = {p.poses[0]};
  const auto all = marginalizer.marginalize(graph, leaving, {.method = SquareRootMethod::schur}, edit);
  ASSERT_TRUE(all.ok());
  EXPECT_EQ(all->dropped_invalid, 1);
  EXPECT_EQ(all->dropped_outliers, 0);
  const MarginalizeReport report =
      leave(graph, leaving, {.outlier_threshold = 50.0, .method = SquareRootMethod::schur});
  EXPECT_EQ(report.dropped_invalid, 1);
  EXPECT_EQ(report.dropped_outliers, 1);
  EXPECT_EQ(report.absorbed_factors, all->absorbed_factors - 1);
  VisualProblem clean(0.001, 3, 12, Huber(1.0));
  const System without = dense_oracle::system(clean.graph);
  expect_same_system(without, graph, 1e-11);
  const std::vector<int> both = whole.scalars(without.variables);
  EXPECT_GT(difference(MatrixXd(whole.H(both, both)), without.H), 1e-6);  // the outlier had its weight
}

// M7
TEST(Marginalize, NeverLowersTheInformationOfNeighboursAndHoldsThemAgainstALaterConflict) {
  auto pulled = [](bool marginalize) {
    LinearProblem p(5);
    std::vector<VariableKey> leaving(p.ids.begin(), p.ids.begin() + 4);
    const System before = dense_oracle::system(p.graph);
    if (marginalize) {
      leave(p.graph, leaving, {.landmarks = LandmarkPolicy::keep});
    } else {
      GraphEdit edit = p.graph.edit();
      for (const VariableKey& id : leaving) edit.remove(id);
      EXPECT_TRUE(p.graph.apply(edit).ok());
    }
    const System after = dense_oracle::system(p.graph);
    const std::vector<int> keep = before.scalars(after.variables);
    const MatrixXd fall = MatrixXd(before.H.inverse())(keep, keep) - after.H.inverse();  // ≥ 0: covariance fell
    if (marginalize) {
      EXPECT_GT(fall.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(), -1e-9);
    }
    VectorXd push = VectorXd::Zero(after.H.rows());
    push(after.offsets[after.find(p.ids[4])]) = 1.0;
    return (after.H + MatrixXd(push.asDiagonal())).ldlt().solve(push).norm();
  };
  EXPECT_LT(pulled(true), pulled(false));
}

TEST(Marginalize, DropsLandmarksWithTheirFactorsWhereAskedTo) {
  VisualProblem p(0.01);
  const MarginalizeReport report = leave(p.graph, {p.poses[0]}, {.landmarks = LandmarkPolicy::drop});
  EXPECT_EQ(report.dropped_landmarks, 8);
  EXPECT_EQ(report.dropped_with_landmarks, 24);
  EXPECT_EQ(report.absorbed_factors, 2);  // the prior and one motion
  EXPECT_EQ(p.graph.count<InverseDepthd>(), 22u);
}

TEST(Marginalize, ClosesLandmarksAndUsesEachObservationOnce) {
  VisualProblem p(0.01);
  const std::size_t factors = p.graph.factor_count();
  const MarginalizeReport report = leave(p.graph, {p.poses[0]});
  EXPECT_EQ(report.closed_landmarks, 8);
  EXPECT_EQ(report.absorbed_factors, 26);
  EXPECT_EQ(p.graph.factor_count(), factors - 26 + 1);
}

TEST(Marginalize, TakesFixedVariablesAsKnown) {
  for (const SquareRootMethod method : kMethods) {
    VisualProblem p(0.01);
    GraphEdit edit = p.graph.edit();
    edit.fix(p.poses[0]);
    edit.fix(p.poses[2]);
    ASSERT_TRUE(p.graph.apply(edit).ok());
    const System whole = dense_oracle::system(p.graph);
    leave(p.graph, {p.poses[0], p.poses[1]}, {.method = method});
    expect_same_system(whole, p.graph, 1e-10);
  }
}

// M11
TEST(Marginalize, KeepsPriorsOnDisjointVariablesApart) {
  Graph graph;
  GraphEdit edit = graph.edit();
  std::vector<VariableId<VectorNd<3>>> ids;
  for (int i = 0; i < 100'000; ++i) {
    ids.push_back(edit.add(VectorNd<3>{}));
    edit.add(Prior{VectorNd<3>{}}, Sigma(1.0), ids.back());
    if (i > 0) edit.add(Between{VectorNd<3>{{{1, 0, 0}}}}, Sigma(0.1), ids[i - 1], ids[i]);
  }
  ASSERT_TRUE(graph.apply(edit).ok());
  std::vector<VariableKey> leaving;
  for (int i = 50; i < 100'000; i += 200) leaving.push_back(ids[i]);
  const MarginalizeReport at_once = leave(graph, leaving);
  EXPECT_EQ(at_once.priors, 500);
  EXPECT_EQ(at_once.prior_cols, 3000);
  Marginalizer marginalizer;
  for (int i = 150; i < 100'000; i += 200) {
    const VariableKey id = ids[i];
    ASSERT_TRUE(marginalizer.marginalize(graph, {&id, 1}, {}, edit).ok());
    ASSERT_TRUE(graph.apply(edit).ok());
  }
  EXPECT_EQ(graph.priors().slots().size(), 1000u);
  std::size_t numbers = 0;
  for (std::uint32_t row = 0; row < graph.priors().extent(); ++row)
    if (graph.priors().slots().is_live(row)) numbers += graph.priors().block(row).size();
  EXPECT_LE(numbers, 1000u * (6 + 6 + 36));
}

// V6
TEST(Graph, RemovingAVariableTakesItAloneOutOfALinearPrior) {
  LinearProblem p(2);
  leave(p.graph, {p.ids[5]}, {.landmarks = LandmarkPolicy::keep});
  System before = dense_oracle::layout(p.graph), after = before;
  ASSERT_EQ(p.graph.priors().slots().size(), 1u);
  dense_oracle::add_prior(before, p.graph, 0);
  const VariableKey gone = dense_oracle::key_of(p.graph, p.graph.priors().variables(0)[1]);
  GraphEdit edit = p.graph.edit();
  edit.remove(gone);
  ASSERT_TRUE(p.graph.apply(edit).ok());
  ASSERT_EQ(p.graph.priors().slots().size(), 1u);
  after = dense_oracle::layout(p.graph);
  for (std::uint32_t row = 0; row < p.graph.priors().extent(); ++row)
    if (p.graph.priors().slots().is_live(row)) dense_oracle::add_prior(after, p.graph, row);
  const System want = dense_oracle::schur_complement(before, after);
  EXPECT_LT(difference(after.H, want.H), 1e-12);
  EXPECT_LT(difference(after.g, want.g), 1e-12);
}

}  // namespace
}  // namespace oriel
