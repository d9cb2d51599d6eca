// Keys of index + generation: what was erased never resolves again, and what lives stands dense, in order.
#include "oriel/base/slot_map.h"

#include <gtest/gtest.h>

#include <map>
#include <random>
#include <set>

namespace oriel {
namespace {

TEST(SlotMap, ResolvesEveryOtherKeyAfterOneOfAMillionIsErased) {  // V1
  SlotMap<int> map;
  std::vector<SlotKey> keys;
  for (int i = 0; i < 1000000; ++i) keys.push_back(map.add(i));
  const SlotKey gone = keys[500000];
  EXPECT_TRUE(map.erase(gone));
  EXPECT_EQ(map.find(gone), nullptr);
  int wrong = 0;
  for (int i = 0; i < 1000000; ++i)
    if (i != 500000) wrong += map.find(keys[i]) == nullptr || map[keys[i]] != i;
  EXPECT_EQ(wrong, 0);
  const SlotKey next = map.add(-1);
  EXPECT_EQ(next.index, gone.index);
  EXPECT_GT(next.generation, gone.generation);
  EXPECT_EQ(map.find(gone), nullptr);
  EXPECT_EQ(map.size(), 1000000u);
}

TEST(SlotMap, KeepsHolesBelowAQuarterAndTheOrderOfInsertion) {  // V1
  SlotMap<int> map;
  std::vector<std::pair<SlotKey, int>> model;
  std::mt19937 random(7);
  int next = 0;
  for (int step = 0; step < 20000; ++step) {
    if (model.empty() || random() % 5 < 2) {
      model.emplace_back(map.add(next), next);
      ++next;
    } else {
      const auto at = model.begin() + static_cast<std::ptrdiff_t>(random() % model.size());
      ASSERT_TRUE(map.erase(at->first));
      ASSERT_FALSE(map.erase(at->first));
      model.erase(at);
    }
    if (step % 3000 == 0)
      for (int k = 0; k < 500; ++k) model.emplace_back(map.add(next), next), ++next;
    ASSERT_LE((map.extent() - map.size()) * 4, map.extent());
  }
  std::vector<std::pair<SlotKey, int>> walked;
  map.for_each([&](SlotKey k, int v) { walked.emplace_back(k, v); });
  EXPECT_EQ(walked, model);
}

TEST(SlotMap, NeverResolvesAKeyAgainAfterClear) {  // V2
  SlotMap<int> map;
  std::vector<SlotKey> old;
  for (int i = 0; i < 100; ++i) old.push_back(map.add(i));
  map.clear();
  EXPECT_EQ(map.size(), 0u);
  EXPECT_EQ(map.extent(), 0u);
  std::set<std::pair<std::uint32_t, std::uint32_t>> fresh;
  for (int i = 0; i < 200; ++i) {
    const SlotKey k = map.add(i);
    EXPECT_TRUE(fresh.insert({k.index, k.generation}).second);
  }
  for (const SlotKey k : old) {
    EXPECT_EQ(map.find(k), nullptr);
    EXPECT_FALSE(map.erase(k));
    EXPECT_EQ(fresh.count({k.index, k.generation}), 0u);
  }
  EXPECT_THROW(map[old[0]], ContractViolation);  // V2
}

TEST(SlotIndex, NeverLendsAKeyThatWasGivenFromElsewhere) {  // V2
  // A follower inserts under given keys; the same index then lends its own. Against a model of every key ever seen.
  SlotIndex index;
  std::mt19937 random(3);
  std::set<std::pair<std::uint32_t, std::uint32_t>> seen;
  std::vector<SlotKey> live, lent;
  std::uint64_t serial = 0;
  for (int step = 0; step < 30000; ++step) {
    switch (random() % 5) {
      case 0: {
        const SlotKey k = index.lend();
        ASSERT_TRUE(seen.insert({k.index, k.generation}).second) << k.index << "." << k.generation;
        lent.push_back(k);
        break;
      }
      case 1:
        if (lent.empty()) break;
        if (const SlotKey k = lent.back(); index.is_new(k, 1) && index.find_slot(k.index) == SlotIndex::kNone) {
          index.insert(k, ++serial);
          live.push_back(k);
        }
        lent.pop_back();
        break;
      case 2:
        if (lent.empty()) break;
        index.give_back(lent.back());
        lent.pop_back();
        break;
      case 3: {
        const SlotKey k{static_cast<std::uint32_t>(random() % 60), static_cast<std::uint32_t>(1 + random() % 40)};
        if (!index.is_new(k, 1) || index.find_slot(k.index) != SlotIndex::kNone) break;
        if (!seen.insert({k.index, k.generation}).second) break;
        index.insert(k, ++serial);
        live.push_back(k);
        break;
      }
      default:
        if (live.empty()) break;
        const std::size_t at = random() % live.size();
        ASSERT_TRUE(index.erase(live[at]));
        live.erase(live.begin() + static_cast<std::ptrdiff_t>(at));
    }
    if (index.wants_compaction()) index.compact([](auto, auto) {}, [](auto) {});
  }
  for (const SlotKey k : live) EXPECT_NE(index.find(k), SlotIndex::kNone);
  EXPECT_EQ(index.size(), live.size());
}

TEST(SlotIndex, RefusesAKeyThatWouldAskForAllMemory) {
  SlotIndex index;
  EXPECT_FALSE(index.is_new({0xfffffffeu, 1}, 1));
  EXPECT_FALSE(index.is_new({0, 0}, 1));
  EXPECT_TRUE(index.is_new({1000, 1}, 1));
}

TEST(SlotIndex, GrowsByDoublingWhenReservedOneByOne) {  // V1
  std::vector<int> v;
  int moves = 0;
  const int* at = nullptr;
  for (int i = 0; i < 100000; ++i) {
    reserve_more(v, 1);
    v.push_back(i);
    moves += at != v.data();
    at = v.data();
  }
  EXPECT_LE(moves, 20);
}

}  // namespace
}  // namespace oriel
