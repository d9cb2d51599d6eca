// States come, split motions, and go again, whole or not at all.
#include "oriel/window/states.h"

#include <gtest/gtest.h>

#include "linear_world.h"
#include "oriel/graph/fingerprint.h"
#include "oriel/solve/native_engine.h"

namespace oriel {
namespace {

using namespace linear_world;

struct StatesTest : ::testing::Test {
  Graph graph;
  States states;
  PositionProvider* position = nullptr;
  LevelProvider* level = nullptr;
  ProviderId positions, levels;

  StatesTest() {
    auto p = std::make_unique<PositionProvider>();
    auto l = std::make_unique<LevelProvider>();
    position = p.get(), level = l.get();
    position->moved.begin(at_ms(-1000));
    level->moved.begin(at_ms(-1000));
    for (int k = 0; k < 40; ++k) {
      position->moved.add(at_ms(-900 + 100 * k), {{0.1, 0.01 * k}});
      level->moved.add(at_ms(-900 + 100 * k), {{0.1, 0.2, 0.01 * k, -0.1}});
    }
    positions = states.add(std::move(p));
    levels = states.add(std::move(l));
  }
  Result<State> make(ProviderId id, Time time) {
    GraphEdit edit = graph.edit();
    Result<State> state = states.request(edit, id, time);
    if (state)
      if (auto ok = states.link(edit); !ok) state = ok.error();
    if (state)
      if (auto ok = graph.apply(edit); !ok) state = ok.error();
    if (state)
      states.commit();
    else
      edit.clear(), states.rollback();
    return state;
  }
  bool withdraw(ProviderId id, Time time) {
    GraphEdit edit = graph.edit();
    const bool ok = states.withdraw(edit, id, time).ok() && states.link(edit).ok() && graph.apply(edit).ok();
    if (ok)
      states.commit();
    else
      states.rollback();
    return ok;
  }
  Position value(Time time) {
    return graph.value(VariableId<Position>{states.find(positions, time, kVariableOps<Position>.key).key});
  }
  std::size_t motions() const {
    std::size_t n = 0;
    for (const auto& t : graph.tables())
      if (t->ops().residual == Between<Position>::kName) n = t->slots().size();
    return n;
  }
};

// W3
TEST_F(StatesTest, BeginsWithAPriorOnEachVariable) {
  ASSERT_TRUE(make(positions, at_ms(0)).ok());
  EXPECT_EQ(graph.variable_count(), 1u);
  EXPECT_EQ(graph.factor_count(), 1u);
  ASSERT_TRUE(make(levels, at_ms(0)).ok());
  EXPECT_EQ(graph.variable_count(), 3u);
  EXPECT_EQ(graph.factor_count(), 3u);
}

// W3
TEST_F(StatesTest, ChangesNothingWhereThereIsAStateAlready) {
  const State first = *make(positions, at_ms(0));
  const std::uint64_t before = fingerprint(graph);
  const Result<State> again = make(positions, at_ms(0));
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(again->variables[0], first.variables[0]);
  EXPECT_EQ(fingerprint(graph), before);
}

// W3, W1
TEST_F(StatesTest, LinksAndPredictsAStateThatIsNewer) {
  ASSERT_TRUE(make(positions, at_ms(0)).ok());
  ASSERT_TRUE(make(positions, at_ms(250)).ok());
  EXPECT_EQ(motions(), 1u);
  EXPECT_NEAR(value(at_ms(250)).v[0], 0.25, 1e-12);
  const Time next = at_ms(250) + Duration{1};  // one nanosecond later is another state
  ASSERT_TRUE(make(positions, next).ok());
  EXPECT_EQ(motions(), 2u);
  EXPECT_EQ(states.timeline(positions).size(), 3u);
}

// W3
TEST_F(StatesTest, PredictsFromTheNearestOlderStateWhereverThatIsByNow) {
  for (const int ms : {0, 400, 1000}) ASSERT_TRUE(make(positions, at_ms(ms)).ok());
  GraphEdit edit = graph.edit();
  for (const int ms : {0, 400, 1000}) {
    const VariableKey id = states.find(positions, at_ms(ms), kVariableOps<Position>.key);
    edit.set(VariableId<Position>{id.key}, Position{{{1.0 * ms, -5.0}}});
  }
  ASSERT_TRUE(graph.apply(edit).ok());
  const auto moved = [&](int from, int to) { return position->moved.between(at_ms(from), at_ms(to)); };
  const auto expect_at = [&](int ms, int from) {
    ASSERT_TRUE(make(positions, at_ms(ms)).ok());
    EXPECT_LT((value(at_ms(ms)).v - (value(at_ms(from)).v + moved(from, ms))).norm(), 1e-12) << ms;
  };
  expect_at(700, 400);    // between two: from the older, not from the closer
  expect_at(950, 700);    // from one that came only now
  expect_at(1300, 1000);  // newer than all
}

// W3
TEST_F(StatesTest, SplitsTheMotionWhereAStateComesBetweenTwo) {
  const State a = *make(positions, at_ms(0)), c = *make(positions, at_ms(1000));
  // Of the user, between the same states: it stays.
  GraphEdit own = graph.edit();
  const VariableId<Position> xa{a.variables[0].key}, xc{c.variables[0].key};
  const FactorId mine = own.add(Between{Position{{{1.0, 1.0}}}}, Sigma(0.3), xa, xc);
  ASSERT_TRUE(graph.apply(own).ok());
  const std::uint64_t version = graph.version();
  ASSERT_TRUE(make(positions, at_ms(430)).ok());
  EXPECT_EQ(graph.version(), version + 1);  // in one edit
  EXPECT_EQ(motions(), 3u);                 // two halves and the user's
  EXPECT_TRUE(graph.contains(mine));
  EXPECT_FALSE(graph.contains(c.motion));
  EXPECT_TRUE(graph.contains(states.timeline(positions).find(at_ms(430))->motion));
  EXPECT_TRUE(graph.contains(states.timeline(positions).find(at_ms(1000))->motion));
}

// W3, W8
TEST_F(StatesTest, EndAtTheSameOptimumInWhateverOrderTheyCame) {
  auto optimum = [](const std::vector<int>& order) {
    StatesTest_EndAtTheSameOptimumInWhateverOrderTheyCame_Test t;
    EXPECT_TRUE(t.make(t.positions, at_ms(0)).ok());
    for (const int ms : order) EXPECT_TRUE(t.make(t.positions, at_ms(ms)).ok());
    GraphEdit edit = t.graph.edit();
    const VariableId<Position> last{t.states.timeline(t.positions).latest()->variables[0].key};
    edit.add(Prior{Position{{{3.0, -2.0}}}}, Sigma(0.1), last);
    EXPECT_TRUE(t.graph.apply(edit).ok());
    NativeEngine engine(t.graph);
    EXPECT_TRUE(engine.solve().converged());
    return std::array{t.value(at_ms(130)).v, t.value(at_ms(250)).v, t.value(at_ms(900)).v};
  };
  const auto in_order = optimum({130, 250, 900}), late = optimum({900, 130, 250}), other = optimum({900, 250, 130});
  for (std::size_t k = 0; k < in_order.size(); ++k) {
    EXPECT_LT((in_order[k] - late[k]).norm(), 1e-12);
    EXPECT_LT((in_order[k] - other[k]).norm(), 1e-12);
  }
}

TEST_F(StatesTest, MakeSeveralInOneEditInAnyOrder) {
  ASSERT_TRUE(make(positions, at_ms(0)).ok());
  ASSERT_TRUE(make(positions, at_ms(1000)).ok());
  GraphEdit edit = graph.edit();
  for (const int ms : {700, 300, 500, 1500}) ASSERT_TRUE(states.request(edit, positions, at_ms(ms)).ok());
  ASSERT_TRUE(states.link(edit).ok());
  ASSERT_TRUE(graph.apply(edit).ok());
  states.commit();
  EXPECT_EQ(motions(), 5u);
  for (std::size_t k = 1; k < states.timeline(positions).size(); ++k)
    EXPECT_TRUE(graph.contains(states.timeline(positions)[k].motion));
  EXPECT_NEAR(value(at_ms(500)).v[0], 0.5, 1e-12);
}

// W4
TEST_F(StatesTest, LeaveTheGraphAsItWasWhereASplitFailsHalfWay) {
  ASSERT_TRUE(make(positions, at_ms(0)).ok());
  ASSERT_TRUE(make(positions, at_ms(1000)).ok());
  const std::uint64_t before = fingerprint(graph);
  position->faults.link_fails_in = 1;  // the second half
  EXPECT_FALSE(make(positions, at_ms(400)).ok());
  EXPECT_EQ(fingerprint(graph), before);
  EXPECT_EQ(states.timeline(positions).size(), 2u);
  position->faults.link_nan_in = 1;  // the second half is not a number: the edit is refused
  EXPECT_FALSE(make(positions, at_ms(400)).ok());
  EXPECT_EQ(fingerprint(graph), before);
  EXPECT_TRUE(graph.contains(states.timeline(positions).latest()->motion));
  ASSERT_TRUE(make(positions, at_ms(400)).ok());  // and nothing is in its way
  EXPECT_EQ(motions(), 2u);
}

// W5
TEST_F(StatesTest, CannotBeHadBeforeTheFirstOrBeyondTheMeasurements) {
  EXPECT_EQ(states.reach(positions, at_ms(-1001)), Reach::not_yet);
  EXPECT_EQ(states.reach(positions, at_ms(0)), Reach::possible);
  ASSERT_TRUE(make(positions, at_ms(0)).ok());
  EXPECT_EQ(states.reach(positions, at_ms(0)), Reach::there);
  EXPECT_EQ(states.reach(positions, at_ms(-1)), Reach::not_yet);
  EXPECT_EQ(states.reach(positions, position->moved.last()), Reach::possible);
  EXPECT_EQ(states.reach(positions, position->moved.last() + Duration{1}), Reach::not_yet);
  const std::uint64_t before = fingerprint(graph);
  EXPECT_FALSE(make(positions, at_ms(99999)).ok());
  EXPECT_EQ(fingerprint(graph), before);
}

TEST_F(StatesTest, AreAsIfTheyHadNeverBeenOnceWithdrawn) {
  for (const int ms : {0, 400, 1000}) ASSERT_TRUE(make(positions, at_ms(ms)).ok());
  ASSERT_TRUE(withdraw(positions, at_ms(400)));
  EXPECT_EQ(motions(), 1u);
  EXPECT_TRUE(graph.contains(states.timeline(positions).latest()->motion));
  ASSERT_TRUE(withdraw(positions, at_ms(1000)));
  EXPECT_EQ(motions(), 0u);
  ASSERT_TRUE(withdraw(positions, at_ms(0)));
  EXPECT_EQ(graph.variable_count(), 0u);
  EXPECT_EQ(graph.factor_count(), 0u);
  EXPECT_EQ(states.reach(positions, at_ms(-500)), Reach::possible);  // it may begin anew, wherever it is
}

TEST_F(StatesTest, AreTooOldOnceTheOldestWasMarginalized) {
  for (const int ms : {0, 400, 1000, 1200}) ASSERT_TRUE(make(positions, at_ms(ms)).ok());
  GraphEdit edit = graph.edit();
  edit.remove(states.timeline(positions).oldest()->variables[0]);
  ASSERT_TRUE(graph.apply(edit).ok());
  states.forget(positions, at_ms(0));
  EXPECT_EQ(states.reach(positions, at_ms(399)), Reach::too_old);
  EXPECT_EQ(states.reach(positions, at_ms(400)), Reach::there);
  EXPECT_EQ(states.reach(positions, at_ms(401)), Reach::possible);
  EXPECT_FALSE(states.timeline(positions).oldest()->has_motion());
  // One from the middle: nothing can come between its neighbours, whose motion is not a factor any more.
  edit.clear();
  edit.remove(states.timeline(positions).find(at_ms(1000))->variables[0]);
  ASSERT_TRUE(graph.apply(edit).ok());
  states.forget(positions, at_ms(1000));
  EXPECT_EQ(states.reach(positions, at_ms(1100)), Reach::too_old);
  EXPECT_EQ(states.reach(positions, at_ms(500)), Reach::too_old);
  EXPECT_EQ(states.reach(positions, at_ms(1201)), Reach::possible);
}

}  // namespace
}  // namespace oriel
