// What is undetermined where directions are held, and what pulls.
#include <gtest/gtest.h>

#include "oriel/graph/freedom.h"
#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

// A chain without an anchor: six directions are free, but for those of the first pose that are held.
TEST(FreedomGauge, CountsNoHeldDirectionAsUndetermined) {  // L6
  const std::pair<Freedom, std::size_t> cases[] = {{Freedom::full(), 6},
                                                   {Freedom::rotation(), 3},
                                                   {Freedom::position(), 3},
                                                   {Freedom::yaw(), 1},
                                                   {Freedom::hold({2, 3, 4, 5}, Freedom::Axes::world), 2}};
  for (const auto& [freedom, left] : cases) {
    Graph graph;
    GraphEdit edit = graph.edit();
    std::vector<VariableId<Pose3d>> x;
    for (int i = 0; i < 6; ++i) {
      x.push_back(edit.add(Pose3d{}.plus({{0.1, 0.4, 0.3 * i, 1.0 * i, 0, 0}})));
      if (i > 0)
        edit.add(Between{Pose3d{}.plus({{0, 0, 0.3, 1, 0, 0}})}, Sigma(0.1), x[static_cast<std::size_t>(i) - 1],
                 x.back());
    }
    edit.set(x[0], freedom);
    ASSERT_TRUE(graph.apply(edit));
    NativeEngine engine(graph);
    const Summary s = engine.solve({.max_iterations = 20});
    EXPECT_EQ(s.gauge.size(), left) << s;
    EXPECT_TRUE(s.undetermined.empty()) << s;
    EXPECT_FALSE(engine.covariance(x[3]).ok());
  }
}

TEST(FreedomGauge, NamesWhatNothingDeterminesUntilItIsHeld) {  // L6
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto p = edit.add(Pose3d{}.plus({{0.3, 0.2, 0.1, 1, 2, 3}}));
  const auto v = edit.add(Velocity3d{});
  edit.add(Prior{Pose3d{}}, Sigma(0.1), p);
  edit.add(Between{Velocity3d{}}, Sigma(0.1), v, edit.add(Velocity3d{{{1, 2, 3}}}));
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  EXPECT_EQ(engine.solve().gauge.size(), 3u);
  edit.clear();
  edit.set(v, Freedom::hold({2}));
  ASSERT_TRUE(graph.apply(edit));
  const Summary s = engine.solve();
  EXPECT_EQ(s.gauge.size(), 2u) << s;
  for (const auto& d : s.gauge)
    for (const auto& scalar : d.scalars) EXPECT_LT(scalar.tangent, 2);
  edit.clear();
  edit.set(v, Freedom::hold({0, 2}));
  edit.add(Prior{Velocity3d{}}, Sigmas(Vec3d{{1, 1, 1}}), v);
  ASSERT_TRUE(graph.apply(edit));
  const Summary all = engine.solve();
  EXPECT_TRUE(all.gauge.empty() && all.undetermined.empty()) << all;
}

// The start is an optimum of what is free, though far from one of what is held.
TEST(FreedomGauge, StopsAtOnceWhereOnlyHeldDirectionsPull) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto p = edit.add(Pose3d{});
  edit.add(Prior{Pose3d{}.plus({{0, 0, 0, 0, 0, 7.0}})}, Sigma(0.1), p);
  edit.set(p, Freedom::hold({5}));
  ASSERT_TRUE(graph.apply(edit));
  const Summary s = NativeEngine(graph).solve();
  EXPECT_EQ(s.reason, Reason::gradient_tolerance) << s;
  EXPECT_EQ(s.iterations, 0);
  EXPECT_EQ(s.gradient, 0.0);
  EXPECT_TRUE(s.gauge.empty() && s.undetermined.empty()) << s;
}

}  // namespace
}  // namespace oriel
