// What docs/engines.md shows of held directions; a test of the house compares the lines.
#include <gtest/gtest.h>

#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

// A user's variable: a carriage that moves along its own axes, which stand askew in the world.
template <class S>
struct Carriage {
  static constexpr std::string_view kName = "test.carriage/1";
  static constexpr int kDim = 2;
  template <class T>
  using rebind = Carriage<T>;
  S x = S(0.0), y = S(0.0), c = S(0.6), s = S(0.8);
  Carriage plus(const Vec<S, 2>& d) const { return {x + c * d[0] - s * d[1], y + s * d[0] + c * d[1], c, s}; }
  Vec<S, 2> minus(const Carriage& o) const {
    const S dx = x - o.x, dy = y - o.y;
    return {{c * dx + s * dy, c * dy - s * dx}};
  }
  Mat<S, 2, 2> world_axes() const { return {{c, s, -s, c}}; }
};
struct CarriageSeen {
  static constexpr std::string_view kName = "test.carriage_seen/1";
  using Variables = Types<Carriage<double>>;
  Vec2d at;
  template <class S>
  Vec<S, 2> operator()(const Carriage<S>& k) const {
    return {{k.x - S(at[0]), k.y - S(at[1])}};
  }
};

TEST(HeldDirections, AreThoseOfTheWorldForATypeOfTheUsersThatSaysItsAxes) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto k = edit.add(Carriage<double>{});
  edit.add(CarriageSeen{{{3.0, 5.0}}}, Sigma(0.1), k);
  edit.set(k, Freedom::hold({1}, Freedom::Axes::world));
  ASSERT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  EXPECT_TRUE(engine.solve().converged());
  EXPECT_NEAR(graph.value(k).x, 3.0, 1e-6);
  EXPECT_NEAR(graph.value(k).y, 0.0, 1e-15);
}

// C6
TEST(HeldDirections, OfAFirstPoseAndOfACartAreSetAndTakenBackBetweenSolves) {
  Graph graph;
  GraphEdit edit = graph.edit();
  const auto first = edit.add(Pose3d{}), cart = edit.add(Pose3d{Rot3d::exp({{0.1, 0, 0}}), {{1.2, 0, 0.3}}});
  const auto scale = edit.add(VectorNd<3>{{{1.0, 1.0, 1.0}}});
  const FactorId odometry = edit.add(Between{Pose3d{}.plus({{0, 0, 0.3, 1, 0, 0.5}})}, Sigma(0.1), first, cart);
  edit.add(Prior{Pose3d{}.plus({{0.02, -0.01, 0.5, 3, 0, 0}})}, Sigmas(Vec6d{{0.1, 0.1, 9, 9, 9, 9}}), first);
  edit.add(Prior{VectorNd<3>{{{1.1, 0.9, 1.3}}}}, Sigma(0.1), scale);
  ASSERT_TRUE(graph.apply(edit));
  edit.clear();

  NativeEngine engine(graph);
  edit.set(first, Freedom::hold({2, 3, 4, 5}, Freedom::Axes::world));  // heading and position, which nothing else tells
  edit.set(cart, Freedom::planar());
  edit.set(scale, Freedom::hold({2}));  // its third component is known
  ASSERT_TRUE(graph.apply(edit));
  const Summary on_the_floor = engine.solve();

  EXPECT_TRUE(on_the_floor.converged()) << on_the_floor;
  EXPECT_TRUE(on_the_floor.gauge.empty() && on_the_floor.undetermined.empty()) << on_the_floor;
  EXPECT_EQ(graph.value(first).translation().norm(), 0.0);
  EXPECT_NEAR(graph.value(cart).translation()[2], 0.3, 1e-15);
  EXPECT_EQ(graph.value(scale).v[2], 1.0);
  EXPECT_NEAR(graph.value(scale).v[0], 1.1, 1e-6);
  EXPECT_EQ((*engine.covariance(scale))(2, 2), 0.0);

  edit.clear();
  edit.set(cart, Freedom::yaw_and_position());  // in the place of what was set before: it may climb
  edit.set(scale, Freedom::full());             // all is free again
  ASSERT_TRUE(graph.apply(edit));
  const Summary on_a_slope = engine.solve();

  EXPECT_TRUE(on_a_slope.converged()) << on_a_slope;
  EXPECT_LT(on_a_slope.final_cost, on_the_floor.final_cost);
  EXPECT_GT(graph.value(cart).translation()[2], 0.4);
  EXPECT_NEAR(graph.value(scale).v[2], 1.3, 1e-6);
  EXPECT_TRUE(graph.contains(odometry));
}

}  // namespace
}  // namespace oriel
