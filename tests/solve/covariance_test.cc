// Covariances against the dense inverse, and when there is none.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "linear/random_problem.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

using testing::Markd;
using testing::RandomProblem;
using Scalar = VectorNd<1>;

struct Problem : RandomProblem {
  explicit Problem(unsigned seed) : RandomProblem(seed) {
    curvature = 0.05;
    x = variables<VectorNd<6>>(7);
    v = variables<VectorNd<3>>(5);
    m = variables<Markd<3>>(12);
    k = variables<Markd<1>>(4);
    for (int i = 0; i < 120; ++i) factor<2>(Huber(1.5), any(x), any(m));
    for (int i = 0; i < 20; ++i) factor<1>(any(x), any(k));
    for (int i = 0; i < 20; ++i) factor<3>(any(x), any(v));
    for (const auto id : x) factor<6>(id);
    for (const auto id : v) factor<3>(id);
    for (const auto id : m) factor<3>(id);
    for (const auto id : k) factor<1>(id);
    prior({x[0], v[0]}, {6, 3}, 9);
    EXPECT_TRUE(apply());
  }
  std::vector<VariableId<VectorNd<6>>> x;
  std::vector<VariableId<VectorNd<3>>> v;
  std::vector<VariableId<Markd<3>>> m;
  std::vector<VariableId<Markd<1>>> k;
};

// Scalars of the ids in the numbering of the structure.
std::vector<int> scalars(const RandomProblem& p, const LinearStructure& s, const std::vector<VariableKey>& ids) {
  std::vector<int> out;
  for (const VariableKey& id : ids)
    for (int i = 0; i < p.graph.find_ops(id.type)->dim; ++i) out.push_back(p.offset(s, id) + i);
  return out;
}

template <int N>
Eigen::MatrixXd matrix(const Mat<double, N, N>& m) {
  return Eigen::Map<const Eigen::MatrixXd>(m.m, N, N);
}

// The engine takes Jacobians at first estimates, which the prior puts at the origin; so its variables are moved there.
TEST(Covariance, EqualsTheDenseInverseAlone) {  // L11
  for (unsigned seed = 1; seed <= 4; ++seed) {
    Problem p(seed);
    NativeEngine engine(p.graph);
    GraphEdit origin = p.graph.edit();  // where the prior's first estimates are
    origin.set(p.x[0], VectorNd<6>{});
    origin.set(p.v[0], VectorNd<3>{});
    ASSERT_TRUE(p.graph.apply(origin));
    LinearStructure s;
    ASSERT_TRUE(s.build(p.graph, {}));
    const Eigen::MatrixXd inverse = p.dense(s).h.inverse();
    auto expect = [&](const auto& ids) {
      for (const auto id : ids) {
        const auto c = engine.covariance(id);
        ASSERT_TRUE(c) << c.error();
        const auto at = scalars(p, s, {id});
        const Eigen::MatrixXd dense = inverse(at, at);
        EXPECT_LE((matrix(*c) - dense).norm(), 1e-9 * dense.norm()) << "seed " << seed;
      }
    };
    expect(p.x), expect(p.v), expect(p.m), expect(p.k);
  }
}

TEST(Covariance, EqualsTheDenseInverseTogether) {  // L11
  Problem p(7);
  NativeEngine engine(p.graph);
  GraphEdit edit = p.graph.edit();
  edit.set(p.x[0], VectorNd<6>{});
  edit.set(p.v[0], VectorNd<3>{});
  ASSERT_TRUE(p.graph.apply(edit));
  LinearStructure s;
  ASSERT_TRUE(s.build(p.graph, {}));
  const Eigen::MatrixXd inverse = p.dense(s).h.inverse();
  const std::vector<std::vector<VariableKey>> sets = {
      {p.x[1], p.x[4]}, {p.m[3], p.x[2], p.v[1], p.k[0]}, {p.m[0], p.m[5], p.k[2]}, {}};
  for (const auto& ids : sets) {
    const auto c = engine.joint_covariance(ids);
    ASSERT_TRUE(c) << c.error();
    const auto at = scalars(p, s, ids);
    const auto n = static_cast<Eigen::Index>(at.size());
    ASSERT_EQ(c->size(), at.size() * at.size());
    if (n == 0) continue;
    const Eigen::MatrixXd dense = inverse(at, at), joint = Eigen::Map<const Eigen::MatrixXd>(c->data(), n, n);
    EXPECT_LE((joint - dense).norm(), 1e-9 * dense.norm());
  }
  const VariableKey twice[] = {p.x[0], p.x[0]};
  EXPECT_EQ(engine.joint_covariance(twice).error().code, ErrorCode::duplicate);
}

TEST(Covariance, IsZeroForWhatIsFixed) {  // L11
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto a = edit.add(Scalar{}), b = edit.add(Scalar{{{1.0}}});
  edit.add(Between{Scalar{{{1.0}}}}, Sigma(0.5), a, b);
  edit.fix(a);
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  const VariableKey both[] = {a, b};
  const auto c = engine.joint_covariance(both);
  ASSERT_TRUE(c) << c.error();
  const std::vector<double> expected = {0.0, 0.0, 0.0, 0.25};
  ASSERT_EQ(c->size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR((*c)[i], expected[i], 1e-15);
}

struct Squared {
  static constexpr std::string_view kName = "test.squared_covariance/1";
  using Variables = Types<Scalar>;
  double value = 4.0;
  template <class S>
  S operator()(const VectorN<S, 1>& x) const {
    return x.v[0] * x.v[0] - S(value);
  }
};

// The slope of x² at its first estimate 1 is 2, at the solution 2 it is 4.
TEST(Covariance, TakesJacobiansWhereTheLastSolveTookThem) {  // L11
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto x = edit.add(Scalar{{{1.0}}});
  edit.add(Squared{}, Sigma(1.0), x);
  LinearPrior weak;
  weak.variables = {x};
  weak.rows = weak.cols = 1;
  weak.estimates = {1.0};
  weak.d = {0.0};
  weak.R = {1e-6};
  edit.add(weak);
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  for (const bool first_estimates : {true, false, true}) {
    SolveOptions options;
    options.first_estimates = first_estimates;
    ASSERT_FALSE(engine.solve(options).failed());
    ASSERT_NEAR(graph.value(x).v[0], 2.0, 1e-6);
    for (int round = 0; round < 2; ++round) {
      const auto c = engine.covariance(x);
      ASSERT_TRUE(c) << c.error();
      EXPECT_NEAR((*c)(0, 0), first_estimates ? 0.25 : 0.0625, 1e-6);
      engine.drop_caches();
    }
  }
}

struct Steep {  // finite r and J, whose JᵀJ overflows once it is asked to
  static constexpr std::string_view kName = "test.steep_covariance/1";
  static constexpr int kDim = 1;
  using Variables = Types<Scalar>;
  double from = 5.0;
  bool evaluate(const Scalar& x, Vec1d& r, Mat<double, 1, 1>* j) const {
    r[0] = 1e-160 * (1.0 + x.v[0]);
    if (j != nullptr) (*j)(0, 0) = x.v[0] > from ? 1e160 : 1.0;
    return true;
  }
};

TEST(Covariance, IsThereNotAfterASolveThatFailedUntilOneDoesNot) {  // L11
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto x = edit.add(Scalar{{{1.0}}}), other = edit.add(Scalar{});
  edit.add(Steep{}, Sigma(1.0), x);
  edit.add(Prior{Scalar{}}, Sigma(2.0), other);
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  ASSERT_FALSE(engine.solve().failed());
  ASSERT_TRUE(engine.covariance(other));
  GraphEdit far = graph.edit();
  far.set(x, Scalar{{{9.0}}});
  ASSERT_TRUE(graph.apply(far));
  ASSERT_TRUE(engine.solve().failed());
  EXPECT_EQ(engine.covariance(other).error().code, ErrorCode::conflict);
  engine.drop_caches();
  EXPECT_FALSE(engine.covariance(other).ok());
  GraphEdit near = graph.edit();
  near.set(x, Scalar{{{1.0}}});
  ASSERT_TRUE(graph.apply(near));
  EXPECT_FALSE(engine.covariance(other).ok());  // the solve that failed is still the last
  ASSERT_FALSE(engine.solve().failed());
  const auto c = engine.covariance(other);
  ASSERT_TRUE(c) << c.error();
  EXPECT_NEAR((*c)(0, 0), 4.0, 1e-12);
}

TEST(Covariance, SaysSoInADirectionThatNothingDetermines) {  // L11
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto a = edit.add(Scalar{}, Label("a")), b = edit.add(Scalar{}, Label("b"));
  edit.add(Between{Scalar{}}, Sigma(1.0), a, b);
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  const auto c = engine.covariance(a);
  ASSERT_FALSE(c.ok());
  EXPECT_EQ(c.error().code, ErrorCode::singular);
  EXPECT_NE(c.error().text().find("'a'"), std::string::npos);
  EXPECT_NE(c.error().text().find("determined by nothing"), std::string::npos);
}

TEST(Covariance, RefusesAnIdThatIsGone) {  // L11, V2
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto a = edit.add(Scalar{}), b = edit.add(Scalar{});
  edit.add(Prior{Scalar{}}, Sigma(1.0), a);
  ASSERT_TRUE(graph.apply(edit));
  GraphEdit removal = graph.edit();
  removal.remove(b);
  ASSERT_TRUE(graph.apply(removal));
  NativeEngine engine(graph);
  EXPECT_TRUE(engine.covariance(a));
  EXPECT_EQ(engine.covariance(b).error().code, ErrorCode::stale_id);
}

}  // namespace
}  // namespace oriel
