// The two small owners that stand in for std::function and std::unique_ptr in public headers.
#include "oriel/base/function.h"

#include <gtest/gtest.h>

#include <functional>

#include "oriel/base/owned.h"

namespace oriel {
namespace {

struct Counted {
  int* alive;
  int value = 0;
  explicit Counted(int* a, int v = 0) : alive(a), value(v) { ++*alive; }
  Counted(const Counted& other) : alive(other.alive), value(other.value) { ++*alive; }
  Counted& operator=(const Counted&) = default;
  ~Counted() { --*alive; }
  int operator()(int x) { return value += x; }
};

TEST(Function, IsEmptyUntilItIsGivenSomethingToCall) {
  Function<int(int)> f;
  EXPECT_FALSE(f);
  f = [](int x) { return x + 1; };
  ASSERT_TRUE(f);
  EXPECT_EQ(f(2), 3);
  f = nullptr;
  EXPECT_FALSE(f);
}

TEST(Function, ACopyHasAStateOfItsOwnAndAllAreDestroyed) {
  int alive = 0;
  {
    Function<int(int)> a = Counted(&alive), b = a;
    EXPECT_EQ(alive, 2);
    EXPECT_EQ(a(5), 5);
    EXPECT_EQ(a(5), 10);
    EXPECT_EQ(b(1), 1);
    b = a;
    EXPECT_EQ(b(1), 11);
    const Function<int(int)> c = std::move(a);
    EXPECT_FALSE(a);  // NOLINT(bugprone-use-after-move): that a moved-from one is empty is what is tested
    EXPECT_EQ(c(0), 10);
    EXPECT_EQ(alive, 2);
  }
  EXPECT_EQ(alive, 0);
}

TEST(Function, PassesReferencesOn) {
  const Function<void(int&)> increment = [](int& x) { ++x; };
  int n = 1;
  increment(n);
  EXPECT_EQ(n, 2);
}

TEST(Function, IsEmptyWhenMadeFromWhatIsEmpty) {
  const std::function<int(int)> none;
  int (*const null)(int) = nullptr;
  EXPECT_FALSE(Function<int(int)>(none));
  EXPECT_FALSE(Function<int(int)>(null));
}

TEST(Function, DropsAResultThatNobodyWants) {
  int calls = 0;
  const Function<void(int)> f = [&calls](int n) { return calls += n; };
  f(3);
  EXPECT_EQ(calls, 3);
}

TEST(Owned, DestroysWhatItHoldsOnceAndCanBeMoved) {
  int alive = 0;
  {
    Owned<Counted> a = make_owned<Counted>(&alive, 7);
    Owned<Counted> b = std::move(a);
    EXPECT_FALSE(a);  // NOLINT(bugprone-use-after-move): that a moved-from one is empty is what is tested
    EXPECT_EQ(b->value, 7);
    b = make_owned<Counted>(&alive, 8);
    EXPECT_EQ(alive, 1);
    EXPECT_EQ((*b).value, 8);
    b = Owned<Counted>();
    EXPECT_EQ(alive, 0);
    EXPECT_EQ(b.get(), nullptr);
  }
  EXPECT_EQ(alive, 0);
}

}  // namespace
}  // namespace oriel
