// Marginalization where directions are held: what leaves is what was free of it, what stays keeps all that is said.
#include "oriel/window/held_columns.h"

#include <gtest/gtest.h>

#include "oriel/solve/native_engine.h"
#include "solve/freedom_world.h"
#include "window/marginal_problems.h"

namespace oriel {
namespace {

using dense_oracle::VectorXd;
using namespace marginal_problems;
using testing_freedom::World;

constexpr SquareRootMethod kMethods[] = {SquareRootMethod::qr, SquareRootMethod::schur};

// Columns: the free directions of these variables, over all scalars of the system.
MatrixXd free_directions(const Graph& graph, const System& s, const std::vector<VariableKey>& ids) {
  std::vector<VectorXd> columns;
  for (const VariableKey& id : ids) {
    const int dim = graph.find_ops(id.type)->dim, at = s.offsets[static_cast<std::size_t>(s.find(id))];
    const MatrixXd B = testing_freedom::axes_of(graph, id, dim);
    for (int k = 0; k < dim; ++k) {
      if (graph.freedom(id).holds(k)) continue;
      VectorXd column = VectorXd::Zero(s.H.rows());
      column.segment(at, dim) = B.row(k).transpose();
      columns.push_back(column);
    }
  }
  MatrixXd N(s.H.rows(), static_cast<Eigen::Index>(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) N.col(static_cast<Eigen::Index>(k)) = columns[k];
  return N;
}

// What is left of `whole` where the free directions N of what leaves are eliminated and its held ones are known.
void expect_rest(const System& whole, const MatrixXd& N, const Graph& graph, double tolerance) {
  const System rest = dense_oracle::system(graph);
  const std::vector<int> keep = whole.scalars(rest.variables);
  const MatrixXd HN = whole.H * N, B = HN(keep, Eigen::all);
  const Eigen::LDLT<MatrixXd> A(MatrixXd(N.transpose() * HN));
  EXPECT_LT(difference(rest.H, whole.H(keep, keep) - B * A.solve(MatrixXd(B.transpose()))), tolerance);
  EXPECT_LT(difference(rest.g, whole.g(keep) - B * A.solve(VectorXd(N.transpose() * whole.g))), tolerance);
}

void leave_with(Graph& graph, const std::vector<VariableKey>& ids, const MarginalizeOptions& options,
                MarginalizeReport* told = nullptr) {
  Marginalizer marginalizer;
  GraphEdit edit = graph.edit();
  const auto report = marginalizer.marginalize(graph, ids, options, edit);
  ASSERT_TRUE(report.ok()) << report.error();
  ASSERT_TRUE(graph.apply(edit).ok());
  if (told != nullptr) *told = *report;
}

// M2: by both ways to the square root, in both kinds of axes, of landmarks too, and with what an absorbed prior says.
TEST(HeldColumns, LeaveTheSchurComplementOfWhatIsFree) {
  for (const SquareRootMethod method : kMethods) {
    World w(7, 16, 3);
    w.restrict_some();
    const MarginalizeOptions options{.landmarks = LandmarkPolicy::keep, .method = method};
    System whole = dense_oracle::system(w.graph);
    std::vector<VariableKey> leaving = {w.poses[1], w.velocities[1], w.poses[0], w.points[1], w.points[3]};
    MatrixXd N = free_directions(w.graph, whole, leaving);
    MarginalizeReport report;
    leave_with(w.graph, leaving, options, &report);
    EXPECT_TRUE(report.undetermined.empty());
    EXPECT_EQ(report.absorbed_priors, 0);
    expect_rest(whole, N, w.graph, 1e-10);
    GraphEdit edit = w.graph.edit();  // away from x̂: R stands there, and directions are those of here
    edit.set(w.poses[2], w.graph.value(w.poses[2]).plus(w.six(0.02)));
    ASSERT_TRUE(w.graph.apply(edit));
    whole = dense_oracle::system(w.graph);
    leaving = {w.poses[2], w.velocities[2], w.points[0]};
    N = free_directions(w.graph, whole, leaving);
    leave_with(w.graph, leaving, options, &report);
    EXPECT_GT(report.absorbed_priors, 0);
    EXPECT_TRUE(report.undetermined.empty());
    expect_rest(whole, N, w.graph, 1e-10);
  }
}

// Where least squares over what is free puts things, and how sure it is: zero for what is held.
struct Gaussian {
  System s;
  MatrixXd covariance;
  VectorXd mean;  // of vectors, whole

  explicit Gaussian(const Graph& graph) : s(dense_oracle::system(graph)) {
    const MatrixXd N = free_directions(graph, s, s.variables);
    covariance = N * MatrixXd(N.transpose() * s.H * N).inverse() * N.transpose();
    mean = -covariance * s.g;
    for (std::size_t i = 0; i < s.variables.size(); ++i) {
      const VariableOps& ops = *graph.find_ops(s.variables[i].type);
      const std::vector<double> zero(ops.bytes / sizeof(double), 0.0);
      VectorXd x(ops.dim);
      ops.minus(graph.find_value(s.variables[i]), zero.data(), x.data());
      mean.segment(s.offsets[i], ops.dim) += x;
    }
  }
};

void set_freedom(Graph& graph, VariableKey id, const Freedom& freedom) {
  GraphEdit edit = graph.edit();
  edit.set(id, freedom);
  const auto ok = graph.apply(edit);
  ASSERT_TRUE(ok) << ok.error();
}

// M1: the window and the batch, one variable after the other; then a direction of one that stayed is let go.
TEST(HeldColumns, OfAWindowLeaveTheGaussianOfTheBatchAlsoWhenADirectionIsFreedLater) {
  for (const SquareRootMethod method : kMethods)
    for (unsigned seed = 1; seed <= 5; ++seed) {
      LinearProblem window(seed), batch(seed);
      ASSERT_EQ(window.ids, batch.ids);
      std::vector<std::size_t> restricted;
      for (std::size_t i = 0; i < window.ids.size(); ++i) {
        const int dim = window.graph.find_ops(window.ids[i].type)->dim;
        if (dim < 2 || (i + seed) % 2 != 0) continue;
        const Freedom held = Freedom::hold({static_cast<int>(i) % dim});
        set_freedom(window.graph, window.ids[i], held);
        set_freedom(batch.graph, batch.ids[i], held);
        restricted.push_back(i);
      }
      ASSERT_GT(restricted.size(), 3u);
      auto expect_same = [&] {
        const Gaussian all(batch.graph), few(window.graph);
        const std::vector<int> same = all.s.scalars(few.s.variables);
        EXPECT_LT(difference(few.covariance, all.covariance(same, same)), 1e-9);
        EXPECT_LT(difference(few.mean, all.mean(same)), 1e-9);
        EXPECT_LT(all.covariance(same, same).diagonal().minCoeff(), 1e-20);
      };
      const std::size_t stays = restricted.back();
      int left = 0;
      for (std::size_t i = 0; i < window.ids.size() && left < 10; ++i) {
        if (i == stays) continue;
        leave_with(window.graph, {window.ids[i]}, {.landmarks = LandmarkPolicy::keep, .method = method});
        ++left;
        expect_same();
      }
      set_freedom(window.graph, window.ids[stays], Freedom::full());
      set_freedom(batch.graph, batch.ids[stays], Freedom::full());
      const Gaussian all(batch.graph), few(window.graph);
      const std::vector<int> same = all.s.scalars(few.s.variables);
      EXPECT_LT(difference(few.covariance, all.covariance(same, same)), 1e-9);
      EXPECT_LT(difference(few.mean, all.mean(same)), 1e-9);
    }
}

// M4: it is known, so nothing needs to determine it.
TEST(HeldColumns, AreNotWhatNothingDetermines) {
  for (const SquareRootMethod method : kMethods) {
    Graph graph;
    GraphEdit edit = graph.edit();
    const auto x = edit.add(Velocity3d{}), y = edit.add(Velocity3d{{{1, 2, 3}}});
    Mat3d A = Mat3d::identity();
    A(2, 2) = 0.0;
    edit.add(LinearPair<Velocity3d, Velocity3d>{A, Mat3d::identity(), {{1, 2, 3}}}, Sigma(1e-4), x, y);
    edit.add(Prior{Velocity3d{}}, Sigma(1.0), y);
    ASSERT_TRUE(graph.apply(edit));
    Marginalizer marginalizer;
    MarginalizeOptions options;
    options.method = method, options.fail_if_undetermined = true;
    GraphEdit leaving = graph.edit();
    const VariableKey ids[] = {x};
    const auto refused = marginalizer.marginalize(graph, ids, options, leaving);
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::singular);
    set_freedom(graph, x, Freedom::hold({2}));
    const auto report = marginalizer.marginalize(graph, ids, options, leaving);
    ASSERT_TRUE(report.ok()) << report.error();
    EXPECT_TRUE(report->undetermined.empty());
  }
}

// Decision 11: the conditional of what was restricted is not kept, and whoever asks for it is told so.
TEST(HeldColumns, EndTheLedgerOfLateData) {
  LateLedger ledger;
  World w(4, 2, 2);
  set_freedom(w.graph, w.velocities[1], Freedom::hold({1}));
  Marginalizer marginalizer;
  for (const std::size_t k : {0u, 1u, 2u}) {
    GraphEdit edit = w.graph.edit();
    const VariableKey ids[] = {w.velocities[k]};
    ASSERT_TRUE(marginalizer.marginalize(w.graph, ids, {.ledger = &ledger}, edit).ok());
    ASSERT_TRUE(w.graph.apply(edit));
    ledger.commit(Time{static_cast<std::int64_t>(k) + 1});
  }
  EXPECT_TRUE(ledger.holds(w.velocities[0]));
  EXPECT_FALSE(ledger.holds(w.velocities[1]));
  EXPECT_TRUE(ledger.holds(w.velocities[2]));
  GraphEdit edit = w.graph.edit();
  auto fold = [&](std::size_t k) {
    const auto factor = detach(Prior{Velocity3d{}}, Sigma(1.0), w.velocities[k]);
    return ledger.fold(w.graph, factor.view(), edit);
  };
  EXPECT_EQ(fold(1), LateOutcome::removed);
  EXPECT_EQ(fold(0), LateOutcome::removed);  // its way leads through the other
  EXPECT_TRUE(edit.empty());
  EXPECT_EQ(fold(2), LateOutcome::folded);
  EXPECT_EQ(ledger.count(LateOutcome::removed), 2);
}

}  // namespace
}  // namespace oriel
