// A user's states: what moves them is measured by a sensor of the user's own (rail.h has the provider).
#include <gtest/gtest.h>

#include "rail.h"

namespace {

using namespace oriel;  // NOLINT(google-build-using-namespace): as a user would write it
using namespace oriel::rail;

TEST(CustomProvider, MakesStatesWhereMeasurementsNeedThem) {  // W3
  Rail rail;
  rail.pass(5.0, at_s(0));
  rail.pass(15.0, at_s(10));
  ASSERT_EQ(rail.window.update().status, WindowUpdate::Status::updated);
  EXPECT_EQ(rail.window.states().timeline(rail.wheel).size(), 2u);
  EXPECT_NEAR(rail.where(at_s(10)), 15.0, 0.01);

  rail.pass(9.0, at_s(4));  // came late, between two: the motion is split
  ASSERT_EQ(rail.window.update().status, WindowUpdate::Status::updated);
  EXPECT_EQ(rail.window.states().timeline(rail.wheel).size(), 3u);
  EXPECT_NEAR(rail.where(at_s(4)), 9.0, 0.01);
}

TEST(CustomProvider, IsWaitedForUntilItsMeasurementsReachThere) {  // W5
  Rail rail;
  rail.pass(5.0, at_s(0));
  rail.pass(105.5, at_s(101));
  EXPECT_EQ(rail.window.update().waiting, 1);
  rail.states->add(at_s(101), 100.5);
  EXPECT_EQ(rail.window.update().waiting, 0);
  EXPECT_NEAR(rail.where(at_s(101)), 105.5, 0.05);
}

TEST(CustomProvider, MayForgetWhatIsOlderThanTheWindow) {  // W13
  Rail rail;
  for (int s = 0; s <= 50; ++s) {
    rail.pass(s, at_s(s));
    ASSERT_EQ(rail.window.update().status, WindowUpdate::Status::updated);
  }
  EXPECT_EQ(rail.window.states().timeline(rail.wheel).size(), 10u);  // the shipped policy's
  EXPECT_EQ(rail.states->readings(), 100u - 41u + 1u);
}

}  // namespace
