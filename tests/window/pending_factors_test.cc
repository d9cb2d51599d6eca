// Factors wait for their states, and go in as they came.
#include "oriel/window/pending_factors.h"

#include <gtest/gtest.h>

#include "linear_world.h"
#include "oriel/solve/native_engine.h"
#include "oriel/testing/allocation_counter.h"

namespace oriel {
namespace {

using namespace linear_world;

struct PendingTest : ::testing::Test {
  Graph graph;
  States states;
  PendingFactors pending;
  PositionProvider* position = nullptr;
  ProviderId positions;
  int gnss = pending.sensor("gnss");

  PendingTest() {
    auto p = std::make_unique<PositionProvider>();
    position = p.get();
    positions = states.add(std::move(p));
    position->moved.begin(at_ms(0));
    position->moved.add(at_ms(1000), {{1.0, 0.0}});
    EXPECT_TRUE(make(at_ms(0)));
  }
  bool make(Time time) {
    GraphEdit edit = graph.edit();
    const bool ok = states.request(edit, positions, time).ok() && states.link(edit).ok() && graph.apply(edit).ok();
    EXPECT_TRUE(ok);
    states.commit();
    return ok;
  }
  At<Position> at(std::int64_t ms) const { return {positions, at_ms(ms)}; }
  VariableId<Point2d> landmark() {
    GraphEdit edit = graph.edit();
    const auto l = edit.add(Point2d{{{5.0, 5.0}}});
    EXPECT_TRUE(graph.apply(edit).ok());
    return l;
  }
  Readiness readiness(std::size_t place = 0) const { return pending.readiness(pending.groups()[place], graph, states); }
  // Makes the group's states and puts it in.
  std::vector<FactorId> enter(std::size_t place) {
    const PendingFactors::Group group = pending.groups()[place];
    for (const auto& f : pending.factors(group))
      for (const PendingRef& ref : pending.refs(f))
        if (ref.of_state) make(ref.time);
    GraphEdit edit = graph.edit();
    std::vector<VariableKey> variables;
    std::vector<FactorId> factors;
    pending.insert(group, states, edit, variables, factors);
    EXPECT_EQ(variables.size(), group.variables);
    EXPECT_TRUE(graph.apply(edit).ok());
    pending.drop(place);
    pending.compact();
    return factors;
  }
  void absolute(std::int64_t ms) {
    pending.begin(gnss);
    pending.add(Prior{Position{{{1.0, 2.0}}}}, Sigma(0.1), at(ms));
    pending.end();
  }
};

// W5, W6
TEST_F(PendingTest, WaitUntilTheMeasurementsReachTheirStateBoundIncluded) {
  absolute(1001);
  EXPECT_EQ(readiness(), Readiness::waits);
  position->moved.add(at_ms(1001), {{0.0, 0.0}});
  EXPECT_EQ(readiness(), Readiness::ready);
  absolute(-1);
  EXPECT_EQ(readiness(1), Readiness::waits);
  absolute(0);
  EXPECT_EQ(readiness(2), Readiness::ready);
}

// W6
TEST_F(PendingTest, GoInUnchangedWithTheirNoiseAndLoss) {
  const VariableId<Point2d> l = landmark();
  pending.begin(gnss);
  pending.add(Prior{Position{{{1.0, 2.0}}}}, Sigmas(Vec2d{{0.1, 0.2}}), Huber(1.5), at(300));
  pending.add(Sight{{{4.0, 3.0}}}, Sigma(0.3), at(300), l);
  pending.end();
  const std::vector<FactorId> in = enter(0);
  ASSERT_EQ(in.size(), 2u);
  EXPECT_EQ(pending.size(), 0u);  // used once
  for (const auto& table : graph.tables()) {
    const std::uint32_t row = table->slots().find(in[0].key);
    if (table->ops().key != in[0].table) continue;
    EXPECT_EQ(static_cast<const Prior<Position>*>(table->measurement(row))->value.v, (Vec2d{{1.0, 2.0}}));
    EXPECT_EQ(static_cast<const DiagonalNoise<2>*>(table->noise(row))->w, (Vec2d{{10.0, 5.0}}));
    EXPECT_EQ(table->loss(row).kind, LossKind::huber);
    EXPECT_EQ(table->loss(row).scale, 1.5);
  }
  int at_landmark = 0;
  graph.for_each_factor(l, [&](auto, auto) { ++at_landmark; });
  EXPECT_EQ(at_landmark, 1);
}

// W6
TEST_F(PendingTest, AreNotTooOldByWhatIsStatic) {
  make(at_ms(500));
  GraphEdit edit = graph.edit();
  edit.remove(states.timeline(positions).oldest()->variables[0]);
  ASSERT_TRUE(graph.apply(edit).ok());
  states.forget(positions, at_ms(0));
  const VariableId<Point2d> l = landmark();
  pending.begin(gnss);
  pending.add(Prior{Point2d{}}, Sigma(1.0), l);
  pending.end();
  EXPECT_EQ(readiness(0), Readiness::ready);
  pending.begin(gnss);
  pending.add(Sight{{{4.0, 3.0}}}, Sigma(0.3), at(500), l);
  pending.end();
  EXPECT_EQ(readiness(1), Readiness::ready);
  absolute(499);
  EXPECT_EQ(readiness(2), Readiness::too_old);
}

// W6
TEST_F(PendingTest, AreRefusedOnceAStaticVariableIsGone) {
  const VariableId<Point2d> l = landmark();
  pending.begin(gnss);
  pending.add(Sight{{{4.0, 3.0}}}, Sigma(0.3), at(99999), l);
  pending.end();
  EXPECT_EQ(readiness(), Readiness::waits);
  GraphEdit edit = graph.edit();
  edit.remove(l);
  ASSERT_TRUE(graph.apply(edit).ok());
  EXPECT_EQ(readiness(), Readiness::unknown_id);
}

TEST_F(PendingTest, AreRefusedWhereNoStateHasSuchAVariable) {
  pending.begin(gnss);
  pending.add(Prior{Level{}}, Sigma(1.0), At<Level>{positions, at_ms(0)});
  pending.end();
  EXPECT_EQ(readiness(), Readiness::unknown_state);
  pending.begin(gnss);
  pending.add(Prior{Level{}}, Sigma(1.0), At<Level>{{7}, at_ms(0)});
  pending.end();
  EXPECT_EQ(readiness(1), Readiness::unknown_state);
}

TEST_F(PendingTest, BringVariablesOfTheirOwn) {
  pending.begin(gnss);
  const VariableId<Point2d> a = pending.add(Point2d{{{1.0, 1.0}}}), b = pending.add(Point2d{{{2.0, 2.0}}});
  pending.add(Sight{{{1.0, 1.0}}}, Sigma(0.3), at(0), b);
  pending.add(Sight{{{3.0, 3.0}}}, Sigma(0.3), at(0), a);
  pending.end();
  EXPECT_EQ(readiness(), Readiness::ready);
  GraphEdit edit = graph.edit();
  std::vector<VariableKey> variables;
  std::vector<FactorId> factors;
  pending.insert(pending.groups()[0], states, edit, variables, factors);
  ASSERT_TRUE(graph.apply(edit).ok());
  ASSERT_EQ(variables.size(), 2u);
  EXPECT_EQ(graph.value(VariableId<Point2d>{variables[1].key}).p, (Vec2d{{2.0, 2.0}}));
  NativeEngine engine(graph);
  ASSERT_TRUE(engine.solve().converged());
  EXPECT_LT((graph.value(VariableId<Point2d>{variables[0].key}).p - Vec2d{{3.0, 3.0}}).norm(), 1e-9);
  EXPECT_LT((graph.value(VariableId<Point2d>{variables[1].key}).p - Vec2d{{1.0, 1.0}}).norm(), 1e-9);
}

TEST_F(PendingTest, KeepTheirContentsWhenOthersBeforeThemAreDone) {
  for (int k = 0; k < 6; ++k) {
    pending.begin(gnss);
    const auto l = pending.add(Point2d{{{1.0 * k, 0.0}}});
    pending.add(Sight{{{0.0, 1.0 * k}}}, Sigma(1.0), at(100 * k), l);
    pending.add(Prior{Position{{{10.0 * k, 0.0}}}}, Sigma(1.0), at(100 * k));
    pending.end();
  }
  for (const std::size_t k : {0, 2, 3}) pending.drop(k);
  pending.compact();
  ASSERT_EQ(pending.size(), 3u);
  for (const int k : {1, 4, 5}) {
    const PendingFactors::Group group = pending.groups()[0];
    EXPECT_EQ(group.newest, at_ms(100 * k));
    const auto factors = pending.factors(group);
    ASSERT_EQ(factors.size(), 2u);
    EXPECT_EQ(static_cast<const Sight*>(pending.measurement(factors[0]))->seen[1], k);
    EXPECT_EQ(static_cast<const Prior<Position>*>(pending.measurement(factors[1]))->value.v[0], 10.0 * k);
    EXPECT_EQ(pending.refs(factors[0])[0].time, at_ms(100 * k));
    EXPECT_EQ(enter(0).size(), 2u);
    double newest = -1.0;
    graph.for_each<Point2d>([&](auto, const Point2d& l) { newest = l.p[0]; });
    EXPECT_EQ(newest, k);
  }
}

TEST_F(PendingTest, AskForNoMemoryOnceTheyHaveHadIt) {
  if (!counts_allocations()) GTEST_SKIP() << "a sanitizer has an operator new of its own";
  const VariableId<Point2d> l = landmark();
  std::int64_t before = 0;
  for (int k = 0; k < 50; ++k) {
    if (k == 10) before = allocation_count();
    for (int i = 0; i < 5; ++i) {
      pending.begin(gnss);
      pending.add(Sight{{{0.0, 1.0}}}, Sigma(1.0), at(10 * i), l);
      pending.end();
    }
    for (std::size_t i = k == 0 ? 1 : 0; i < 5; ++i) pending.drop(i);
    pending.compact();
  }
  EXPECT_EQ(allocation_count() - before, 0);
  EXPECT_EQ(pending.size(), 1u);
}

}  // namespace
}  // namespace oriel
