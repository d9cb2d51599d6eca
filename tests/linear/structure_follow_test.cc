// A structure that follows a large graph, against one that is built from nothing with the same elimination order: the
// same bits. The graphs here are small; they are told to count as large.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <random>
#include <vector>

#include "oriel/manifold/se2.h"
#include "oriel/manifold/se3.h"
#include "oriel/residual/between.h"
#include "oriel/residual/prior.h"
#include "tests/linear/step_of.h"

namespace oriel {
namespace {

// A drive that goes on, forgets its newest end, ties and unties, fixes and frees.
template <class Pose>
struct Drive {
  explicit Drive(unsigned seed) : random(seed) {}
  int below(std::size_t n) { return static_cast<int>(random() % n); }
  Pose somewhere() {
    Vec<double, Pose::kDim> d;
    for (int i = 0; i < Pose::kDim; ++i) d[i] = std::uniform_real_distribution<double>(-0.2, 0.2)(random);
    return Pose{}.plus(d);
  }
  FactorId tie(GraphEdit& edit, VariableId<Pose> a, VariableId<Pose> b) {
    return edit.add(Between<Pose>{somewhere()}, Sigma(0.3), a, b);
  }
  void grow(GraphEdit& edit, int n) {
    for (; n > 0; --n) {
      poses.push_back(edit.add(somewhere()));
      if (poses.size() == 1) edit.add(Prior{Pose{}}, Sigma(0.1), poses[0]);
      if (poses.size() > 1) factors.push_back(tie(edit, poses[poses.size() - 2], poses.back()));
      if (poses.size() > 25 && below(3) == 0)
        factors.push_back(tie(edit, poses[poses.size() - 21 - static_cast<std::size_t>(below(4))], poses.back()));
      if (poses.size() > 25 && below(12) == 0)  // of a table of few rows, which is compacted soon
        factors.push_back(edit.add(Between<Pose>{somewhere()}, DiagonalNoise<Pose::kDim>{},
                                   poses[static_cast<std::size_t>(below(poses.size() / 2))], poses.back()));
    }
  }
  // Another variable in the place of the newest, tied in the same way.
  void replace_newest(GraphEdit& edit) {
    edit.remove(poses.back());
    poses.back() = edit.add(somewhere());
    factors.push_back(tie(edit, poses[poses.size() - 2], poses.back()));
    factors.push_back(tie(edit, poses[poses.size() - 22], poses.back()));
  }
  void shrink(GraphEdit& edit, int n) {
    for (; n > 0 && poses.size() > 40; --n) {
      edit.remove(poses.back());
      poses.pop_back();
    }
  }
  void change(GraphEdit& edit) {
    switch (below(9)) {
      case 0:
      case 1:
      case 2:
        return grow(edit, 1 + below(4));
      case 3:
        return shrink(edit, 1 + below(4));
      case 8:
        return replace_newest(edit);
      case 4:
        factors.push_back(tie(edit, poses[static_cast<std::size_t>(below(poses.size()))], poses.front()));
        return;
      case 5: {
        const std::size_t at = static_cast<std::size_t>(below(factors.size()));
        if (graph.contains(factors[at])) edit.remove(factors[at]);
        return;
      }
      case 6:  // at the newest end, mostly
        return edit.fix(poses[poses.size() - 1 - static_cast<std::size_t>(below(below(4) == 0 ? poses.size() : 2))],
                        below(2) == 0);
      default:
        if (below(3) == 0) {  // anywhere: all places behind it move
          const std::size_t at = 1 + static_cast<std::size_t>(below(poses.size() - 2));
          edit.remove(poses[at]);
          poses.erase(poses.begin() + static_cast<std::ptrdiff_t>(at));
        } else {
          edit.add(Prior{somewhere()}, Sigma(1.0), poses[static_cast<std::size_t>(below(poses.size()))]);
        }
    }
  }
  void apply_change() {
    GraphEdit edit = graph.edit();
    change(edit);
    ASSERT_TRUE(graph.apply(edit));
  }

  std::mt19937 random;
  Graph graph;
  std::vector<VariableId<Pose>> poses;
  std::vector<FactorId> factors;
};

struct Followed {
  int updates = 0, orders = 0;
};

template <class Pose>
Followed follow(unsigned seed, int poses, int changes) {
  Drive<Pose> drive(seed);
  GraphEdit edit = drive.graph.edit();
  drive.grow(edit, poses);
  EXPECT_TRUE(drive.graph.apply(edit));
  LinearStructure kept;
  EliminationOrder order;
  EXPECT_TRUE(kept.build(drive.graph, counts_as_large(), order));
  for (int k = 0; k < changes; ++k) {
    for (int more = drive.below(3); more >= 0; --more) drive.apply_change();
    EliminationOrder same = order;  // of an engine whose caches were dropped
    LinearStructure fresh;
    EXPECT_TRUE(kept.build(drive.graph, counts_as_large(), order));
    EXPECT_TRUE(fresh.build(drive.graph, counts_as_large(), same));
    EXPECT_EQ(order, same) << seed << " " << k;
    EXPECT_EQ(kept.factorization().symbolic().flops(), fresh.factorization().symbolic().flops());
    EXPECT_EQ(step_of(drive.graph, kept), step_of(drive.graph, fresh)) << seed << " " << k;
    if (::testing::Test::HasFailure()) break;
  }
  return {static_cast<int>(kept.factorization().updates()), static_cast<int>(order.made)};
}

int longer(int n) {
  const char* times = std::getenv("ORIEL_FOLLOW_TIMES");
  return times == nullptr ? n : n * std::atoi(times);
}

// L10
TEST(StructureFollow, HasTheBitsOfOneThatIsBuiltAnew) {
  Followed all;
  for (int seed = 1; seed <= longer(8) && !HasFailure(); ++seed) {
    const Followed f = follow<Pose2d>(static_cast<unsigned>(seed), 300, 40);
    all.updates += f.updates, all.orders += f.orders;
  }
  EXPECT_GT(all.updates, longer(8) * 8) << "what follows nearly always begins anew";
  EXPECT_GT(all.orders, longer(8)) << "no order was ever made anew";
}

// L10: in three dimensions, where there are rows enough for slices.
TEST(StructureFollow, HasTheBitsOfOneThatIsBuiltAnewWithRowsInSlices) {
  const Followed f = follow<Pose3d>(5, 2800, longer(25));
  EXPECT_GT(f.updates, 8);
}

// What changes near the newest end alone, so that the rest is not even looked at: variables of two types come, go
// from between others, are fixed and freed; now and then their columns are compacted, and what is fixed moves as well.
class Churn {
 public:
  explicit Churn(unsigned seed) : random_(seed) {
    GraphEdit edit = graph_.edit();
    for (int i = 0; i < 250; ++i) come(edit);
    EXPECT_TRUE(graph_.apply(edit));
  }
  const Graph& graph() const { return graph_; }
  void step() {
    apply([this](GraphEdit& edit) {
      for (int n = below(8); n > 0; --n) come(edit);
    });
    apply([this](GraphEdit& edit) {
      for (int n = below(6); n > 0 && flat_.size() > 200; --n) go(edit, flat_);
      for (int n = below(3); n > 0 && deep_.size() > 60; --n) go(edit, deep_);
    });
    apply([this](GraphEdit& edit) { change(edit); });
  }

 private:
  void apply(auto fill) {
    GraphEdit edit = graph_.edit();
    fill(edit);
    EXPECT_TRUE(graph_.apply(edit));
  }
  void change(GraphEdit& edit) {
    if (below(3) != 0) edit.fix(flat_[newest(flat_, 25)], below(2) == 0);
    if (below(6) == 0) edit.fix(deep_[newest(deep_, 8)], below(2) == 0);
    // To what is far back, and a row of few.
    if (below(3) == 0) edit.add(Between<Pose2d>{}, Sigma(0.3), flat_[at(flat_)], flat_[newest(flat_, 9)]);
    if (below(4) == 0) edit.add(Between<Pose2d>{}, DiagonalNoise<3>{}, flat_[at(flat_)], flat_[newest(flat_, 9)]);
  }
  int below(std::size_t n) { return static_cast<int>(random_() % n); }
  std::size_t at(const auto& all) { return static_cast<std::size_t>(below(all.size())); }
  std::size_t newest(const auto& all, int n) {
    return all.size() - 1 - static_cast<std::size_t>(below(static_cast<std::size_t>(n)));
  }
  template <class Pose>
  void come(GraphEdit& edit, std::vector<VariableId<Pose>>& all) {
    all.push_back(edit.add(Pose{}));
    edit.add(Prior{Pose{}}, Sigma(3.0), all.back());  // that nothing is undetermined whoever goes
    if (all.size() > 1) edit.add(Between<Pose>{}, Sigma(0.3), all[all.size() - 2], all.back());
    if (all.size() > 12 && below(3) == 0) edit.add(Between<Pose>{}, Sigma(0.3), all[newest(all, 12)], all.back());
  }
  void come(GraphEdit& edit) {
    come(edit, flat_);
    if (below(3) == 0) come(edit, deep_);
  }
  void go(GraphEdit& edit, auto& all) {
    const std::size_t which = newest(all, below(6) == 0 ? 14 : 1);
    edit.remove(all[which]);
    all.erase(all.begin() + static_cast<std::ptrdiff_t>(which));
  }

  std::mt19937 random_;
  Graph graph_;
  std::vector<VariableId<Pose2d>> flat_;
  std::vector<VariableId<Pose3d>> deep_;
};

// L10
TEST(StructureFollow, HasTheBitsOfOneThatIsBuiltAnewWhereTheNewestEndAloneIsLookedAt) {
  std::int64_t updates = 0, compactions = 0;
  for (int seed = 1; seed <= longer(4) && !HasFailure(); ++seed) {
    Churn churn(static_cast<unsigned>(seed));
    LinearStructure kept;
    EliminationOrder order;
    std::uint32_t extent = 0;
    for (int k = 0; k < 150 && !HasFailure(); ++k) {
      EliminationOrder same = order;
      LinearStructure fresh;
      ASSERT_TRUE(kept.build(churn.graph(), counts_as_large(), order));
      ASSERT_TRUE(fresh.build(churn.graph(), counts_as_large(), same));
      ASSERT_EQ(order, same) << seed << " " << k;
      ASSERT_EQ(step_of(churn.graph(), kept), step_of(churn.graph(), fresh)) << seed << " " << k;
      const std::uint32_t now = churn.graph().pools()[0]->extent();
      compactions += now < extent;
      extent = now;
      churn.step();
    }
    updates += kept.factorization().updates();
  }
  EXPECT_GT(updates, longer(4) * 30) << "what follows often begins anew";
  EXPECT_GT(compactions, longer(4)) << "no column was compacted";
}

// A graph in the place of another, with tables and columns that may stand where its own stood.
TEST(StructureFollow, TellsAGraphFromAnotherInItsPlace) {
  LinearStructure kept;
  EliminationOrder order;
  for (int k = 0; k < 6; ++k) {
    Drive<Pose2d> drive(k % 2 == 0 ? 1u : 2u);
    GraphEdit edit = drive.graph.edit();
    drive.grow(edit, 60 + k / 2);
    ASSERT_TRUE(drive.graph.apply(edit));
    EliminationOrder same = order;
    LinearStructure fresh;
    ASSERT_TRUE(kept.build(drive.graph, counts_as_large(), order));
    ASSERT_TRUE(fresh.build(drive.graph, counts_as_large(), same));
    ASSERT_EQ(step_of(drive.graph, kept), step_of(drive.graph, fresh)) << k;
  }
}

// The newest has the index of another, and the rows of both name the same indices.
TEST(StructureFollow, TellsAVariableFromAnotherInItsPlace) {
  for (const unsigned seed : {1u, 2u, 3u, 4u, 5u}) {
    Drive<Pose3d> drive(seed);
    GraphEdit edit = drive.graph.edit();
    drive.grow(edit, seed < 4 ? 60 : 2700);
    ASSERT_TRUE(drive.graph.apply(edit));
    LinearStructure kept, fresh;
    EliminationOrder order;
    ASSERT_TRUE(kept.build(drive.graph, counts_as_large(), order));
    for (int k = 0; k < 3; ++k) {
      edit = drive.graph.edit();
      drive.replace_newest(edit);
      ASSERT_TRUE(drive.graph.apply(edit));
      EliminationOrder same = order;
      ASSERT_TRUE(kept.build(drive.graph, counts_as_large(), order));
      ASSERT_TRUE(fresh.build(drive.graph, counts_as_large(), same));
      ASSERT_EQ(step_of(drive.graph, kept), step_of(drive.graph, fresh)) << seed;
    }
  }
}

TEST(StructureFollow, DoesNoSymbolicWorkWhereNothingIsTiedInAnotherWay) {
  Drive<Pose2d> drive(1);
  GraphEdit edit = drive.graph.edit();
  drive.grow(edit, 100);
  ASSERT_TRUE(drive.graph.apply(edit));
  LinearStructure kept;
  EliminationOrder order;
  ASSERT_TRUE(kept.build(drive.graph, counts_as_large(), order));
  edit = drive.graph.edit();
  edit.add(Prior{Pose2d{}}, Sigma(1.0), drive.poses[7]);
  ASSERT_TRUE(drive.graph.apply(edit));
  ASSERT_TRUE(kept.build(drive.graph, counts_as_large(), order));
  EXPECT_EQ(kept.factorization().analyses(), 1);
  EXPECT_EQ(kept.factorization().updates(), 0);
  EXPECT_EQ(order.made, 1u);
}

}  // namespace
}  // namespace oriel
