// What a marginalization that fails, or that leaves things out, may not do.
#include <gtest/gtest.h>

#include <limits>

#include "oriel/graph/fingerprint.h"
#include "oriel/window/window_core.h"
#include "window/marginal_problems.h"

namespace oriel {
namespace {

using namespace marginal_problems;

constexpr SquareRootMethod kMethods[] = {SquareRootMethod::qr, SquareRootMethod::schur};

// Three pairs that know nothing of each other: in two of them the one that leaves is whole, in the last a scalar of it
// is seen by nothing.
struct ThreePairs {
  WindowCore core;
  std::vector<VariableKey> leaving, staying;

  ThreePairs() {
    GraphEdit& edit = core.edit();
    for (int k = 0; k < 3; ++k) {
      const auto x = edit.add(Velocity3d{{{1.0, 2.0, 3.0}}});
      const auto y = edit.add(VectorNd<3>{{{0.1 * k, 0.2, 0.3}}});
      Mat3d A = Mat3d::identity() * 2.0;
      if (k == 2) A(1, 1) = 0.0;
      edit.add(LinearPair<Velocity3d, VectorNd<3>>{A, Mat3d::identity(), {{1.0, 0.5, -1.0}}}, Sigma(0.5), x, y);
      edit.add(Prior{VectorNd<3>{}}, Sigma(2.0), y);
      if (k < 2) edit.add(Prior{Velocity3d{}}, Sigma(1.5), x);
      leaving.push_back(x), staying.push_back(y);
    }
    EXPECT_TRUE(core.commit().ok());
  }
};

// M4
TEST(MarginalFailures, LeaveTheGraphAndTheLedgerBitIdenticalHoweverFarTheyWere) {
  for (const SquareRootMethod method : kMethods) {
    ThreePairs p;
    LateLedger ledger;
    MarginalizeOptions options{.fail_if_undetermined = true, .method = method};
    options.ledger = &ledger;
    const std::uint64_t before = fingerprint(p.core.graph()), version = p.core.graph().version();
    const auto refused = p.core.slide(p.leaving, options);  // two priors were made when the third pair fails
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::singular);
    EXPECT_TRUE(p.core.edited().empty());
    EXPECT_EQ(fingerprint(p.core.graph()), before);
    EXPECT_EQ(p.core.graph().version(), version);
    ledger.commit(Time{1});  // nothing is staged
    EXPECT_EQ(ledger.size(), 0u);
    for (const VariableKey id : p.leaving) EXPECT_FALSE(ledger.holds(id));
    // The workspace is not spoilt: the same without the pair that fails is done.
    p.leaving.pop_back();
    ASSERT_TRUE(p.core.slide(p.leaving, options).ok());
    EXPECT_EQ(p.core.graph().priors().slots().size(), 2u);
  }
}

// M4
TEST(MarginalFailures, KeepTheNullSpaceOfOneBlockAndAllOfTheOthersWhereTheyMay) {
  for (const SquareRootMethod method : kMethods) {
    ThreePairs p;
    const System whole = dense_oracle::system(p.core.graph());
    const auto report = p.core.slide(p.leaving, {.method = method});
    ASSERT_TRUE(report.ok()) << report.error();
    ASSERT_EQ(report->undetermined.size(), 1u);
    EXPECT_EQ(report->undetermined[0].id, p.leaving[2]);
    EXPECT_EQ(report->undetermined[0].tangent, 1);
    expect_same_system(whole, p.core.graph(), 1e-12);
  }
}

// M4
TEST(MarginalFailures, NameADirectionThatSeveralLeavingVariablesShare) {
  for (const SquareRootMethod method : kMethods)
    for (const bool fail : {false, true}) {
      Graph graph;
      GraphEdit edit = graph.edit();
      std::vector<VariableKey> leaving;
      VariableId<VectorNd<3>> last;
      for (int k = 0; k < 4; ++k) {  // a chain that hangs from nothing
        const auto x = edit.add(VectorNd<3>{});
        if (k > 0) edit.add(Between{VectorNd<3>{{{1, 0, 0}}}}, Sigma(0.1 * k), last, x);
        leaving.push_back(last = x);
      }
      ASSERT_TRUE(graph.apply(edit).ok());
      Marginalizer marginalizer;
      const auto report =
          marginalizer.marginalize(graph, leaving, {.fail_if_undetermined = fail, .method = method}, edit);
      ASSERT_EQ(report.ok(), !fail);
      if (fail) {
        EXPECT_EQ(report.error().code, ErrorCode::singular);
        continue;
      }
      EXPECT_EQ(report->undetermined.size(), 3u);
      EXPECT_EQ(report->priors, 0);
    }
}

// M4: eliminated on its own, before the rest. One camera sees it once.
TEST(MarginalFailures, NameALandmarkThatOneRayDoesNotPlaceAndKeepItsNullSpace) {
  for (const SquareRootMethod method : kMethods)
    for (const bool fail : {false, true}) {
      VisualProblem p(0.0, 3, 6);
      VariableId<StereoRigd> rig;
      p.graph.for_each<StereoRigd>([&](auto id, const StereoRigd&) { rig = id; });
      GraphEdit edit = p.graph.edit();
      const auto point = edit.add(Point3d{{{1.0, 0.3, 0.2}}}, Label("far"));
      edit.add(MonoPointReprojectiond{{{300.0, 200.0}}}, Sigma(1.0), p.poses[0], point, rig);
      ASSERT_TRUE(p.graph.apply(edit).ok());
      const StereoRigd value = p.graph.value(rig);
      const Vec3d p_world = p.graph.value(p.poses[0]) * (value.cameras[0].T_body_camera() * Vec3d{{0.1, -0.2, 4.0}});
      edit.clear();
      edit.set(point, Point3d{p_world});
      ASSERT_TRUE(p.graph.apply(edit).ok());
      const System whole = dense_oracle::system(p.graph);
      const std::uint64_t before = fingerprint(p.graph);
      Marginalizer marginalizer;
      const std::vector<VariableKey> leaving = {p.poses[0]};
      const auto report =
          marginalizer.marginalize(p.graph, leaving, {.fail_if_undetermined = fail, .method = method}, edit);
      EXPECT_EQ(fingerprint(p.graph), before);
      if (fail) {
        ASSERT_FALSE(report.ok());
        EXPECT_EQ(report.error().code, ErrorCode::singular);
        EXPECT_NE(report.error().message.find("'far'"), std::string::npos) << report.error();
        EXPECT_TRUE(edit.empty());
        continue;
      }
      ASSERT_TRUE(report.ok()) << report.error();
      ASSERT_EQ(report->undetermined.size(), 1u);
      EXPECT_EQ(report->undetermined[0].id, VariableKey(point));
      ASSERT_TRUE(p.graph.apply(edit).ok());
      expect_same_system(whole, p.graph, 1e-9);
    }
}

// r = x - z of any size, which is no number where z is.
struct Fragile {
  static constexpr std::string_view kName = "test.fragile/1";
  static constexpr int kDim = 1;
  using Variables = Types<VectorNd<1>, VectorNd<1>>;
  double z = 0.0, fails_beyond = 1e9;
  bool evaluate(const VectorNd<1>& x, const VectorNd<1>& y, Vec<double, 1>& r, Mat<double, 1, 1>* J_x,
                Mat<double, 1, 1>* J_y) const {
    r[0] = std::abs(x.v[0]) > fails_beyond ? std::numeric_limits<double>::quiet_NaN() : y.v[0] - x.v[0] - z;
    if (J_x != nullptr) (*J_x)(0, 0) = -1.0, (*J_y)(0, 0) = 1.0;
    return true;
  }
  bool finite() const { return std::isfinite(z); }
};

// M6
TEST(MarginalFailures, DropAndCountWhatIsBeyondTheThresholdOrNoNumberUnderEveryLoss) {
  for (const SquareRootMethod method : kMethods)
    for (const Loss& loss : {Loss::none(), Huber(1.0), Cauchy(2.0), GemanMcClure(2.0), Tukey(4.685),
                             TruncatedSquares(3.0), TruncatedSquares(3.0, 2.0), Barron(2.0, -2.0)}) {
      auto left = [&](bool with_bad_ones, MarginalizeReport& report) {
        Graph graph;
        GraphEdit edit = graph.edit();
        const auto x = edit.add(VectorNd<1>{{{1.0}}}), y = edit.add(VectorNd<1>{{{2.0}}});
        edit.add(Prior{VectorNd<1>{{{1.0}}}}, Sigma(0.3), x);
        edit.add(Fragile{0.9}, Sigma(0.1), loss, x, y);
        edit.add(Fragile{1.1}, Sigma(0.2), loss, x, y);
        if (with_bad_ones) edit.add(Fragile{60.0}, Sigma(0.1), loss, x, y);
        if (with_bad_ones) edit.add(Fragile{1.0, 0.5}, Sigma(0.1), loss, x, y);
        EXPECT_TRUE(graph.apply(edit).ok());
        report = leave(graph, {x}, {.outlier_threshold = 20.0, .method = method});
        return dense_oracle::system(graph);
      };
      MarginalizeReport with, without;
      const System a = left(true, with), b = left(false, without);
      EXPECT_EQ(with.dropped_outliers, 1) << static_cast<int>(loss.kind);
      EXPECT_EQ(with.dropped_invalid, 1);
      EXPECT_EQ(with.absorbed_factors, 3);
      EXPECT_EQ(without.absorbed_factors, 3);
      EXPECT_EQ(without.dropped_outliers + without.dropped_invalid, 0);
      EXPECT_GT(b.H.norm(), 1.0);
      EXPECT_LT(difference(a.H, b.H), 1e-12);
      EXPECT_LT(difference(a.g, b.g), 1e-12);
    }
}

}  // namespace
}  // namespace oriel
