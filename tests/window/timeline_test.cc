// Times and states by their times.
#include "oriel/window/timeline.h"

#include <gtest/gtest.h>

#include "oriel/window/trajectory.h"

namespace oriel {
namespace {

struct State {
  Time time;
  int number = 0;
};

Timeline<State> timeline_at(std::initializer_list<std::int64_t> stamps) {
  Timeline<State> t;
  int number = 0;
  for (const std::int64_t ns : stamps) t.insert({{ns}, number++});
  return t;
}

// W1
TEST(Timeline, KeepsTwoStatesOneNanosecondApart) {
  constexpr std::int64_t kNow = 1'403'636'579'763'555'584;
  const Timeline<State> t = timeline_at({kNow, kNow + 1});
  ASSERT_EQ(t.size(), 2u);
  EXPECT_EQ(t.find({kNow})->number, 0);
  EXPECT_EQ(t.find({kNow + 1})->number, 1);
}

// W1
TEST(Timeline, OrdersNegativeTimes) {
  const Timeline<State> t = timeline_at({5, -7, 0, -9});
  EXPECT_EQ(t.oldest()->time.ns, -9);
  EXPECT_EQ(t.latest()->time.ns, 5);
  EXPECT_EQ(t.at_or_before({-8})->time.ns, -9);
}

// W1
TEST(Timeline, HasOneStateForTwoSensorsAtOneStamp) {
  Timeline<State> t = timeline_at({10});
  EXPECT_FALSE(t.insert({{10}, 77}));
  EXPECT_EQ(t.size(), 1u);
  EXPECT_EQ(t.find({10})->number, 0);
}

// W2
TEST(Timeline, FindsTheStateItselfWhereATimeIsHitExactly) {
  const Timeline<State> t = timeline_at({10, 20, 30});
  EXPECT_EQ(t.at_or_before({20}), t.at_or_after({20}));
  EXPECT_EQ(t.at_or_before({25})->time.ns, 20);
  EXPECT_EQ(t.at_or_after({25})->time.ns, 30);
}

// W2
TEST(Timeline, HasNoStateBeforeTheFirstOrAfterTheLast) {
  const Timeline<State> t = timeline_at({10, 20, 30}), empty;
  EXPECT_EQ(t.at_or_before({9}), nullptr);
  EXPECT_EQ(t.at_or_after({31}), nullptr);
  EXPECT_EQ(empty.at_or_before({9}), nullptr);
  EXPECT_EQ(empty.at_or_after({9}), nullptr);
  EXPECT_EQ(empty.closest({9}), nullptr);
  EXPECT_EQ(empty.oldest(), nullptr);
  EXPECT_EQ(empty.latest(), nullptr);
}

// W2
TEST(Timeline, TakesTheEarlierOfTwoStatesThatAreEquallyClose) {
  const Timeline<State> t = timeline_at({10, 20});
  EXPECT_EQ(t.closest({15})->time.ns, 10);
  EXPECT_EQ(t.closest({16})->time.ns, 20);
  EXPECT_EQ(t.closest({-100})->time.ns, 10);
  EXPECT_EQ(t.closest({100})->time.ns, 20);
}

// W2
TEST(Timeline, CountsWhatIsOlderThanATimeWithoutThatTimeItself) {
  const Timeline<State> t = timeline_at({10, 20, 30});
  EXPECT_EQ(t.count_before({20}), 1u);
  EXPECT_EQ(t.count_before({21}), 2u);
  EXPECT_EQ(t.count_before({10}), 0u);
}

TEST(Timeline, RemovesAStateByItsTimeAlone) {
  Timeline<State> t = timeline_at({10, 20, 30});
  EXPECT_FALSE(t.remove({15}));
  EXPECT_TRUE(t.remove({20}));
  EXPECT_EQ(t.find({20}), nullptr);
  EXPECT_EQ(t.size(), 2u);
}

TEST(Trajectory, ReplacesWhatIsSaidOfTheNewestTimeAgain) {
  Trajectory t;
  t.add({1}, Pose3d{});
  t.add({1}, Pose3d{Rot3d{}, {{1.0, 2.0, 3.0}}});
  t.add({2}, Pose3d{});
  ASSERT_EQ(t.poses().size(), 2u);
  EXPECT_EQ(t.poses()[0].T_world_body.t[2], 3.0);
}

}  // namespace
}  // namespace oriel
