// When states leave: at least so many stay, then at most so many, then no longer than that.
#include "oriel/window/window_policy.h"

#include <gtest/gtest.h>

#include "linear_world.h"

namespace oriel {
namespace {

using namespace linear_world;

struct PolicyTest : ::testing::Test {
  Graph graph;
  States states;
  ProviderId positions, levels;
  LagPolicy policy;

  PolicyTest() {
    auto p = std::make_unique<PositionProvider>();
    auto l = std::make_unique<LevelProvider>();
    p->moved.begin(at_ms(0)), p->moved.add(at_ms(100000), {});
    l->moved.begin(at_ms(0)), l->moved.add(at_ms(100000), {});
    positions = states.add(std::move(p));
    levels = states.add(std::move(l));
  }
  void fill(ProviderId id, std::initializer_list<int> times_ms) {
    GraphEdit edit = graph.edit();
    for (const int ms : times_ms) ASSERT_TRUE(states.request(edit, id, at_ms(ms)).ok());
    ASSERT_TRUE(states.link(edit).ok());
    ASSERT_TRUE(graph.apply(edit).ok());
    states.commit();
  }
  std::vector<int> leaving(ProviderId id) {
    std::vector<LeavingState> all;
    policy.choose(graph, states, all);
    std::vector<int> times;
    for (const LeavingState& s : all)
      if (s.provider == id) times.push_back(static_cast<int>(s.time.ns / 1000000));
    return times;
  }
  using Times = std::vector<int>;
};

// W11
TEST_F(PolicyTest, KeepsAtMostSoManyStates) {
  ASSERT_TRUE(policy.set({1, 3, {}}).ok());
  fill(positions, {0, 100, 200});
  states.mark_solved();
  EXPECT_EQ(leaving(positions), Times{});
  fill(positions, {300, 400});
  states.mark_solved();
  EXPECT_EQ(leaving(positions), (Times{0, 100}));
}

// W11
TEST_F(PolicyTest, KeepsStatesNoLongerThanTheDurationButTheLeastOfThem) {
  ASSERT_TRUE(policy.set({2, 10, Duration{150000000}}).ok());
  fill(positions, {0, 100, 200, 250});
  states.mark_solved();
  EXPECT_EQ(leaving(positions), (Times{0}));  // the one at the very bound stays
  fill(positions, {1000});
  states.mark_solved();
  EXPECT_EQ(leaving(positions), (Times{0, 100, 200}));
}

// W11
TEST_F(PolicyTest, LetsTheLatestOfTheWantedStartsWin) {
  ASSERT_TRUE(policy.set(positions, {1, 2, {}}).ok());  // wants 300
  ASSERT_TRUE(policy.set(levels, {1, 4, {}}).ok());     // wants 150
  fill(positions, {0, 200, 300, 400});
  fill(levels, {50, 150, 250, 350, 450});
  states.mark_solved();
  EXPECT_EQ(policy.start(states), at_ms(300));
  EXPECT_EQ(leaving(positions), (Times{0, 200}));
  EXPECT_EQ(leaving(levels), (Times{50, 150, 250}));
}

// W11
TEST_F(PolicyTest, IsNeverBelowTheMinimumOfAnyKind) {
  ASSERT_TRUE(policy.set(positions, {1, 2, {}}).ok());
  ASSERT_TRUE(policy.set(levels, {3, 4, {}}).ok());
  fill(positions, {0, 200, 300, 400});
  fill(levels, {50, 150, 250, 350});
  states.mark_solved();
  EXPECT_EQ(policy.start(states), at_ms(150));
  EXPECT_EQ(leaving(positions), (Times{0}));
  EXPECT_EQ(leaving(levels), (Times{50}));
  ASSERT_TRUE(policy.set(levels, {5, 6, {}}).ok());  // it has not even so many
  EXPECT_EQ(leaving(levels), Times{});
  EXPECT_EQ(leaving(positions), (Times{0}));  // older than the oldest of the levels
}

// W11, W12
TEST_F(PolicyTest, NeverGoesPastTheLastSolvedState) {
  ASSERT_TRUE(policy.set({1, 1, {}}).ok());
  fill(positions, {0, 100});
  EXPECT_EQ(leaving(positions), Times{});  // nothing was solved yet
  states.mark_solved();
  fill(positions, {200, 300});
  EXPECT_EQ(leaving(positions), (Times{0}));
  fill(positions, {50});  // came between two that were solved
  EXPECT_EQ(leaving(positions), (Times{0}));
  states.mark_solved();
  EXPECT_EQ(leaving(positions), (Times{0, 50, 100, 200}));
}

// W11
TEST_F(PolicyTest, RefusesSettingsThatCannotBeKept) {
  ASSERT_TRUE(policy.set({2, 5, {}}).ok());
  EXPECT_FALSE(policy.set({0, 5, {}}).ok());
  EXPECT_FALSE(policy.set({6, 5, {}}).ok());
  EXPECT_FALSE(policy.set({1, 5, Duration{-1}}).ok());
  const auto refused = policy.set(levels, {4, 3, {}});
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("max_states = 3"), std::string::npos);
  EXPECT_EQ(policy.lag(positions).min_states, 2);
  EXPECT_EQ(policy.lag(levels).max_states, 5);
}

}  // namespace
}  // namespace oriel
