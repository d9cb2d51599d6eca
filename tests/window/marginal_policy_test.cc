// What becomes of variables and factors by policy, and what is kept apart on purpose.
#include <gtest/gtest.h>

#include <algorithm>

#include "oriel/solve/native_engine.h"
#include "window/marginal_problems.h"

namespace oriel {
namespace {

using dense_oracle::VectorXd;
using namespace marginal_problems;

constexpr SquareRootMethod kMethods[] = {SquareRootMethod::qr, SquareRootMethod::schur};

std::vector<FactorId> factors_at(const Graph& graph, VariableKey id) {
  std::vector<FactorId> ids;
  graph.for_each_factor(id, [&](std::uint32_t table, std::uint32_t row) {
    if (table != Graph::kPriorTable)
      ids.push_back({graph.tables()[table]->ops().key, graph.tables()[table]->slots().key(row)});
  });
  return ids;
}

MarginalizeReport absorb(Graph& graph, const std::vector<FactorId>& factors, const MarginalizeOptions& options = {}) {
  Marginalizer marginalizer;
  GraphEdit edit = graph.edit();
  auto report = marginalizer.absorb(graph, factors, options, edit);
  EXPECT_TRUE(report.ok()) << report.error();
  const auto applied = graph.apply(edit);
  EXPECT_TRUE(applied.ok()) << applied.error();
  return *report;
}

// M10
TEST(MarginalPolicy, AbsorbedFactorsLeaveAllVariablesAndTheSolutionOfALinearProblem) {
  for (const SquareRootMethod method : kMethods)
    for (unsigned seed = 1; seed <= 4; ++seed) {
      LinearProblem p(seed);
      const System whole = dense_oracle::system(p.graph);
      const std::size_t factors = p.graph.factor_count();
      std::size_t gone = 0;
      for (const int i : {5, 6, 5, 0}) {
        const std::vector<FactorId> ids = factors_at(p.graph, p.ids[i]);
        const MarginalizeReport report = absorb(p.graph, ids, {.method = method});
        EXPECT_EQ(report.absorbed_factors, static_cast<int>(ids.size()));
        gone += ids.size();
        for (const FactorId id : ids) EXPECT_FALSE(p.graph.contains(id));
        expect_same_system(whole, p.graph, 1e-9);
        expect_same_gaussian(whole, p.graph, 1e-9);
      }
      EXPECT_EQ(p.graph.variable_count(), 16u);
      EXPECT_EQ(p.graph.factor_count(), factors - gone + p.graph.priors().slots().size());
    }
}

// M10
TEST(MarginalPolicy, AnAbsorbedFactorJoinsThePriorThatKnowsItsVariablesAndTiesNothingElse) {
  LinearProblem p(3);
  leave(p.graph, {p.ids[5]}, {.landmarks = LandmarkPolicy::keep});  // its prior is on 1, 4, 6 and 9
  ASSERT_EQ(p.graph.priors().slots().size(), 1u);
  const System whole = dense_oracle::system(p.graph);
  std::vector<FactorId> own;
  for (const FactorId id : factors_at(p.graph, p.ids[9]))
    if (p.graph.find_factor_ops(id.table)->variables.size() == 1) own.push_back(id);
  ASSERT_EQ(own.size(), 1u);
  const MarginalizeReport joined = absorb(p.graph, own);
  EXPECT_EQ(joined.absorbed_priors, 1);
  EXPECT_EQ(p.graph.priors().slots().size(), 1u);
  expect_same_system(whole, p.graph, 1e-10);

  const MarginalizeReport apart = absorb(p.graph, factors_at(p.graph, p.ids[15]));
  EXPECT_EQ(apart.absorbed_priors, 0);
  EXPECT_EQ(apart.priors, 3);  // its own, and one with each of two neighbours
  EXPECT_EQ(p.graph.priors().slots().size(), 4u);
  expect_same_system(whole, p.graph, 1e-10);
}

// M10
TEST(MarginalPolicy, AbsorbingRefusesStaleAndDoubleFactors) {
  LinearProblem p(1);
  const std::vector<FactorId> ids = factors_at(p.graph, p.ids[0]);
  const std::vector<FactorId> twice = {ids[0], ids[1], ids[0]}, stale = {FactorId{ids[0].table, {7777, 1}}};
  Marginalizer marginalizer;
  GraphEdit edit = p.graph.edit();
  EXPECT_EQ(marginalizer.absorb(p.graph, twice, {}, edit).error().code, ErrorCode::duplicate);
  EXPECT_EQ(marginalizer.absorb(p.graph, stale, {}, edit).error().code, ErrorCode::stale_id);
  EXPECT_TRUE(edit.empty());
}

// M10
TEST(MarginalPolicy, AbsorbsWithoutFillingInAChain) {
  Graph graph;
  GraphEdit edit = graph.edit();
  std::vector<FactorId> motions;
  VariableId<VectorNd<3>> last;
  for (int i = 0; i < 400; ++i) {
    const auto x = edit.add(VectorNd<3>{});
    if (i > 0) motions.push_back(edit.add(Between{VectorNd<3>{{{1, 0, 0}}}}, Sigma(0.1), last, x));
    last = x;
  }
  ASSERT_TRUE(graph.apply(edit).ok());
  const MarginalizeReport report = absorb(graph, motions);
  EXPECT_EQ(report.priors, 399);
  EXPECT_EQ(report.prior_cols, 399 * 6);
  EXPECT_EQ(report.prior_rows, 399 * 3);
}

// M10
TEST(MarginalPolicy, AVariableThatIsConditionedLeavesAsKnownAndOneThatIsFixedStays) {
  for (const SquareRootMethod method : kMethods)
    for (const Departure departure : {Departure::condition, Departure::fix}) {
      VisualProblem p(0.01);
      leave(p.graph, {p.poses[0]}, {.landmarks = LandmarkPolicy::keep, .method = method});
      const System whole = dense_oracle::system(p.graph);
      const TypePolicy types[] = {policy_for<Pose3d>(departure)};
      leave(p.graph, {p.poses[1], p.depths[1]}, {.landmarks = LandmarkPolicy::keep, .method = method, .types = types});
      EXPECT_EQ(p.graph.contains(p.poses[1]), departure == Departure::fix);
      EXPECT_EQ(p.graph.fixed(p.poses[1]), departure == Departure::fix);
      EXPECT_FALSE(p.graph.contains(p.depths[1]));
      // The oracle: the same system with the pose's rows and columns struck out.
      System known = whole;
      const int at = whole.find(p.poses[1]);
      for (int i = whole.offsets[at]; i < whole.offsets[at + 1]; ++i)
        known.H.row(i).setZero(), known.H.col(i).setZero(), known.H(i, i) = 1.0, known.g(i) = 0.0;
      expect_same_system(known, p.graph, 1e-10);
    }
}

// M10
TEST(MarginalPolicy, DropsVariablesWithTheirFactorsAndCountsThem) {
  VisualProblem p(0.01), without(0.01);
  const TypePolicy types[] = {policy_for<Pose3d>(Departure::drop)};
  const MarginalizeReport report = leave(p.graph, {p.poses[0]}, {.types = types});
  GraphEdit edit = without.graph.edit();
  edit.remove(without.poses[0]);
  for (const auto id : without.depths) {
    bool alone = true;
    without.graph.for_each_factor(id, [&](std::uint32_t table, std::uint32_t row) {
      const VariableRef& anchor = without.graph.tables()[table]->variables(row)[0];
      alone = alone && without.poses[0].key == without.graph.pools()[anchor.pool]->slots().key_of_slot(anchor.slot);
    });
    if (alone) edit.remove(id);
  }
  ASSERT_TRUE(without.graph.apply(edit).ok());
  EXPECT_EQ(report.dropped_variables, 1);
  EXPECT_EQ(report.dropped_with_landmarks, 26);
  EXPECT_EQ(report.dropped_landmarks, 8);
  EXPECT_EQ(report.absorbed_factors + report.priors, 0);
  EXPECT_EQ(p.graph.factor_count(), without.graph.factor_count());
  const System a = dense_oracle::system(p.graph), b = dense_oracle::system(without.graph);
  EXPECT_EQ(difference(a.H, b.H), 0.0);
  EXPECT_EQ(a.variables.size(), b.variables.size());
}

// M10
TEST(MarginalPolicy, KeepsWhatAPriorSaysAboutTheRestWhenAVariableInItIsDropped) {
  LinearProblem p(4);
  leave(p.graph, {p.ids[5]}, {.landmarks = LandmarkPolicy::keep});
  System before = dense_oracle::layout(p.graph);
  dense_oracle::add_prior(before, p.graph, 0);
  const TypePolicy types[] = {{p.ids[6].type, Departure::drop}};
  const System rest_before = dense_oracle::system(p.graph);
  leave(p.graph, {p.ids[6]}, {.landmarks = LandmarkPolicy::keep, .types = types});
  System after = dense_oracle::layout(p.graph);
  for (std::uint32_t row = 0; row < p.graph.priors().extent(); ++row)
    if (p.graph.priors().slots().is_live(row)) dense_oracle::add_prior(after, p.graph, row);
  const System want = dense_oracle::schur_complement(before, after);
  EXPECT_LT(difference(after.H, want.H), 1e-12);
  EXPECT_LT(difference(after.g, want.g), 1e-12);
  EXPECT_GT(rest_before.H.rows(), after.H.rows());
}

// Information of the prior over `ids` alone.
MatrixXd information(const System& s, const std::vector<VariableKey>& ids) {
  const std::vector<int> scalars = s.scalars(ids);
  return s.H(scalars, scalars);
}

// M10
TEST(MarginalPolicy, LeavesNamedTypesUntiedByTheirOwnMarginalsOrByNothing) {
  for (const Tie tie : {Tie::own, Tie::none}) {
    LinearProblem tied(6), untied(6);
    const std::vector<VariableKey> leaving = {tied.ids[5], tied.ids[10]};
    leave(tied.graph, leaving, {.landmarks = LandmarkPolicy::keep});
    const VariableKey apart = tied.ids[6];
    const TypePolicy types[] = {{apart.type, Departure::marginalize, tie}};
    const MarginalizeReport report = leave(untied.graph, leaving, {.landmarks = LandmarkPolicy::keep, .types = types});
    System joint = dense_oracle::layout(tied.graph), parts = dense_oracle::layout(untied.graph);
    for (System* s : {&joint, &parts}) {
      const Graph& graph = s == &joint ? tied.graph : untied.graph;
      for (std::uint32_t row = 0; row < graph.priors().extent(); ++row)
        if (graph.priors().slots().is_live(row)) dense_oracle::add_prior(*s, graph, row);
    }
    std::vector<VariableKey> touched, others, named;
    for (std::size_t i = 0; i < joint.variables.size(); ++i) {
      const int at = joint.offsets[i];
      if (joint.H.row(at).norm() == 0.0) continue;
      touched.push_back(joint.variables[i]);
      (joint.variables[i].type == apart.type ? named : others).push_back(joint.variables[i]);
    }
    ASSERT_GE(named.size(), 1u);
    const int n = static_cast<int>(named.size()), m = static_cast<int>(others.size());
    EXPECT_EQ(report.dropped_ties, n * m + n * (n - 1) / 2);
    const MatrixXd all = information(joint, touched), kept = information(parts, touched);
    auto marginal = [&](const std::vector<VariableKey>& ids) {
      System of;
      of.variables = ids;
      return dense_oracle::schur_complement(joint, of).H;
    };
    EXPECT_LT(difference(information(parts, others), marginal(others)), 1e-10);
    for (const VariableKey& a : named)
      EXPECT_LT(difference(information(parts, {a}), tie == Tie::own ? marginal({a}) : marginal({a}) * 0.0), 1e-10);
    // Correlation is gone, and with `none` nothing is claimed that was not known.
    for (const VariableKey& a : named)
      for (const VariableKey& b : touched) {
        if (a == b) continue;
        const MatrixXd block = parts.H(parts.scalars({a}), parts.scalars({b}));
        EXPECT_EQ(block.norm(), 0.0);
      }
    if (tie == Tie::none) {
      EXPECT_GT(MatrixXd(all - kept).selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(), -1e-9);
    }
  }
}

}  // namespace
}  // namespace oriel
