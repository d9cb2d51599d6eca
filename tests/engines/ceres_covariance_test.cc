// Covariances of both engines: of the same problems the same, and of none where something is undetermined.
#include <gtest/gtest.h>

#include <cmath>

#include "engines/two_engines.h"
#include "engines/window_of_ten.h"
#include "graph/random_graph.h"

namespace oriel {
namespace {

// Largest difference, in units of the standard deviations of row and column; NaN where one engine has none.
double difference(Engine& a, Engine& b, std::span<const VariableKey> ids) {
  const auto x = a.joint_covariance(ids), y = b.joint_covariance(ids);
  EXPECT_TRUE(x) << a.name() << ": " << x.error();
  EXPECT_TRUE(y) << b.name() << ": " << y.error();
  if (!x || !y || x->size() != y->size()) return std::nan("");
  const auto n = static_cast<std::size_t>(std::lround(std::sqrt(static_cast<double>(x->size()))));
  double most = 0.0;
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) {
      const double scale = std::sqrt((*x)[i * n + i] * (*x)[j * n + j]);
      const double d = std::fabs((*x)[j * n + i] - (*y)[j * n + i]);
      most = std::max(most, scale > 0.0 ? d / scale : d);
    }
  return most;
}

// C8
TEST(CeresCovariance, IsThatOfNativeInAWindowWithAPriorLossesAndFirstEstimates) {
  WindowOfTen window;
  NativeEngine native(window.graph);
  CeresEngine ceres(window.graph);
  for (int k = 0; k < 10; ++k) {
    window.slide(k);
    for (const bool first_estimates : {false, true}) {
      const SolveOptions options{.max_iterations = 10, .first_estimates = first_estimates};
      ASSERT_FALSE(native.solve(options).failed());
      ASSERT_FALSE(ceres.solve(options).failed());
      const VariableKey newest[] = {window.bias(k), window.pose(k), window.velocity(k)};
      EXPECT_LT(difference(native, ceres, newest), 1e-8) << "keyframe " << k;
    }
    if (k >= 5) window.marginalize_oldest();
    if (k == 0) continue;
    const VariableKey ends[] = {window.pose(k), window.pose(k >= 5 ? k - 4 : 0)};
    EXPECT_LT(difference(native, ceres, ends), 1e-8) << "keyframe " << k;
  }
}

template <class V>
void hold_at_value(const Graph& graph, VariableKey id, GraphEdit& edit, std::vector<FactorId>& priors) {
  if (id.type == kVariableOps<V>.key)
    priors.push_back(edit.add(Prior{graph.value(VariableId<V>{id.key})}, Sigma(2.0), VariableId<V>{id.key}));
}

// C8
TEST(CeresCovariance, IsThatOfNativeAfterEachOfManyEdits) {
  testing_graph::RandomGraph random(9);
  NativeEngine native(random.graph);
  CeresEngine ceres(random.graph);
  int compared = 0, joint = 0;
  for (int round = 0; round < 120; ++round) {
    ASSERT_TRUE(random.step(6));
    GraphEdit hold = random.graph.edit();  // makes all of it determined, while it is asked
    std::vector<FactorId> priors;
    std::vector<VariableKey> some;
    for (const auto& v : random.variables()) {
      hold_at_value<Pose3d>(random.graph, v.id, hold, priors);
      hold_at_value<Point3d>(random.graph, v.id, hold, priors);
      hold_at_value<Velocity3d>(random.graph, v.id, hold, priors);
      if (some.size() < 3 && random.below(3) == 0) some.push_back(v.id);
    }
    ASSERT_TRUE(random.graph.apply(hold));
    EXPECT_LT(difference(native, ceres, some), 1e-10) << "round " << round;
    compared += static_cast<int>(some.size());
    joint += some.size() > 1;
    GraphEdit release = random.graph.edit();
    for (const FactorId id : priors) release.remove(id);
    ASSERT_TRUE(random.graph.apply(release));
  }
  EXPECT_GT(compared, 200);
  EXPECT_GT(joint, 50);
}

// What both say of one variable.
std::pair<ErrorCode, ErrorCode> codes(Graph& graph, VariableKey id) {
  NativeEngine native(graph);
  CeresEngine ceres(graph);
  const VariableKey ids[] = {id};
  const auto x = native.joint_covariance(ids), y = ceres.joint_covariance(ids);
  EXPECT_FALSE(x.ok());
  EXPECT_FALSE(y.ok());
  return {x ? ErrorCode::io : x.error().code, y ? ErrorCode::io : y.error().code};
}

TEST(CeresCovariance, IsAnErrorWhereTheGraphIsNotDetermined) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto a = edit.add(Pose3d{}), b = edit.add(Pose3d{});
  const auto prior = edit.add(Prior{Pose3d{}}, Sigma(0.1), a);
  edit.add(Between{Pose3d::exp({{0.1, 0.2, 0.3, 1.0, 2.0, 3.0}})}, Sigma(0.1), a, b);
  ASSERT_TRUE(graph.apply(edit));
  CeresEngine ceres(graph);
  EXPECT_TRUE(ceres.covariance(b));
  GraphEdit removal = graph.edit();
  removal.remove(prior);  // free in space
  ASSERT_TRUE(graph.apply(removal));
  EXPECT_EQ(codes(graph, b), std::pair(ErrorCode::singular, ErrorCode::singular));
  EXPECT_EQ(ceres.covariance(b).error().code, ErrorCode::singular);
  GraphEdit apart = graph.edit();
  apart.remove(b);
  apart.fix(a);
  const auto alone = apart.add(Point3d{});  // no factor at all
  const auto known = apart.add(Point3d{});
  apart.add(Prior{Point3d{}}, Sigma(1.0), known);
  ASSERT_TRUE(graph.apply(apart));
  EXPECT_EQ(codes(graph, alone), std::pair(ErrorCode::singular, ErrorCode::singular));
  EXPECT_EQ(codes(graph, b), std::pair(ErrorCode::stale_id, ErrorCode::stale_id));
}

TEST(CeresCovariance, IsZeroForWhatIsFixed) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto a = edit.add(VectorNd<1>{}), b = edit.add(VectorNd<1>{{{1.0}}});
  edit.add(Between{VectorNd<1>{{{1.0}}}}, Sigma(0.5), a, b);
  edit.fix(a);
  ASSERT_TRUE(graph.apply(edit));
  CeresEngine ceres(graph);
  const VariableKey both[] = {a, b}, twice[] = {b, b};
  const auto c = ceres.joint_covariance(both);
  ASSERT_TRUE(c) << c.error();
  EXPECT_EQ(*c, (std::vector<double>{0.0, 0.0, 0.0, 0.25}));
  EXPECT_EQ(ceres.joint_covariance(twice).error().code, ErrorCode::duplicate);
}

TEST(CeresCovariance, IsNoneAfterASolveThatFailed) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto x = edit.add(Point3d{});
  edit.add(Prior{Point3d{}}, Sigma(0.1), x);
  ASSERT_TRUE(graph.apply(edit));
  CeresEngine ceres(graph);
  EXPECT_TRUE(ceres.covariance(x));
  EXPECT_TRUE(ceres.solve({.ordering = OrderingMethod::nested_dissection}).failed());
  EXPECT_EQ(ceres.covariance(x).error().code, ErrorCode::conflict);
  EXPECT_TRUE(ceres.solve().converged());
  EXPECT_TRUE(ceres.covariance(x));
}

}  // namespace
}  // namespace oriel
