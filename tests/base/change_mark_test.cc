#include "oriel/base/change_mark.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "oriel/base/identity.h"
#include "oriel/base/slot_map.h"

namespace oriel {
namespace {

TEST(ChangeMark, SaysThatAllIsTheSameWhereNothingHasChanged) {
  ChangeMark mark;
  EXPECT_EQ(mark.same_since(mark.count()), ChangeMark::kAll);
  mark.note(7);
  EXPECT_EQ(mark.same_since(mark.count()), ChangeMark::kAll);
  EXPECT_EQ(mark.same_since(0), 7u);
}

// The oracle keeps every change. What is said is never too much; and where changes are few, or near each other, it is
// all that can be said.
TEST(ChangeMark, NeverSaysTooMuchAndMostlyAllThereIs) {
  std::mt19937 random(3);
  ChangeMark mark;
  std::vector<std::uint32_t> places{0};  // of change k
  const auto truth = [&](std::uint64_t then) {
    std::uint32_t least = ChangeMark::kAll;
    for (std::size_t k = then + 1; k < places.size(); ++k) least = std::min(least, places[k]);
    return least;
  };
  int asked = 0, exact = 0;
  for (int round = 0; round < 400; ++round) {
    const bool ascending = random() % 2 == 0;
    const std::uint32_t first = random() % 10 == 0 ? random() % 1000 : 100000 + random() % 1000;
    for (std::uint32_t i = 0, n = random() % 100; i < n; ++i) {
      places.push_back(ascending ? first + i : first + n - i);
      mark.note(places.back());
    }
    ASSERT_EQ(mark.count() + 1, places.size());
    for (int look = 0; look < 10; ++look) {
      const std::uint64_t back = random() % std::min<std::uint64_t>(places.size(), look < 5 ? 100 : 100000);
      const std::uint64_t then = mark.count() - back;
      ASSERT_LE(mark.same_since(then), truth(then));
      ++asked;
      exact += truth(then) == ChangeMark::kAll || truth(then) - mark.same_since(then) <= 100;
    }
  }
  EXPECT_GT(exact, asked * 9 / 10);
}

// What a follower has to know of a column: what stood below is there, at its place, and nothing else is.
TEST(SlotIndex, SaysSinceWhenItsBeginningStandsAsItDoes) {
  std::mt19937 random(5);
  struct Look {
    std::uint64_t changes;
    std::vector<std::uint32_t> slots;  // by dense position; kNone: a hole
  };
  SlotIndex index;
  std::vector<SlotKey> keys;
  std::vector<Look> looks;
  std::uint64_t serial = 0;
  std::size_t same = 0, all = 0;
  const auto slot_at = [&](std::uint32_t d) { return index.is_live(d) ? index.key(d).index : SlotIndex::kNone; };
  for (int step = 0; step < 3000; ++step) {
    for (int i = static_cast<int>(random() % 4); i > 0; --i) {
      keys.push_back(index.lend());
      index.insert(keys.back(), ++serial);
    }
    for (int i = static_cast<int>(random() % 4); i > 0 && !keys.empty(); --i) {
      const std::size_t newest = std::min<std::size_t>(keys.size(), 5), at = keys.size() - 1 - random() % newest;
      const std::size_t which = random() % 50 == 0 ? random() % keys.size() : at;
      index.erase(keys[which]);
      keys.erase(keys.begin() + static_cast<std::ptrdiff_t>(which));
    }
    if (index.wants_compaction()) index.compact([](auto, auto) {}, [](auto) {});
    for (const Look& look : looks) {
      const std::size_t n = std::min<std::size_t>(look.slots.size(), index.changes().same_since(look.changes));
      ASSERT_LE(n, index.extent());
      for (std::uint32_t d = 0; d < n; ++d) ASSERT_EQ(slot_at(d), look.slots[d]) << "step " << step;
      same += n, all += look.slots.size();
    }
    looks.push_back({index.changes().count(), {}});
    for (std::uint32_t d = 0; d < index.extent(); ++d) looks.back().slots.push_back(slot_at(d));
    if (looks.size() > 20) looks.erase(looks.begin());
  }
  EXPECT_GT(same, all / 4);  // it does not say nothing
}

TEST(Identity, IsThatOfOneObjectWhereverItMoves) {
  const Identity nobody;
  EXPECT_FALSE(nobody.is(nobody));
  Identity a = Identity::make(), b = Identity::make(), copy = a;
  EXPECT_TRUE(copy.is(a));
  EXPECT_FALSE(a.is(b));
  const Identity moved = std::move(a);
  EXPECT_TRUE(moved.is(copy));
  b = copy;
  EXPECT_TRUE(b.is(moved));
}

}  // namespace
}  // namespace oriel
