// What nothing determines is named, apart from a common gauge; the rest is solved.
#include <gtest/gtest.h>

#include <cmath>

#include "linear/random_problem.h"
#include "oriel/manifold/se3.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

using testing::Markd;
using testing::Mix;
using Scalar = VectorNd<1>;

struct RangeTo {  // to a mark in the plane, from a place on the x axis
  static constexpr std::string_view kName = "test.range_to/1";
  using Variables = Types<Markd<2>>;
  double x = 0.0, range = 0.0;
  template <class S>
  S operator()(const testing::Mark<S, 2>& m) const {
    using std::sqrt;
    const S dx = m.v[0] - S(x);
    return sqrt(dx * dx + m.v[1] * m.v[1]) - S(range);
  }
};

Pose3d along(double x) {
  Vec6d d = Vec6d::zero();
  d[2] = 0.3, d[3] = x, d[4] = 0.1;
  return Pose3d{}.plus(d);
}

// A loop of poses; held by a prior or not.
std::vector<VariableId<Pose3d>> add_loop(GraphEdit& edit, bool held) {
  std::vector<VariableId<Pose3d>> x;
  Pose3d at;
  for (int i = 0; i < 8; ++i) {
    Vec6d off = Vec6d::constant(0.02 * (i % 3 - 1));
    x.push_back(edit.add(at.plus(off), Label("x", i)));
    at = at * along(1.0);
  }
  for (std::size_t i = 0; i + 1 < x.size(); ++i) edit.add(Between{along(1.0)}, Sigma(0.1), x[i], x[i + 1]);
  edit.add(Between{along(1.0) * along(1.0)}, Sigma(0.1), x[0], x[2]);
  if (held) edit.add(Prior{Pose3d{}}, Sigma(0.1), x[0]);
  return x;
}

SolveOptions with(Method method) {
  SolveOptions options;
  options.method = method;
  return options;
}
constexpr Method kMethods[] = {Method::levenberg_marquardt, Method::gauss_newton};

TEST(Undetermined, NamesAVariableThatNoFactorTouchesAndSolvesTheRest) {  // L6
  for (const Method method : kMethods) {
    Graph graph, without;
    GraphEdit edit = graph.edit(), other = without.edit();
    const auto x = add_loop(edit, true), y = add_loop(other, true);
    const auto lonely = edit.add(VectorNd<2>{{{3.0, 4.0}}}, Label("lonely"));
    ASSERT_TRUE(graph.apply(edit));
    ASSERT_TRUE(without.apply(other));
    NativeEngine engine(graph), reference(without);
    const Summary s = engine.solve(with(method));
    ASSERT_TRUE(s.converged()) << s;
    ASSERT_EQ(s.undetermined.size(), 2u) << s;
    EXPECT_TRUE(s.gauge.empty());
    for (const auto& d : s.undetermined) {
      ASSERT_EQ(d.scalars.size(), 1u);
      EXPECT_EQ(d.scalars[0].id, VariableKey(lonely));
      EXPECT_NE(describe(graph, d).find("lonely"), std::string::npos);
    }
    EXPECT_EQ(graph.value(lonely).v, (Vec2d{{3.0, 4.0}}));
    EXPECT_NEAR(reference.solve(with(method)).final_cost, s.final_cost, 1e-12);
    for (std::size_t i = 0; i < x.size(); ++i) EXPECT_LE(graph.value(x[i]).minus(without.value(y[i])).norm(), 1e-6);
  }
}

TEST(Undetermined, TellsACommonGaugeApart) {  // L6
  for (const Method method : kMethods) {
    Graph graph;
    GraphEdit edit = graph.edit();
    const auto x = add_loop(edit, false);
    ASSERT_TRUE(graph.apply(edit));
    NativeEngine engine(graph);
    const Summary s = engine.solve(with(method));
    EXPECT_TRUE(s.converged()) << s;
    EXPECT_EQ(s.gauge.size(), 6u) << s;
    EXPECT_TRUE(s.undetermined.empty());
    for (const auto& d : s.gauge) EXPECT_EQ(d.variables, x.size());
    EXPECT_LE(s.final_cost, 1e-9);
    for (const auto id : x) EXPECT_TRUE(std::isfinite(graph.value(id).minus(Pose3d{}).norm()));
  }
}

TEST(Undetermined, NamesALonelyVariableBesideAGauge) {  // L6
  Graph graph;
  GraphEdit edit = graph.edit();
  add_loop(edit, false);
  const auto lonely = edit.add(Scalar{}, Label("lonely"));
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  const Summary s = engine.solve();
  EXPECT_EQ(s.gauge.size(), 6u) << s;
  ASSERT_EQ(s.undetermined.size(), 1u);
  EXPECT_EQ(s.undetermined[0].scalars.at(0).id, VariableKey(lonely));
}

TEST(Undetermined, NamesWhatIsMissingAlsoWhereTheStartIsTheOptimum) {  // L6
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto x = edit.add(Scalar{});
  edit.add(Scalar{}, Label("lonely"));
  edit.add(Prior{Scalar{}}, Sigma(1.0), x);
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  const Summary s = engine.solve();
  EXPECT_TRUE(s.converged());
  EXPECT_EQ(s.undetermined.size(), 1u);
}

TEST(Undetermined, ForgetsALandmarkThatHasGone) {  // L6
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto x = edit.add(VectorNd<3>{});
  edit.add(Prior{VectorNd<3>{}}, Sigma(0.1), x);
  const auto lonely = edit.add(Scalar{}, Label("lonely"));
  const auto once = edit.add(Markd<3>{}, Label("once"));
  edit.add(Mix<2, VectorNd<3>, Markd<3>>{5.0, 0.5, 0.0}, Sigma(0.1), x, once);
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  EXPECT_EQ(engine.solve().undetermined.size(), 2u);
  GraphEdit gone = graph.edit();
  gone.remove(once);
  ASSERT_TRUE(graph.apply(gone));
  const Summary s = engine.solve();
  ASSERT_EQ(s.undetermined.size(), 1u) << s;
  EXPECT_EQ(s.undetermined[0].scalars.at(0).id, VariableKey(lonely));
}

TEST(NativeEngine, TakesAnOrderOfItsOwnWhereNobodyGivesOne) {
  Graph graph;
  GraphEdit edit = graph.edit();
  add_loop(edit, true);
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  SolveOptions options;
  options.ordering = OrderingMethod::given;
  const Summary s = engine.solve(options);
  EXPECT_TRUE(s.converged()) << s;
  EXPECT_TRUE(engine.solve().converged());
}

TEST(Undetermined, NamesLandmarksThatAreAloneOrSeenTooLittle) {  // L6
  for (const Method method : kMethods) {
    Graph graph;
    GraphEdit edit = graph.edit();
    std::vector<VariableId<VectorNd<3>>> x;
    for (int i = 0; i < 3; ++i) {
      x.push_back(edit.add(VectorNd<3>{{{1.0 * i, 0.5, 0.2}}}));
      edit.add(Prior{VectorNd<3>{{{1.0 * i, 0.5, 0.0}}}}, Sigma(0.1), x.back());
    }
    const auto seen = edit.add(Markd<3>{{{1.0, 2.0, 3.0}}}, Label("seen")), once = edit.add(Markd<3>{}, Label("once")),
               alone = edit.add(Markd<3>{}, Label("alone"));
    for (std::size_t i = 0; i < 3; ++i)
      edit.add(Mix<2, VectorNd<3>, Markd<3>>{1.0 + i, 0.5, 0.0}, Sigma(0.1), x[i], seen);
    edit.add(Mix<2, VectorNd<3>, Markd<3>>{5.0, 0.5, 0.0}, Sigma(0.1), x[0], once);
    ASSERT_TRUE(graph.apply(edit));
    NativeEngine engine(graph);
    const Summary s = engine.solve(with(method));
    EXPECT_TRUE(s.converged()) << s;
    std::size_t at_once = 0, at_alone = 0, others = 0;
    for (const auto& d : s.undetermined) {
      if (d.scalars.at(0).id == VariableKey(once))
        ++at_once;
      else if (d.scalars.at(0).id == VariableKey(alone))
        ++at_alone;
      else
        ++others;
    }
    EXPECT_EQ(at_once, 1u) << s;
    EXPECT_EQ(at_alone, 3u) << s;
    EXPECT_EQ(others, 0u);
    EXPECT_EQ(graph.value(alone).v, Vec3d::zero());
    EXPECT_LT(s.final_cost, s.initial_cost);
    EXPECT_TRUE(std::isfinite(graph.value(once).v.norm()));
  }
}

TEST(Undetermined, NamesTheSideOnWhichAMirrorImageLies) {  // L6
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto m = edit.add(Markd<2>{{{1.2, 0.0}}}, Label("mirror"));  // on the line of the beacons: J has no y
  for (const double x : {-2.0, 0.0, 4.0}) edit.add(RangeTo{x, std::fabs(1.0 - x)}, Sigma(0.1), m);
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  const Summary s = engine.solve();
  ASSERT_EQ(s.undetermined.size(), 1u) << s;
  EXPECT_EQ(s.undetermined[0].scalars.at(0).tangent, 1);
  EXPECT_NEAR(graph.value(m).v[0], 1.0, 1e-6);
  EXPECT_EQ(graph.value(m).v[1], 0.0);
}

TEST(Undetermined, IsEmptyWhereEverythingIsDetermined) {  // L6
  for (const Method method : kMethods) {
    Graph graph;
    GraphEdit edit = graph.edit();
    add_loop(edit, true);
    ASSERT_TRUE(graph.apply(edit));
    NativeEngine engine(graph);
    const Summary s = engine.solve(with(method));
    EXPECT_TRUE(s.undetermined.empty() && s.gauge.empty()) << s;
  }
}

}  // namespace
}  // namespace oriel
