// The system at a point: the golden case by hand, first estimates, invalid factors, and the same bits for any threads.
#include "oriel/linear/linearize.h"

#include <gtest/gtest.h>

#include <cstring>
#include <optional>
#include <thread>

#include "linear/random_problem.h"
#include "oriel/linear/block_matrix.h"
#include "oriel/linear/linearize_factor.h"
#include "oriel/residual/prior.h"

namespace oriel {
namespace {

using testing::Markd;
using testing::RandomProblem;
using testing::System;
using Scalar = VectorNd<1>;

struct Difference {  // r = x - y - m, J = [1, -1]
  static constexpr std::string_view kName = "test.difference/1";
  using Variables = Types<Scalar, Scalar>;
  double m = 0.0;
  template <class S>
  S operator()(const VectorN<S, 1>& x, const VectorN<S, 1>& y) const {
    return x.v[0] - y.v[0] - S(m);
  }
};

// x²: valid for x > 0; its derivative is not finite at 1, nor its value at 2.
struct Touchy {
  static constexpr std::string_view kName = "test.touchy/1";
  using Variables = Types<Scalar>;
  static constexpr int kDim = 1;
  bool dummy = false;
  bool evaluate(const Scalar& x, Vec1d& r, Mat<double, 1, 1>* j) const {
    if (x.v[0] <= 0.0) return false;
    r[0] = x.v[0] == 2.0 ? HUGE_VAL : x.v[0] * x.v[0];
    if (j != nullptr) (*j)(0, 0) = x.v[0] == 1.0 ? HUGE_VAL : 2.0 * x.v[0];
    return true;
  }
};

class Threads final : public TaskPool {  // as many threads as workers, anew at every call
 public:
  explicit Threads(int n) : n_(n) {}
  int workers() const override { return n_; }
  void parallel_for(int count, TaskRef body) noexcept override {
    std::vector<std::thread> threads;
    for (int w = 0; w < n_; ++w)
      threads.emplace_back([=, this] {
        for (int task = w; task < count; task += n_) body(task, w);
      });
    for (auto& t : threads) t.join();
  }

 private:
  int n_;
};

struct Golden {
  Graph graph;
  std::array<VariableId<Scalar>, 3> x;
  FactorId first, second;

  Golden() {
    GraphEdit edit = graph.edit();
    for (auto& id : x) id = edit.add(Scalar{});
    LinearPrior prior;  // RᵀR = diag(3, 1, 2), nothing known of where
    prior.variables = {x[0], x[1], x[2]};
    prior.estimates.assign(3, 0.0);
    prior.rows = prior.cols = 3;
    prior.d.assign(3, 0.0);
    prior.R = {std::sqrt(3.0), 0, 0, 0, 1, 0, 0, 0, std::sqrt(2.0)};
    edit.add(prior);
    first = edit.add(Difference{-4.0}, Sigma(1.0), x[0], x[1]);
    second = edit.add(Difference{-3.0}, Sigma(1.0), x[0], x[2]);
    EXPECT_TRUE(graph.apply(edit));
  }
  void set(const Eigen::VectorXd& values) {
    GraphEdit edit = graph.edit();
    for (int i = 0; i < 3; ++i) edit.set(x[static_cast<std::size_t>(i)], Scalar{{{values[i]}}});
    EXPECT_TRUE(graph.apply(edit));
  }
};

TEST(Linearizer, GivesTheGoldenCaseByHand) {  // L1
  Golden g;
  System system(g.graph);
  const BlockMatrix h = hessian(g.graph, system.structure, system.numbers);
  const double expected[3][3] = {{5, -1, -1}, {-1, 2, 0}, {-1, 0, 3}};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      EXPECT_NEAR(h.get(g.x[i], g.x[j]).value_or(Mat<double, 1, 1>::zero())[0], expected[i][j], 1e-15);
  const Eigen::Vector3d b(-7, 4, 3);
  Eigen::Vector3d step;
  const Eigen::VectorXd found = system.solve(Eigen::VectorXd::Zero(3));
  for (int i = 0; i < 3; ++i) {
    const int at = h.offset(g.x[static_cast<std::size_t>(i)]);
    EXPECT_NEAR(-system.gradient()[at], b[i], 1e-15);
    step[i] = found[at];
  }
  EXPECT_LE((step - Eigen::Vector3d(-0.96, 1.52, 0.68)).norm(), 1e-14);

  g.set(step);  // the next step is 0
  System after(g.graph);
  EXPECT_LE(after.gradient().norm(), 1e-14);
  EXPECT_LE(after.solve(Eigen::VectorXd::Zero(3)).norm(), 1e-14);

  g.set(Eigen::Vector3d::Zero());  // undone and done again: the same bits
  System undone(g.graph);
  EXPECT_EQ(undone.gradient(), system.gradient());
  EXPECT_EQ(undone.solve(Eigen::VectorXd::Zero(3)), found);
  g.set(step);
  EXPECT_EQ(System(g.graph).gradient(), after.gradient());

  GraphEdit removal = g.graph.edit();  // what is left is the prior's: its right-hand side is -H0 dx
  removal.remove(g.first);
  removal.remove(g.second);
  ASSERT_TRUE(g.graph.apply(removal));
  System prior(g.graph);
  const double h0[3] = {3, 1, 2};
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(-prior.gradient()[prior.structure.target(0, static_cast<std::uint32_t>(i)).offset], -h0[i] * step[i],
                1e-14);
}

TEST(Linearizer, TakesJacobiansAtFirstEstimatesAndResidualsAtValues) {  // decision 9
  RandomProblem p(5);
  const auto x = p.variable<VectorNd<3>>();
  const auto y = p.variable<VectorNd<2>>();
  const FactorId f = p.factor<2>(x, y);
  p.prior({x}, {3}, 3);  // about the origin: from now on x has Jacobians there
  ASSERT_TRUE(p.apply());
  const auto at_value = linearize_factor(p.graph, f, false), frozen = linearize_factor(p.graph, f, true);
  EXPECT_EQ(at_value->residual, frozen->residual);
  EXPECT_NE(at_value->jacobian, frozen->jacobian);
  GraphEdit edit = p.graph.edit();
  edit.set(x, VectorNd<3>{});
  ASSERT_TRUE(p.graph.apply(edit));
  EXPECT_EQ(linearize_factor(p.graph, f, false)->jacobian, frozen->jacobian);
}

TEST(Linearizer, TellsTheLinearizationOfOneFactorWhoeverAsks) {  // L2
  RandomProblem p(6);
  const auto x = p.variable<VectorNd<6>>();
  const auto m = p.variable<Markd<3>>();
  const FactorId f = p.factor<2>(Huber(0.1), x, m), prior = p.prior({x}, {6}, 4);
  ASSERT_TRUE(p.apply());
  System system(p.graph);
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(system.structure.dim(), system.structure.dim());
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(system.structure.dim());
  double cost = 0.0;
  for (const FactorId id : {f, prior}) {
    const auto l = linearize_factor(p.graph, id, false);
    ASSERT_TRUE(l);
    EXPECT_TRUE(l->valid && l->finite);
    const Eigen::Map<const Eigen::MatrixXd> j(l->jacobian.data(), l->rows, l->cols);
    const Eigen::Map<const Eigen::VectorXd> r(l->residual.data(), l->rows);
    Eigen::MatrixXd wide = Eigen::MatrixXd::Zero(l->rows, system.structure.dim());
    wide.middleCols(p.offset(system.structure, x), 6) = j.leftCols(6);
    if (l->variables.size() > 1) wide.middleCols(p.offset(system.structure, m), 3) = j.rightCols(3);
    h += wide.transpose() * wide;
    gradient += wide.transpose() * r;
    cost += l->cost;
  }
  EXPECT_LE((gradient - system.gradient()).norm(), 1e-12);
  EXPECT_NEAR(cost, system.active.total, 1e-12);
  EXPECT_EQ(linearize_factor(p.graph, FactorId{f.table, {f.key.index, 9}}).error().code, ErrorCode::stale_id);
}

TEST(Linearizer, ChargesAFactorThatTurnsInvalidItsOldCostAndLetsAnotherWait) {  // V8
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto leaves = edit.add(Scalar{{{3.0}}}), comes = edit.add(Scalar{{{-1.0}}}), stays = edit.add(Scalar{{{0.5}}});
  for (const auto id : {leaves, comes, stays}) edit.add(Touchy{}, Sigma(1.0), id);
  ASSERT_TRUE(graph.apply(edit));
  System system(graph);
  EXPECT_EQ(system.active.invalid, 1);
  EXPECT_EQ(system.active.total, 0.5 * (81.0 + 0.0625));
  GraphEdit move = graph.edit();
  move.set(leaves, Scalar{{{-3.0}}});
  move.set(comes, Scalar{{{4.0}}});
  ASSERT_TRUE(graph.apply(move));
  Point trial;
  trial.take(graph);
  ActiveSet charged, fresh;
  system.linearizer.evaluate(graph, system.structure, trial, &system.active, charged, nullptr);
  EXPECT_EQ(charged.total, system.active.total);  // hiding does not pay, and 4⁴ does not count yet
  system.linearizer.evaluate(graph, system.structure, trial, nullptr, fresh, nullptr);
  EXPECT_EQ(fresh.total, 0.5 * (256.0 + 0.0625));
  EXPECT_EQ(fresh.invalid, 1);
}

TEST(Linearizer, CountsWhatIsNotFiniteAsInvalidAndAddsNothingOfIt) {  // V8
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto r_bad = edit.add(Scalar{{{2.0}}}), j_bad = edit.add(Scalar{{{1.0}}}), good = edit.add(Scalar{{{3.0}}});
  for (const auto id : {r_bad, j_bad, good}) edit.add(Touchy{}, Sigma(1.0), id);
  ASSERT_TRUE(graph.apply(edit));
  System system(graph);
  EXPECT_EQ(system.active.not_finite, 2);  // the residual of one, the Jacobian of the other
  EXPECT_EQ(system.active.invalid, 2);
  EXPECT_GE(system.linearizer.not_finite(), 1);
  EXPECT_TRUE(system.gradient().allFinite());
  EXPECT_EQ(system.gradient().lpNorm<1>(), 54.0);
}

TEST(Linearizer, GivesTheSameBitsForOneTwoAndThreeThreads) {  // L10
  RandomProblem p(41);
  const auto k6 = p.variables<VectorNd<6>>(30);
  const auto k3 = p.variables<VectorNd<3>>(10);
  const auto l3 = p.variables<Markd<3>>(100);
  for (int i = 0; i < 900; ++i) p.factor<2>(Huber(0.8), p.any(k6), p.any(l3));
  for (int i = 0; i < 150; ++i) p.factor<3>(p.any(k6), p.any(k3));
  p.prior({k6[0], k3[0]}, {6, 3}, 9);
  ASSERT_TRUE(p.apply());
  System one(p.graph);
  const Eigen::VectorXd damping = Eigen::VectorXd::Constant(one.structure.dim(), 0.1), step = one.solve(damping);
  for (const int n : {2, 3}) {
    Threads threads(n);
    System many(p.graph, &threads);
    EXPECT_EQ(many.active.total, one.active.total);
    EXPECT_EQ(many.gradient(), one.gradient());
    EXPECT_EQ(0, std::memcmp(many.numbers.h.data(), one.numbers.h.data(),
                             sizeof(double) * static_cast<std::size_t>(one.structure.factorization().storage_size())));
    EXPECT_EQ(0, std::memcmp(many.numbers.landmarks.data(), one.numbers.landmarks.data(),
                             sizeof(double) * static_cast<std::size_t>(one.structure.landmark_store())));
    EXPECT_EQ(many.solve(damping, &threads), step);
  }
}

// Tables that are cut into slices: blocks that several slices share, landmarks at their cuts, priors, dimensions with
// and without a kernel.
TEST(Linearizer, GivesTheSameBitsForAnyThreadsWhereTablesAreSliced) {  // L10
  RandomProblem p(43);
  const auto k6 = p.variables<VectorNd<6>>(100);
  const auto k4 = p.variables<VectorNd<4>>(40);
  const auto l3 = p.variables<Markd<3>>(150);
  for (int i = 0; i < 9500; ++i) p.factor<3>(i % 3 == 0 ? Huber(0.8) : Loss::none(), p.any(k6), p.any(l3));
  for (std::size_t i = 0; i < 3600; ++i) p.factor<6>(k6[i % 99], k6[i % 99 + 1]);
  for (std::size_t i = 0; i < 6500; ++i) p.factor<4>(p.any(k6), k4[i % 40]);
  p.prior({k6[0], k4[0]}, {6, 4}, 10);
  ASSERT_TRUE(p.apply());
  System one(p.graph);
  std::size_t slices = 0, partials = 0;
  for (std::size_t t = 0; t < one.structure.plan_count(); ++t) {
    slices += one.structure.plans()[t].slices.size();
    partials += one.structure.plans()[t].partials.size();
  }
  ASSERT_GE(slices, 9u);
  ASSERT_GT(partials, 300u);
  EXPECT_TRUE(one.structure.slices_clear_landmarks());
  const Eigen::VectorXd damping = Eigen::VectorXd::Constant(one.structure.dim(), 0.1), step = one.solve(damping);
  const auto dense = p.dense(one.structure);
  EXPECT_LE((dense.g - one.gradient()).norm(), 1e-11 * dense.g.norm());
  EXPECT_LE((dense_step(dense, damping) - step).norm(), 1e-8 * step.norm());
  for (const int n : {2, 3, 5}) {
    Threads threads(n);
    System many(p.graph, &threads);
    many.linearizer.linearize(p.graph, many.structure, many.point, &many.active, many.numbers, &threads);  // again
    EXPECT_EQ(many.active.total, one.active.total);
    EXPECT_EQ(many.gradient(), one.gradient());
    EXPECT_EQ(many.numbers.diagonal, one.numbers.diagonal);
    EXPECT_EQ(0, std::memcmp(many.numbers.h.data(), one.numbers.h.data(),
                             sizeof(double) * static_cast<std::size_t>(one.structure.factorization().storage_size())));
    EXPECT_EQ(0, std::memcmp(many.numbers.landmarks.data(), one.numbers.landmarks.data(),
                             sizeof(double) * static_cast<std::size_t>(one.structure.landmark_store())));
    EXPECT_EQ(many.solve(damping, &threads), step);
  }
}

}  // namespace
}  // namespace oriel
